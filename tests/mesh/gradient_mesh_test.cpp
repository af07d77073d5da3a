// Quantities of gradients, of unstructured grids, against closed forms.
#include "preprocess/gradients/gradient_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

using Flow = std::function<std::array<double, 5>(const glm::dvec3&)>;  // density, velocity, pressure

/// A mesh with a flow at its points, or in its cells.
class FlowOnMesh final : public MeshSource {
 public:
  FlowOnMesh(std::vector<ArrayPiece> pieces, const Flow& flow, Centring centring)
      : pieces_(pieces), flow_(flow), mesh_(std::move(pieces)), description_(mesh_.description()) {
    description_.scalars.clear();
    for (const char* const name : {"density", "velocity_x", "velocity_y", "velocity_z", "pressure"}) {
      GridScalar scalar;
      scalar.name = name;
      scalar.centring = centring;
      description_.scalars.push_back(scalar);
    }
  }
  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    mesh_.readPoints(piece, first, count, {}, out);
    out.scalars.assign(scalars.size(), {});
    for (size_t n = 0; n < count; ++n) add({out.x[n], out.y[n], out.z[n]}, scalars, out.scalars);
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    mesh_.readCells(piece, first, count, {}, out);
    out.scalars.assign(scalars.size(), {});
    for (size_t n = 0; n < count; ++n) {
      const auto corners = out.cornersOfCell(n);
      glm::dvec3 middle(0.0);
      for (const uint64_t corner : corners) middle += pieces_[piece].points[corner];
      add(middle / static_cast<double>(corners.size()), scalars, out.scalars);
    }
  }

 private:
  void add(const glm::dvec3& x, std::span<const uint32_t> scalars,
           std::vector<std::vector<float>>& out) const {
    const std::array<double, 5> flow = flow_(x);
    for (size_t n = 0; n < scalars.size(); ++n) out[n].push_back(static_cast<float>(flow[scalars[n]]));
  }

  const std::vector<ArrayPiece> pieces_;
  const Flow flow_;
  const ArrayMesh mesh_;
  GridDescription description_;
};

class Gradients : public testing::Test {
 protected:
  std::vector<float> valuesOf(std::vector<ArrayPiece> pieces, const Flow& flow, Centring centring,
                              const std::string& name, uint64_t memory_bytes = uint64_t{64} << 20) const {
    const GradientMesh mesh(std::make_unique<FlowOnMesh>(std::move(pieces), flow, centring), {},
                            folder_.path());
    const auto& scalars = mesh.description().scalars;
    const auto found =
        std::find_if(scalars.begin(), scalars.end(), [&](const auto& s) { return s.name == name; });
    EXPECT_NE(found, scalars.end()) << name;
    const std::vector<uint32_t> wanted{static_cast<uint32_t>(found - scalars.begin()), 0};
    mesh.prepare(wanted, memory_bytes, progress_);
    std::vector<float> values;
    for (uint32_t piece = 0; piece < mesh.description().pieces.size(); ++piece) {
      const MeshPiece& of = mesh.description().pieces[piece];
      MeshPoints points;
      MeshCells cells;
      if (centring == Centring::kNode)
        mesh.readPoints(piece, 0, of.points, wanted, points);
      else
        mesh.readCells(piece, 0, of.cells, wanted, cells);
      const auto& read = centring == Centring::kNode ? points.scalars : cells.scalars;
      EXPECT_EQ(read.size(), 2u);
      EXPECT_EQ(read[1][0], 2) << "the density follows";
      values.insert(values.end(), read[0].begin(), read[0].end());
    }
    return values;
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const ArrayPiece tetrahedra_ = tetrahedraOf(*scene_, 12, 6, 6), hexahedra_ = hexahedraOf(*scene_, 12, 6, 6);
  const TemporaryFolder folder_;
  Progress progress_;
};

/// A rigid rotation about (1, 2, -2), a strain, and a pressure that rises by (2, -1, 2).
std::array<double, 5> linearFlow(const glm::dvec3& x) {
  const glm::dvec3 v = glm::cross(glm::dvec3(1, 2, -2), x) + glm::dvec3(0.5 * x.x, -0.5 * x.y, 0);
  return {2, v.x, v.y, v.z, 5 + 2 * x.x - x.y + 2 * x.z};
}

TEST_F(Gradients, OfLinearFlowsAreExact) {
  // Vorticity 2 (1, 2, -2). Q: half of |rotation|² - |strain|², 2 |omega|² = 18 and 0.5.
  const std::pair<const char*, double> expected[] = {
      {"vorticity_magnitude", 6}, {"pressure_gradient_magnitude", 3}, {"q_criterion", 9 - 0.25}};
  for (const auto& one : expected) {
    const char* const name = one.first;
    const double value = one.second;
    const auto expectAll = [&](const std::vector<ArrayPiece>& pieces, Centring centring, double tolerance) {
      for (const float found : valuesOf(pieces, linearFlow, centring, name))
        ASSERT_NEAR(found, value, tolerance * value) << name;
    };
    const auto parts = split(hexahedra_, 3, [](size_t cell) { return cell / 20 % 3; });
    expectAll({shuffled(tetrahedra_, 2)}, Centring::kNode, 2e-4);
    expectAll({hexahedra_}, Centring::kNode, 2e-4);
    expectAll(parts, Centring::kNode, 2e-4);
    expectAll({shuffled(tetrahedra_, 2)}, Centring::kCell, 2e-4);
    // The middle of a bent hexahedron, where its value is here, is not quite its centroid.
    expectAll({hexahedra_}, Centring::kCell, 2e-2);
    expectAll(parts, Centring::kCell, 2e-2);
  }
}

TEST_F(Gradients, SwirlFollowsTheVelocityAtThePoint) {
  // The density, 2, times vorticity · velocity / |velocity|², of a flow along z that turns about z.
  const Flow flow = [](const glm::dvec3& x) { return std::array<double, 5>{2, -x.y, x.x, 1.5, 1}; };
  const std::vector<float> found = valuesOf({tetrahedra_}, flow, Centring::kNode, "swirl");
  for (size_t n = 0; n < found.size(); ++n) {
    const glm::dvec3& x = tetrahedra_.points[n];
    ASSERT_NEAR(found[n], 2 * 2 * 1.5 / (x.x * x.x + x.y * x.y + 2.25), 1e-4);
  }
}

TEST_F(Gradients, AreUndefinedWhereTheFlowIs) {
  const Flow holes = [](const glm::dvec3& x) {
    std::array<double, 5> flow = linearFlow(x);
    if (x.z < 0.3) flow[2] = std::numeric_limits<double>::quiet_NaN();
    return flow;
  };
  const std::vector<float> found = valuesOf({hexahedra_}, holes, Centring::kNode, "vorticity_magnitude");
  size_t defined = 0;
  for (size_t n = 0; n < found.size(); ++n) {
    // A cell with such a point is none of those that gradients are computed from.
    const double z = hexahedra_.points[n].z, layer = 1.0 / 6;
    if (z < 0.3 || z > 0.3 + layer) {
      EXPECT_EQ(std::isnan(found[n]), z < 0.3) << z;
    }
    if (!std::isnan(found[n])) {
      ++defined;
      EXPECT_NEAR(found[n], 6, 1e-3);
    }
  }
  EXPECT_GT(defined, 100u);
}

TEST_F(Gradients, KeepToTheirMemoryAndAreTheSameInAny) {
  const auto parts = split(tetrahedra_, 3, [](size_t cell) { return cell / 20 % 3; });
  const auto of = [&](uint64_t memory_bytes) {
    return valuesOf(parts, linearFlow, Centring::kNode, "vorticity_magnitude", memory_bytes);
  };
  const std::vector<float> ample = of(uint64_t{64} << 20);
  EXPECT_EQ(of(uint64_t{256} << 10), ample) << "points and sums wait on disk";
  EXPECT_EQ(of(uint64_t{4} << 10), ample) << "so do the numbers of points that several pieces have";
}

TEST_F(Gradients, StopWithTheProgress) {
  progress_.stop(2);
  for (const Centring centring : {Centring::kNode, Centring::kCell})
    EXPECT_THROW(valuesOf({tetrahedra_}, linearFlow, centring, "vorticity_magnitude"), Interrupted);
}

}  // namespace
}  // namespace curvisplat
