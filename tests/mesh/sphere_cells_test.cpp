// Meshes on a sphere whose cells are far wider than thick: splats lie in their layers, at the heights of the sphere, and are as
// thin as they are, though prisms between planes lie far below.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>
#include <map>
#include <mutex>
#include <random>
#include <vector>

#include "preprocess/convert/mesh_origin.h"
#include "preprocess/mesh/forwarding_mesh.h"
#include "preprocess/moments/sphere_frame.h"
#include "preprocess/shape/shape.h"
#include "stream/model/border_code.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr double kRadius = 6371, kDegrees = 5;
constexpr uint64_t kAround = 72, kUp = 13, kLevels = 7;

/// Heights of the levels in km: layers of 10 m to 320 m, upwards.
double heightOf(uint64_t level) {
  return 0.01 * (std::exp2(static_cast<double>(level)) - 1);
}

/// Triangular prisms between 30 degrees south and north, closed around the Earth; nodes are moved by up to a quarter of a cell. Both
/// scalars are the height.
ArrayPiece shells() {
  ArrayPiece piece;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> within(-0.25, 0.25);
  std::vector<glm::dvec3> columns;
  for (uint64_t j = 0; j < kUp; ++j)
    for (uint64_t i = 0; i < kAround; ++i) {
      const bool rim = j == 0 || j + 1 == kUp;
      const double east = glm::radians(kDegrees * (static_cast<double>(i) + within(random)));
      const double north = glm::radians(kDegrees * (static_cast<double>(j) - 6 + (rim ? 0 : within(random))));
      columns.emplace_back(std::cos(north) * std::cos(east), std::cos(north) * std::sin(east),
                           std::sin(north));
    }
  for (uint64_t level = 0; level < kLevels; ++level)
    for (const glm::dvec3& column : columns) piece.points.push_back((kRadius + heightOf(level)) * column);
  const auto at = [&](uint64_t i, uint64_t j, uint64_t level) {
    return (level * kUp + j) * kAround + i % kAround;
  };
  for (uint64_t level = 0; level + 1 < kLevels; ++level)
    for (uint64_t j = 0; j + 1 < kUp; ++j)
      for (uint64_t i = 0; i < kAround; ++i)
        for (const auto& [a, b, c] :
             {std::array{std::array{i, j}, std::array{i + 1, j}, std::array{i + 1, j + 1}},
              std::array{std::array{i, j}, std::array{i + 1, j + 1}, std::array{i, j + 1}}}) {
          const std::array corners{at(a[0], a[1], level),     at(b[0], b[1], level),
                                   at(c[0], c[1], level),     at(a[0], a[1], level + 1),
                                   at(b[0], b[1], level + 1), at(c[0], c[1], level + 1)};
          piece.cells.append(CellKind::kWedge, corners);
          piece.cell_values.push_back(static_cast<float>(0.5 * (heightOf(level) + heightOf(level + 1))));
        }
  for (const glm::dvec3& point : piece.points)
    piece.point_values.push_back(static_cast<float>(glm::length(point) - kRadius));
  return piece;
}

/// A mesh whose points a globe has placed.
class OnGlobe final : public ForwardingMesh {
 public:
  explicit OnGlobe(const MeshSource& source) : ForwardingMesh(source) { description_.globe = Globe{}; }
};

struct Made {
  NodeSplat node;
  SplatScalar value;
};

std::map<uint64_t, Made> splatsOf(const MeshSource& mesh, uint32_t scalar) {
  class Collected : public SplatSink {
   public:
    void add(const NodeSplat& splat, std::span<const SplatScalar> values) override {
      const std::lock_guard lock(mutex_);
      made.emplace(splat.node, Made{splat, values.front()});
    }
    std::map<uint64_t, Made> made;

   private:
    std::mutex mutex_;
  } sink;
  const TemporaryFolder folder;
  MeshOrigin origin(mesh, {scalar}, std::nullopt, MemoryPlan::of(uint64_t{512} << 20, 1, 2), folder.path());
  Progress progress;
  origin.survey(progress);
  origin.scatter([&]() -> SplatSink& { return sink; }, {}, progress);
  return sink.made;
}

/// The volume of the prisms between planes: triangles of the levels' radii, cones between them.
double volumeOf(const ArrayPiece& piece) {
  double sum = 0;
  for (size_t n = 0; n < piece.cells.size(); ++n) {
    const std::span<const uint64_t> c = piece.cells.cornersOfCell(n);
    const auto cone = [&](size_t first) {
      return std::abs(glm::dot(piece.points[c[first]],
                               glm::cross(piece.points[c[first + 1]], piece.points[c[first + 2]]))) /
             6;
    };
    sum += cone(3) - cone(0);
  }
  return sum;
}

/// Twice the extent of a box of the splat's shape along a direction.
double extentAlong(const Splat& splat, const glm::dvec3& direction) {
  return glm::length(direction * splat.factor());
}

TEST(SphereCells, PointsLieInTheirLayers) {
  const ArrayPiece piece = shells();
  const ArrayMesh mesh({piece});
  const auto made = splatsOf(OnGlobe(mesh), 0);
  ASSERT_EQ(made.size(), kAround * kUp * kLevels);
  double weights = 0;
  for (const auto& [number, splat] : made) {
    const uint64_t level = number / (kAround * kUp);
    const double below = level > 0 ? heightOf(level) - heightOf(level - 1) : 0,
                 above = level + 1 < kLevels ? heightOf(level + 1) - heightOf(level) : 0;
    const Splat& of_point = splat.node.splat;
    const double height = glm::length(of_point.position) - kRadius;
    // A piece ends half way to the next levels, about.
    EXPECT_GT(height, heightOf(level) - 0.3 * below - 1e-6) << number;
    EXPECT_LT(height, heightOf(level) + 0.3 * above + 1e-6) << number;
    EXPECT_NEAR(splat.value.mean, height, 1e-5) << number;
    const glm::dvec3 up = glm::normalize(of_point.position);
    EXPECT_NEAR(extentAlong(of_point, up) / (0.5 * (below + above)), 1, 0.25) << number;
    EXPECT_NEAR(glm::dot(gradientOf(of_point, splat.value.slope), up), 1, 0.02) << number;
    weights += of_point.weight;
    const InwardAxes inward = inwardAxes(splat.node.border_code);
    for (int n = 0; n < inward.count; ++n) {
      const glm::dvec3 q(inward.axis[static_cast<size_t>(n)]);
      const glm::dvec3 face = glm::normalize(gradientOf(of_point, q));
      // Level faces, but for the rounding of codes, or upright ones at the rim.
      EXPECT_TRUE(std::abs(glm::dot(face, up)) > 0.999 ||
                  std::abs(glm::dot(q, inFrameOf(of_point, up)) * extentAlong(of_point, up)) < 0.1)
          << number << ": " << glm::dot(face, up);
    }
    EXPECT_EQ(inward.count > 0, level < 2 || level + 2 >= kLevels || number / kAround % kUp < 2 ||
                                    number / kAround % kUp + 2 >= kUp)
        << number;
  }
  EXPECT_NEAR(weights / volumeOf(piece), 1, 1e-5);

  // In flat space they are kilometres below and as thick.
  double deepest = 0, thickest = 0;
  for (const auto& [number, splat] : splatsOf(mesh, 0)) {
    deepest = std::max(deepest, kRadius - glm::length(splat.node.splat.position));
    thickest = std::max(thickest, extentAlong(splat.node.splat, glm::normalize(splat.node.splat.position)));
  }
  EXPECT_GT(deepest, 2);
  EXPECT_GT(thickest, 2);
}

TEST(SphereCells, CellsLieInTheirLayers) {
  const ArrayPiece piece = shells();
  const ArrayMesh mesh({piece});
  const auto made = splatsOf(OnGlobe(mesh), 1);
  const size_t cells = piece.cells.size();
  ASSERT_EQ(made.size(), cells);
  double weights = 0;
  for (const auto& [number, splat] : made) {
    const uint64_t level = number / (2 * kAround * (kUp - 1));
    const double middle = 0.5 * (heightOf(level) + heightOf(level + 1)),
                 thickness = heightOf(level + 1) - heightOf(level);
    const Splat& of_cell = splat.node.splat;
    EXPECT_NEAR(glm::length(of_cell.position) - kRadius, middle, 0.01 * thickness) << number;
    const glm::dvec3 up = glm::normalize(of_cell.position);
    EXPECT_NEAR(extentAlong(of_cell, up) / thickness, 1, 0.01) << number;
    weights += of_cell.weight;
  }
  EXPECT_NEAR(weights / volumeOf(piece), 1, 1e-5);
}

TEST(SphereFrames, KeepHeightsAndAreInverted) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(-1, 1);
  for (int n = 0; n < 100; ++n) {
    const auto vector = [&] { return glm::dvec3(within(random), within(random), within(random)); };
    const glm::dvec3 at = 5.0 * glm::normalize(vector());
    const SphereFrame frame(at);
    const glm::dvec3 x = (4 + within(random)) * glm::normalize(at + 2.0 * vector());
    EXPECT_LT(glm::distance(frame.flat(at), at), 1e-13);
    EXPECT_NEAR(glm::dot(frame.flat(x), at / 5.0), glm::length(x), 1e-13);
    if (glm::dot(x, at) > 0) {
      EXPECT_LT(glm::distance(frame.bent(frame.flat(x)), x), 1e-12);
    }
    // A turn takes the one's up to the other's, and keeps lengths.
    const glm::dmat3 turn = frame.turnTo(SphereFrame(x));
    EXPECT_LT(glm::distance(turn * glm::normalize(at), glm::normalize(x)), 1e-12);
    EXPECT_LT(glm::distance((turn * glm::transpose(turn))[0], glm::dvec3(1, 0, 0)), 1e-12);
  }
  // A mesh wider than half of the sphere has no frame.
  const glm::dvec3 corners[] = {{1, 0, 0}, {-1, 0.1, 0}, {0, 1, 0}};
  EXPECT_TRUE(SphereFrame::ofMiddle(corners).isFlat());
}

}  // namespace
}  // namespace curvisplat
