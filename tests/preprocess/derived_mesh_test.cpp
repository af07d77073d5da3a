// Derived quantities of unstructured grids against formulas written down by hand.
#include "preprocess/formats/derived/derived_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Two points or cells with the named scalars, whose values are given.
class FlowMesh final : public MeshSource {
 public:
  FlowMesh(std::vector<std::string> names, std::vector<std::vector<float>> values, Centring centring)
      : values_(std::move(values)) {
    for (std::string& name : names) {
      GridScalar scalar;
      scalar.name = std::move(name);
      scalar.centring = centring;
      description_.scalars.push_back(std::move(scalar));
    }
    description_.pieces.push_back({"piece 1", "memory", 2, 2});
  }
  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->assign(count, 0);
    out.hidden.assign(count, 0);
    take(first, count, scalars, out.scalars);
  }
  void readCells(uint32_t, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    out.clear();
    for (uint64_t n = 0; n < count; ++n)
      out.append(CellKind::kTetrahedron, std::array<uint64_t, 4>{0, 1, 0, 1});
    take(first, count, scalars, out.scalars);
  }

 private:
  void take(uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
            std::vector<std::vector<float>>& out) const {
    out.clear();
    for (const uint32_t scalar : scalars) {
      const auto begin = values_.at(scalar).begin() + static_cast<ptrdiff_t>(first);
      out.emplace_back(begin, begin + static_cast<ptrdiff_t>(count));
    }
  }

  std::vector<std::vector<float>> values_;
  GridDescription description_;
};

std::optional<uint32_t> scalarNumber(const GridDescription& description, const std::string& name) {
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    if (description.scalars[n].name == name) return n;
  return std::nullopt;
}

DerivedMeshSource conservedMesh(Centring centring, const DerivedOptions& options = {}) {
  return DerivedMeshSource(
      std::make_unique<FlowMesh>(
          std::vector<std::string>{"Density", "Momentum_x", "Momentum_y", "Momentum_z", "Energy"},
          std::vector<std::vector<float>>{{1, 2}, {3, -1}, {0, 4}, {4, 1}, {20, 9}}, centring),
      options);
}

TEST(DerivedMesh, QuantitiesOfTheConservedOnes) {
  const DerivedMeshSource mesh = conservedMesh(Centring::kNode);
  // (gamma - 1)(E - rho v²/2): 0.4 (20 - 12.5) and 0.4 (9 - 4.5).
  const double p[] = {3.0, 1.8}, rho[] = {1, 2}, speed2[] = {25, 4.5};
  std::vector<uint32_t> wanted;
  for (const char* const name : {"pressure", "mach_number", "Energy", "velocity_magnitude", "temperature"}) {
    ASSERT_TRUE(scalarNumber(mesh.description(), name)) << name;
    wanted.push_back(*scalarNumber(mesh.description(), name));
  }
  MeshPoints points;
  mesh.readPoints(0, 0, 2, wanted, points);
  ASSERT_EQ(points.scalars.size(), wanted.size());
  for (size_t n = 0; n < 2; ++n) {
    EXPECT_NEAR(points.scalars[0][n], p[n], 1e-5);
    EXPECT_NEAR(points.scalars[1][n], std::sqrt(speed2[n] * rho[n] / (1.4 * p[n])), 1e-5);
    EXPECT_EQ(points.scalars[2][n], n == 0 ? 20 : 9);
    EXPECT_NEAR(points.scalars[3][n], std::sqrt(speed2[n]), 1e-5);
    EXPECT_NEAR(points.scalars[4][n], p[n] / rho[n], 1e-5);
  }
}

TEST(DerivedMesh, CellsRangesGasAndBlankValues) {
  DerivedOptions options;
  options.gas.gamma = 2;
  options.blank_value = 20;
  const DerivedMeshSource mesh = conservedMesh(Centring::kCell, options);
  const uint32_t pressure = *scalarNumber(mesh.description(), "pressure");
  EXPECT_EQ(mesh.description().scalars[pressure].centring, Centring::kCell);
  MeshCells cells;
  mesh.readCells(0, 1, 1, std::span(&pressure, 1), cells);
  EXPECT_NEAR(cells.scalars.at(0).at(0), 4.5, 1e-5);
  mesh.readCells(0, 0, 1, std::span(&pressure, 1), cells);
  EXPECT_TRUE(std::isnan(cells.scalars.at(0).at(0)));  // its energy is the value of blanked samples
  options.gas.gamma = 0.5;
  EXPECT_THROW(conservedMesh(Centring::kCell, options), UsageError);
}

TEST(DerivedMesh, WarnsOfAGaugePressure) {
  for (const float least : {-4.0f, 4.0f}) {
    const DerivedMeshSource mesh(
        std::make_unique<FlowMesh>(
            std::vector<std::string>{"Density", "Pressure", "Velocity_x", "Velocity_y", "Velocity_z"},
            std::vector<std::vector<float>>{{1, 1}, {least, 5}, {1, 1}, {0, 0}, {0, 0}}, Centring::kNode),
        {});
    const std::vector<ScalarRange> ranges(3, {0, 1});
    const uint32_t wanted[] = {*scalarNumber(mesh.description(), "mach_number"),
                               *scalarNumber(mesh.description(), "velocity_magnitude"),
                               *scalarNumber(mesh.description(), "entropy")};
    const std::vector<std::string> warnings = warningsOfRanges(mesh, wanted, ranges);
    ASSERT_EQ(warnings.size(), least < 0 ? 1u : 0u);
    if (least > 0) continue;
    EXPECT_TRUE(warnings[0].starts_with("mach_number, entropy: computed from an absolute pressure"))
        << warnings[0];
    EXPECT_TRUE(warningsOfRanges(mesh, std::span(wanted).subspan(1, 1), std::span(ranges).first(1)).empty());
  }
}

TEST(DerivedMesh, WhatIsStoredOrNeedsGradientsIsNotOffered) {
  const DerivedMeshSource mesh(
      std::make_unique<FlowMesh>(std::vector<std::string>{"Density", "Pressure"},
                                 std::vector<std::vector<float>>{{1, 2}, {3, 4}}, Centring::kNode),
      {});
  const auto& scalars = mesh.description().scalars;
  EXPECT_EQ(std::count_if(scalars.begin(), scalars.end(),
                          [](const GridScalar& s) { return s.name == "pressure" || s.name == "Pressure"; }),
            1);
  EXPECT_TRUE(scalarNumber(mesh.description(), "entropy"));
  for (const char* const name :
       {"i", "volume", "jacobian", "mach_number", "q_criterion", "pressure_coefficient"})
    EXPECT_FALSE(scalarNumber(mesh.description(), name)) << name;
}

}  // namespace
}  // namespace curvisplat
