// The interface of a painter's store of bricks: decoded bricks that stay on a graphics card from frame to
// frame, and are projected there.
//
//   makeRoom -> put what is missing -> Painter::begin -> drawStored -> draw ... -> end
//
// The store makes the splats that BrickProjector would make, except for rounding, with the same keys and records:
// cut by clip planes, at the layers of the pixels, and with the scalar of their colours. Splats at borders are
// divided into pieces when a brick is put into the store (BrickPieces); this does not depend on the view, and any
// thread may do it. All calls of a store are on the painter's thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/cache/series.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// A part of a brick to be drawn from a store.
struct StoredPart {
  uint32_t brick = 0;
  size_t splats = 0;  // splats of the whole brick
  std::array<uint32_t, 8> octant_splats{};
  SplatRanges ranges;
  glm::dvec3 cell_min;
  KeyRange keys;
  uint32_t clips = 0;     // bit n: ProjectionSettings::clip_planes[n] may cut splats of the brick
  bool layered = false;   // they may meet layers
  bool coloured = false;  // in a picture of two scalars

  /// The elements that one splat is drawn as at most: its records, then itself.
  size_t elementsASplat() const { return 1 + (clips != 0 ? 1u : 0u) + otherRecords(); }
  /// The same for a piece, which may have a ScreenCut in any picture.
  size_t elementsAPiece() const { return 2 + otherRecords(); }

 private:
  size_t otherRecords() const { return (layered ? 1u : 0u) + (coloured ? 1u : 0u); }
};

/// A piece of a splat at a border as the card reads it, in nine vectors of four numbers. Its own faces are at most
/// kMaxFaces; clip planes add others when it is drawn. It does not depend on the splats' scalar.
struct StoredPiece {
  static constexpr size_t kMaxFaces = 3;

  float x, y, z, weight;
  float axis0, axis1, axis2;  // of its Shape
  // Bits 0-7: faces; 8-15: bit n of a face that is edge_on; 16-23: axes of growth; 24: a plate.
  uint32_t counts;
  float shear10, shear20, shear21, unused;
  std::array<std::array<float, 4>, kMaxFaces> faces;  // CutFace: inward, distance; a plate's first: across
  std::array<std::array<float, 4>, 3> growth;         // GrowthAxes: along, growth
};
static_assert(sizeof(StoredPiece) == 144);

/// The scalar of a piece.
struct StoredPieceValues {
  float mean, slope0, slope1, slope2;
};

/// The splats of a brick that are drawn in pieces (splat_pieces.h), and those.
struct BrickPieces {
  struct Splat {
    uint32_t number;         // in the brick
    uint32_t first, pieces;  // in `pieces`
  };
  std::vector<Splat> splats;        // in the brick's order
  std::vector<float> drawn_slopes;  // [splat] of their scalar
  std::vector<StoredPiece> pieces;
  std::vector<StoredPieceValues> values;  // [piece]
  bool has_too_many = false;              // then there are none, and splats at borders are drawn as any other

  /// Divides the splats at borders as BrickProjector does. If the whole brick would have more than its kMaxPieces pieces,
  /// cells at faces are one splat instead of two, and if that does not help, splats at borders are drawn as any other.
  static BrickPieces of(const GeometryArrays<const float>& geometry,
                        const VariableArrays<const float>& values, const BorderStyle& borders);
};

class BrickStore {
 public:
  virtual ~BrickStore() = default;

  /// Says which values bricks are drawn with from now on. Removes all bricks if `content` differs from the number given
  /// last: each geometry of a cache, with each variable or pair of variables, has a number of its own. All values of its steps
  /// stay, as long as there is space for them.
  virtual void open(uint64_t content, const StepPosition& step) = 0;
  /// Reserves space in `bytes` of the card's memory for the bricks of the parts and for their projected
  /// splats. Returns how many parts, from the first on, fit as far as the store knows: only a brick that was
  /// put there tells how many pieces it has. If all of those parts are stored, the number depends on the
  /// arguments alone. Where the card refuses the memory, fewer fit from then on.
  virtual size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes) = 0;
  /// Removes all bricks after a CardMemoryFailure, and takes at most half as much for them from then on. False if there were
  /// none.
  virtual bool giveMemoryUp() = 0;
  /// The default for `bytes` of makeRoom(): a share of the card's free memory; 0 if OpenGL draws on the
  /// processor.
  virtual uint64_t defaultBytes() const = 0;
  virtual bool has(uint32_t brick) const = 0;
  /// Adds the brick of a part: its geometry if that is missing, and its values at the step. Bricks that no part of the last makeRoom()
  /// needs may be evicted for it. Where no free range is long enough even then, the brick is not stored and has() stays false; the next
  /// makeRoom() empties the store.
  virtual void put(const StoredPart& part, const GeometryArrays<const float>& geometry,
                   const BrickValues& values, const BrickPieces& pieces) = 0;
  /// Whether the brick can be drawn from a store in a picture of this view: perspective may not cut its splats.
  /// Positions of its splats are relative to `cell_min`.
  static bool canDraw(const Brick& brick, const glm::dvec3& cell_min, const ScreenView& view);
  /// StoredPart::clips of the brick.
  static uint32_t clipsOf(const Brick& brick, const ProjectionSettings& settings);

  /// Projects the parts, all of which are stored. Call it between begin() and the first draw() of the
  /// painter.
  virtual void drawStored(const ProjectionSettings& settings, const DepthKeys& keys,
                          std::span<const StoredPart> parts) = 0;
  /// Counts of the splats that drawStored() projected; complete after the painter's end().
  virtual ProjectionCounts counts() const = 0;
};

}  // namespace curvisplat
