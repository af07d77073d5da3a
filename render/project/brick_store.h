// The interface of a painter's store of bricks: decoded bricks that stay where the painter draws, on a graphics
// card, and are projected there in every frame.
//
//   makeRoom -> put what is missing -> Painter::begin -> drawStored -> draw ... -> end
//
// What is drawn from a store is what BrickProjector would give, but for rounding, in the order of the same keys. What a store draws
// in pieces is divided when it is put there (BrickPieces), which does not depend on the view; any thread may do so. All calls
// of a store are on the painter's thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// A part of a brick to be drawn from a store.
struct StoredPart {
  uint32_t brick = 0;
  size_t splats = 0;  // of the brick
  SplatRanges ranges;
  glm::dvec3 cell_min;
  KeyRange keys;
};

/// A piece of a splat at a border as a card reads it: ten vectors of four.
struct StoredPiece {
  static constexpr size_t kMaxFaces = 3;

  float x, y, z, mean;
  float axis0, axis1, axis2, weight;  // of its Shape
  float shear10, shear20, shear21;
  uint32_t counts;  // bits 0-7: faces; 8-15: bit n of a face that is edge_on; 16-23: axes of growth
  float slope0, slope1, slope2, unused;
  std::array<std::array<float, 4>, kMaxFaces> faces;  // CutFace: inward, distance
  std::array<std::array<float, 4>, 3> growth;         // GrowthAxes: along, growth
};
static_assert(sizeof(StoredPiece) == 160);

/// The splats of a brick that are drawn in pieces (splat_pieces.h), and those.
struct BrickPieces {
  struct Splat {
    uint32_t number;         // in the brick
    uint32_t first, pieces;  // in `pieces`
    float drawn_slope;
  };
  std::vector<Splat> splats;  // in the brick's order
  std::vector<StoredPiece> pieces;
  bool has_too_many = false;  // then there are none, and splats at borders are drawn as any other

  /// Divides splats at borders, as BrickProjector does: with more pieces than its kMaxPieces one splat instead of two, then any.
  static BrickPieces of(const GeometryArrays<const float>& geometry,
                        const VariableArrays<const float>& values, const BorderStyle& borders);
};

class BrickStore {
 public:
  virtual ~BrickStore() = default;

  /// Forgets all bricks, unless `content` is the number that was given last: one for each cache, step and variable.
  virtual void open(uint64_t content) = 0;
  /// Makes room in `bytes` of the card's memory for the bricks of parts, and for what they are drawn as. Returns how many of
  /// the first parts fit as far as it knows, since only a brick that was put tells how many pieces it has. Where all of those
  /// are stored, this depends on nothing else. Throws Error where the card refuses that memory.
  virtual size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes) = 0;
  /// The default of `bytes`: a share of what the card has free; 0 where the processor draws.
  virtual uint64_t defaultBytes() const = 0;
  virtual bool has(uint32_t brick) const = 0;
  /// Adds a brick; others that the last makeRoom() was not asked for may go. If there is no place for it all the same, has() says
  /// so, and there is one after the next makeRoom(), which empties the store.
  virtual void put(uint32_t brick, const GeometryArrays<const float>& geometry,
                   const VariableArrays<const float>& values, const BrickPieces& pieces) = 0;
  /// Whether pictures with these settings can be drawn from a store: those without layers and without opacities by the
  /// gradient.
  static bool canDraw(const ProjectionSettings& settings);
  /// Whether a brick can, in such a picture: neither clip planes nor perspective cut its splats.
  /// `cell_min`: the corner that its splats' positions count from.
  static bool canDraw(const Brick& brick, const glm::dvec3& cell_min, const ProjectionSettings& settings);

  /// Projects the parts, all of which are stored. Between begin() and the first draw() of the painter.
  virtual void drawStored(const ProjectionSettings& settings, const DepthKeys& keys,
                          std::span<const StoredPart> parts) = 0;
  /// Counts of the splats of drawStored(); complete after end().
  virtual ProjectionCounts counts() const = 0;
};

}  // namespace curvisplat
