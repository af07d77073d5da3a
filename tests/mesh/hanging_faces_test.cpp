// Tests which faces of cells are found to lie against larger and smaller ones.
#include "preprocess/gather/hanging_faces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

struct Quad {
  HangingFaces::Corners corners;
  HangingFaces::Face face;
};

/// A parallelogram of cell `cell` between `first` and `second`, which begin at the point `corner`; the other corners
/// have numbers of their own.
Quad quadOf(uint64_t cell, uint64_t corner, const glm::dvec3& first, const glm::dvec3& second) {
  const std::array<glm::dvec3, 4> at{glm::dvec3(0), first, first + second, second};
  const uint64_t others = 1'000'000 + 4 * cell;
  Quad quad{{corner, others, others + 1, others + 2}, {cell, {}, 0.5 * (first + second)}};
  quad.face.half_axes = HangingFaces::halfAxes(at, glm::cross(first, second));
  return quad;
}

using Pairs = std::vector<std::pair<uint64_t, uint64_t>>;

/// The cells of faces that lie against each other, rising.
Pairs pairsOf(std::span<const Quad> quads, uint64_t direction_bytes) {
  const TemporaryFolder folder;
  HangingFaces faces(0, 1, {direction_bytes, 1 << 16}, ScratchFiles(folder.path()));
  for (const Quad& quad : quads) faces.look(quad.corners, quad.face);
  Pairs pairs;
  if (!faces.mayHang()) return pairs;
  for (const Quad& quad : quads) faces.add(quad.corners, quad.face, {});
  Progress progress;
  faces.finish([&](const HangingFaces::Face& a, const HangingFaces::Face& b,
                   std::span<const std::byte>) { pairs.emplace_back(a.cell, b.cell); },
               progress);
  std::ranges::sort(pairs);
  return pairs;
}

TEST(HangingFaces, AreFoundInAllDirections) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    // One after the other: compilers evaluate arguments in different orders.
    const double x = normal(random), y = normal(random), z = normal(random);
    return glm::normalize(glm::dvec3(x, y, z));
  };
  std::vector<Quad> quads;
  Pairs expected;
  constexpr uint64_t kPairs = 3000;
  for (uint64_t n = 0; n < kPairs; ++n) {
    const glm::dvec3 x = direction(), y = glm::normalize(glm::cross(x, direction()));
    // The smaller face is turned about the line between the centres, by just less than what counts as opposite.
    const glm::dvec3 along = glm::normalize(x + y), across = glm::normalize(x - y), up = glm::cross(x, y);
    const double turn = n % 2 == 0 ? 0.19 : -0.19;
    const glm::dvec3 turned = std::cos(turn) * across + std::sin(turn) * up;
    quads.push_back(quadOf(2 * n, n, 2.0 * x, 2.0 * y));
    quads.push_back(
        quadOf(2 * n + 1, n, std::sqrt(0.5) * (along - turned), std::sqrt(0.5) * (along + turned)));
    expected.emplace_back(2 * n, 2 * n + 1);
    expected.emplace_back(2 * n + 1, 2 * n);
  }
  std::ranges::sort(expected);
  for (const uint64_t memory : {uint64_t{1} << 20, uint64_t{1} << 10})
    EXPECT_EQ(pairsOf(quads, memory), expected);
}

TEST(HangingFaces, AreNotLookedForAtTheSurfaceOfASphere) {
  // Quads between 60 x 60 points of each side of a cube, drawn onto the sphere.
  const TemporaryFolder folder;
  constexpr uint64_t kAlong = 60;
  HangingFaces faces(0, 1, {6 * (kAlong + 1) * (kAlong + 1), 1 << 16}, ScratchFiles(folder.path()));
  for (uint64_t side = 0; side < 6; ++side)
    for (uint64_t n = 0; n < kAlong * kAlong; ++n) {
      HangingFaces::Corners corners;
      std::array<glm::dvec3, 4> at;
      for (uint64_t corner = 0; corner < 4; ++corner) {
        const uint64_t i = n % kAlong + (corner == 1 || corner == 2 ? 1 : 0), j = n / kAlong + corner / 2;
        glm::dvec3 place(0);
        const int axis = static_cast<int>(side / 2);
        place[axis] = side % 2 == 0 ? -1 : 1;
        place[(axis + 1) % 3] = 2.0 * static_cast<double>(i) / kAlong - 1;
        place[(axis + 2) % 3] = 2.0 * static_cast<double>(j) / kAlong - 1;
        at[corner] = glm::normalize(place);
        corners[corner] = (side * (kAlong + 1) + j) * (kAlong + 1) + i;
      }
      const glm::dvec3 centre = 0.25 * (at[0] + at[1] + at[2] + at[3]);
      faces.look(corners, {side, {}, centre, HangingFaces::halfAxes(at, -centre)});
    }
  EXPECT_FALSE(faces.mayHang());
}

TEST(HangingFaces, DoNotDependOnMemoryWhereManyMeet) {
  // At point 0, 240 of 300 faces have others opposite; at point 1 faces like those that have not.
  const glm::dvec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  std::vector<Quad> quads;
  for (uint64_t n = 0; n < 120; ++n) {
    quads.push_back(quadOf(2 * n, 0, 2.0 * x, 2.0 * y));
    quads.push_back(quadOf(2 * n + 1, 0, y, x));
  }
  for (uint64_t n = 240; n < 300; ++n) quads.push_back(quadOf(n, 0, y, z));
  quads.push_back(quadOf(300, 1, z, y));
  const Pairs pairs = pairsOf(quads, 1 << 20);
  EXPECT_EQ(pairs.size(), 2u * 120 * 120);
  EXPECT_EQ(pairsOf(quads, 1), pairs);
}

}  // namespace
}  // namespace curvisplat
