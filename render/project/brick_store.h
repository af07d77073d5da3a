// The interface of a painter's store of bricks: decoded bricks that stay where the painter draws, on a graphics
// card, and are projected there in every frame.
//
//   makeRoom -> put what is missing -> Painter::begin -> drawStored -> draw ... -> end
//
// What is drawn from a store is what BrickProjector would give, but for rounding, in the order of the same keys.
// Splats that are drawn in pieces are left to it (hasPieces()). All calls are on the painter's thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

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

class BrickStore {
 public:
  virtual ~BrickStore() = default;

  /// Forgets all bricks, unless `content` is the number that was given last: one for each cache, step and variable.
  virtual void open(uint64_t content) = 0;
  /// Makes room in `bytes` of the card's memory for the bricks of parts, and for what they are drawn as. Returns how many of
  /// the first parts fit, which depends on nothing else; bricks that no part needs go, where there is no space beside them.
  /// Throws Error where the card refuses that memory.
  virtual size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes) = 0;
  /// The default of `bytes`: a share of what the card has free; 0 where the processor draws.
  virtual uint64_t defaultBytes() const = 0;
  virtual bool has(uint32_t brick) const = 0;
  /// Adds a brick that there is room for.
  virtual void put(uint32_t brick, const GeometryArrays<const float>& geometry,
                   const VariableArrays<const float>& values) = 0;
  /// Whether some splats of a stored brick lie at borders, and are drawn in pieces.
  virtual bool hasPieces(uint32_t brick) const = 0;
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
