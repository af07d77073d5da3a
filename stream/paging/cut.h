// chooseCut() chooses the bricks that one view needs. It is a pure function, which neither reads nor draws
// them. DESIGN.md, "The pipeline".
//
// The cut starts at the root and goes down until a brick's error on the screen, by its weight, is small
// enough, or it is a leaf; what is outside the image or transparent is left out with all that lies below it.
// The result's cells are disjoint, and the cell of a whole brick comes after every cell that it can hide (at
// each octree node the child farther along every axis comes first), so that bricks which are needed about the
// same time are listed near one another. Splats are drawn in an order of their own
// (render/sweep/sweep_buffer.h).
//
// Under a limit of splats or bytes the brick with the largest error on the screen is refined first, octant
// by octant, until the next octant's children would not fit. That sequence does not depend on the limit: a
// larger limit gives a refinement of the same cut. At most one brick is drawn in part: the last one.
//
// It costs about 35 ns for each brick that it looks at, or 70 to 150 ns under a limit (bench/cut_bench.cpp).
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "stream/model/octree.h"

namespace curvisplat {

/// The properties of a view that the cut depends on. "Stretched" space is scale * data.
struct CutView {
  /// Points p with normal·p + offset < 0 are out of the image, or clipped; |normal| = 1. Stretched.
  struct Plane {
    glm::dvec3 normal{0.0};
    double offset = 0;
  };

  bool perspective = false;
  glm::dvec3 scale{1.0};               // > 0
  glm::dvec3 eye{0.0};                 // perspective; stretched
  glm::dvec3 towards_viewer{0, 0, 1};  // orthographic; stretched
  double pixels = 1;                   // pixels in a stretched unit; perspective: at distance 1
  std::vector<Plane> planes;
};

/// How far a variable's values spread in a brick, or in a brick and all below it.
struct ValueBounds {
  float min = 0, max = 0;       // of the means
  float largest_slope = 0;      // of |w|
  float largest_deviation = 0;  // of √r
};

/// Returns [brick] the bounds of each brick and all bricks below it. An inner brick's means are averages, so
/// its own bounds promise nothing about its children.
std::vector<ValueBounds> subtreeBounds(std::span<const Brick> bricks,
                                       std::span<const BrickVariable> variables);

/// An octree with the values of one variable.
struct CutTree {
  RootCube root;
  std::span<const Brick> bricks;
  std::span<const BrickVariable> variables;
  std::span<const ValueBounds> subtrees;  // from subtreeBounds()
};

/// The options of chooseCut().
struct CutOptions {
  static constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

  double lod_pixels = 1;  // error allowed on the screen; at 0 only leaves are taken
  /// The factor, 0 to 1, of a brick's error when it is compared with lod_pixels; the order of refinement does
  /// not depend on it. Null: the factor is 1 for all bricks.
  std::function<double(uint32_t brick)> error_weight = nullptr;
  /// Limits of the splats in the cut, and of the bytes of its bricks' streams on disk. The root is drawn even
  /// if it alone exceeds them.
  uint64_t max_splats = kNoLimit, max_bytes = kNoLimit;
};

/// The parts of bricks that a view draws, in the order described above.
struct Cut {
  std::vector<BrickPart> parts;  // each brick once
  uint64_t splats = 0;
  uint64_t bytes = 0;  // of the parts' bricks
  uint32_t deepest_level = 0;
  bool complete = true;  // false: a limit keeps some of it coarser than lod_pixels asks for
  /// The largest error of what is drawn, in pixels on the screen. A brick that is fine enough by its weight
  /// counts with lod_pixels at most. Infinite for a brick around the eye, in perspective.
  double largest_error_px = 0;
  uint64_t out_of_image = 0;  // bricks left out, each standing for all below it
  uint64_t transparent = 0;
};

/// Whether a brick with such values is entirely transparent.
using TransparentBounds = std::function<bool(const ValueBounds&)>;

/// Chooses the cut of one view. Pure; any thread.
Cut chooseCut(const CutTree& tree, const CutView& view, const TransparentBounds& transparent,
              const CutOptions& options);

}  // namespace curvisplat
