// Derived quantities against flows whose derivatives are known in closed form, on a curved grid.
#include "preprocess/formats/derived/derived_source.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr double kGamma = 1.3, kGasConstant = 2.5;

/// A flow at a point: all that the tests know of it, written down by hand.
struct Flow {
  double rho, p;
  std::array<double, 3> v;
};

/// A source with named scalars.
class NamedGrid : public FunctionGridSource {
 public:
  NamedGrid(std::vector<GridBlock> blocks, std::vector<std::string> names, Function function, double mach = 0)
      : FunctionGridSource(std::move(blocks), names.size(), std::move(function)),
        description_(FunctionGridSource::description()) {
    for (size_t n = 0; n < names.size(); ++n) description_.scalars[n].name = names[n];
    for (uint32_t block = 0; mach > 0 && block < description_.blocks.size(); ++block)
      description_.flow.push_back({"flow", block, mach, 0, 0, 0});
  }
  const GridDescription& description() const override { return description_; }
  /// Says that coordinates come from single precision.
  void roundCoordinates() { description_.coordinate_bytes = 4; }

 private:
  GridDescription description_;
};

const std::vector<std::string> kConserved{"density", "momentum_x", "momentum_y", "momentum_z", "energy"};

std::vector<float> conservedVariables(const Flow& f) {
  const double speed2 = f.v[0] * f.v[0] + f.v[1] * f.v[1] + f.v[2] * f.v[2];
  return {static_cast<float>(f.rho), static_cast<float>(f.rho * f.v[0]), static_cast<float>(f.rho * f.v[1]),
          static_cast<float>(f.rho * f.v[2]), static_cast<float>(f.p / (kGamma - 1) + f.rho * speed2 / 2)};
}

/// Bent and uneven; left-handed.
glm::dvec3 bentPosition(const GridNode& node, uint64_t ni, uint64_t nj, uint64_t nk) {
  const double u = static_cast<double>(node.i) / static_cast<double>(ni - 1),
               v = static_cast<double>(node.j) / static_cast<double>(nj - 1),
               w = static_cast<double>(node.k) / static_cast<double>(nk - 1);
  const double r = 1 + v * v, angle = 1.2 * u;
  return {r * std::cos(angle), r * std::sin(angle), -(w + 0.2 * w * w + 0.1 * u)};
}

std::unique_ptr<GridSource> bentFlow(uint64_t n, const std::function<Flow(const glm::dvec3&)>& flow,
                                     double mach = 0) {
  return std::make_unique<NamedGrid>(
      std::vector{gridBlock(n, n + 2, n + 1)}, kConserved,
      [=](const GridNode& node) {
        const glm::dvec3 x = bentPosition(node, n, n + 2, n + 1);
        return NodeValues{x, conservedVariables(flow(x)), false};
      },
      mach);
}

DerivedOptions options() {
  DerivedOptions options;
  options.gas = {kGamma, kGasConstant};
  return options;
}

/// Values of scalars by name, and positions, of all nodes of block 0.
struct Values {
  NodeArrays nodes;
  std::map<std::string, size_t> at;
  float operator()(const std::string& name, size_t n) const { return nodes.scalars[at.at(name)][n]; }
};

Values valuesOf(const GridSource& source, const std::vector<std::string>& names) {
  Values values;
  const GridBlock& block = source.description().blocks[0];
  const auto scalars = scalarsNamed(source.description(), names);
  source.read(0, {0, block.nj, 0, block.nk}, scalars, values.nodes);
  for (size_t n = 0; n < names.size(); ++n) values.at[names[n]] = n;
  return values;
}

Flow vortexFlow(const glm::dvec3& x) {
  return {1 + 0.1 * x.x, 0.7 + 0.05 * x.y * x.z, {0.3 - x.y, x.x + 0.2 * x.z, 0.1 + 0.4 * x.x * x.x}};
}

TEST(DerivedSource, HasTheTextbookValuesAtEveryNode) {
  const double mach = 0.8;
  const DerivedSource source(bentFlow(6, vortexFlow, mach), options());
  const std::vector<std::string> names{
      "pressure", "pressure_coefficient", "mach_number",    "sound_speed",        "temperature",
      "enthalpy", "internal_energy",      "kinetic_energy", "velocity_magnitude", "163",
      "entropy"};
  const Values values = valuesOf(source, names);
  for (size_t n = 0; n < values.nodes.x.size(); ++n) {
    const Flow f = vortexFlow({values.nodes.x[n], values.nodes.y[n], values.nodes.z[n]});
    const double speed = std::hypot(f.v[0], f.v[1], f.v[2]);
    const double t = f.p / f.rho / kGasConstant, c = std::sqrt(kGamma * kGasConstant * t);
    const double cv = kGasConstant / (kGamma - 1), cp = kGamma * cv;
    const std::map<std::string, double> expected{
        {"pressure", f.p},
        {"pressure_coefficient", 2 * (f.p - 1 / kGamma) / (mach * mach)},
        {"mach_number", speed / c},
        {"sound_speed", c},
        {"temperature", t},
        {"enthalpy", cp * t},
        {"internal_energy", cv * t},
        {"kinetic_energy", speed * speed / 2},
        {"velocity_magnitude", speed},
        {"163", f.rho * (cv * t + speed * speed / 2)},
        {"entropy", cv * (std::log(f.p) + std::log(kGamma) - kGamma * std::log(f.rho))}};
    for (const auto& [name, value] : expected)
      EXPECT_NEAR(values(name, n), value, 3e-6 * (1 + std::abs(value))) << name;
  }
}

// Differences give the exact gradient of a field that is linear in x, y, z on any grid, at its ends too.
TEST(DerivedSource, DifferentiatesLinearFlowExactly) {
  const auto flow = [](const glm::dvec3& x) {
    return Flow{1,
                5 + 0.3 * x.x - 0.4 * x.y + 1.2 * x.z,
                {1 + 0.5 * x.y - x.z, 2 * x.x + 0.25 * x.z, 3 - 0.75 * x.x + 1.5 * x.y}};
  };
  const DerivedSource source(bentFlow(7, flow), options());
  const Values values = valuesOf(source, {"211", "210", "q_criterion", "184"});
  // curl = (∂y w - ∂z v, ∂z u - ∂x w, ∂x v - ∂y u); Q = -½ Σ ∂a u_b ∂b u_a, without a diagonal here.
  const std::array<double, 3> curl{1.5 - 0.25, -1 + 0.75, 2 - 0.5};
  const double vorticity = std::hypot(curl[0], curl[1], curl[2]);
  const double q = -(0.5 * 2 + -1 * -0.75 + 0.25 * 1.5);
  for (size_t n = 0; n < values.nodes.x.size(); ++n) {
    EXPECT_NEAR(values("211", n), vorticity, 2e-4);
    EXPECT_NEAR(values("210", n), 1.3, 2e-4);
    EXPECT_NEAR(values("q_criterion", n), q, 2e-4);
    const Flow f = flow({values.nodes.x[n], values.nodes.y[n], values.nodes.z[n]});
    const double along = curl[0] * f.v[0] + curl[1] * f.v[1] + curl[2] * f.v[2];
    const double speed2 = f.v[0] * f.v[0] + f.v[1] * f.v[1] + f.v[2] * f.v[2];
    EXPECT_NEAR(values("184", n), along / speed2, 1e-3);
  }
}

TEST(DerivedSource, ConvergesOnACurvedFlow) {
  const auto flow = [](const glm::dvec3& x) {
    return Flow{1.2, 2 + std::sin(x.x) * x.y, {std::sin(x.y), x.x * x.z, std::cos(x.x)}};
  };
  std::map<std::string, std::array<double, 2>> errors;
  for (const int fine : {0, 1}) {
    const uint64_t n = fine ? 33 : 17;
    const DerivedSource source(bentFlow(n, flow), options());
    const Values values = valuesOf(source, {"211", "210", "q_criterion"});
    for (uint64_t k = 1; k + 1 < n + 1; ++k)
      for (uint64_t j = 1; j + 1 < n + 2; ++j)
        for (uint64_t i = 1; i + 1 < n; ++i) {
          const size_t at = (k * (n + 2) + j) * n + i;
          const double x = values.nodes.x[at], y = values.nodes.y[at], z = values.nodes.z[at];
          const std::map<std::string, double> exact{{"211", std::hypot(-x, std::sin(x), z - std::cos(y))},
                                                    {"210", std::hypot(std::cos(x) * y, std::sin(x))},
                                                    {"q_criterion", -std::cos(y) * z}};
          for (const auto& [name, value] : exact) {
            double& error = errors[name][static_cast<size_t>(fine)];
            error = std::max(error, std::abs(values(name, at) - value));
          }
        }
  }
  for (const auto& [name, error] : errors) {
    EXPECT_LT(error[0], 0.05) << name;
    EXPECT_LT(error[1], error[0] / 3) << name;  // second order
  }
}

TEST(DerivedSource, IsTheSameHoweverItIsRead) {
  const DerivedSource source(bentFlow(9, vortexFlow), options());
  const auto scalars = scalarsNamed(source.description(), {"211", "density", "jacobian", "pressure"});
  const GridBlock& block = source.description().blocks[0];
  NodeArrays whole, part;
  source.read(0, {0, block.nj, 0, block.nk}, scalars, whole);
  for (uint64_t k = 0; k < block.nk; k += 2)
    for (uint64_t j = 0; j < block.nj; j += 3) {
      const NodeBox box{j, std::min(j + 3, block.nj), k, std::min(k + 2, block.nk)};
      source.read(0, box, scalars, part);
      size_t n = 0;
      for (uint64_t kk = box.k0; kk < box.k1; ++kk)
        for (uint64_t jj = box.j0; jj < box.j1; ++jj)
          for (uint64_t i = 0; i < block.ni; ++i, ++n) {
            const size_t at = (kk * block.nj + jj) * block.ni + i;
            ASSERT_EQ(part.x[n], whole.x[at]);
            ASSERT_EQ(part.blank[n], whole.blank[at]);
            for (size_t s = 0; s < scalars.size(); ++s) ASSERT_EQ(part.scalars[s][n], whole.scalars[s][at]);
          }
    }
  expectPartsOfRows(source);
}

TEST(DerivedSource, LeavesOutWhatIsBlankOrHasNoFlow) {
  const auto flow = [](const glm::dvec3& x) { return Flow{1, 5 + 2 * x.z, {-x.y, x.x, 0}}; };
  auto source =
      std::make_unique<NamedGrid>(std::vector{gridBlock(7, 6, 5)}, kConserved, [=](const GridNode& node) {
        const glm::dvec3 x(node.i, node.j, node.k);
        NodeValues values{x, conservedVariables(flow(x)), false};
        if (node.i == 3 && node.j == 3 && node.k == 2) {
          values.blank = true;
          values.scalars = {0, 1e30f, 1, 1, -1e30f};
        }
        if (node.i == 2 && node.j == 2 && node.k == 2) values.scalars[0] = -99;
        if (node.i == 5 && node.j == 1 && node.k == 1) values.scalars[4] = 0;  // a negative pressure
        return values;
      });
  DerivedOptions with_blank = options();
  with_blank.blank_value = -99;
  const DerivedSource derived(std::move(source), with_blank);
  const Values values = valuesOf(derived, {"211", "112"});
  const auto at = [](size_t i, size_t j, size_t k) { return (k * 6 + j) * 7 + i; };
  for (size_t n = 0; n < values.nodes.x.size(); ++n) {
    if (n == at(3, 3, 2) || n == at(2, 2, 2)) {
      EXPECT_TRUE(std::isnan(values("211", n)));
      EXPECT_TRUE(std::isnan(values("112", n)));
    } else {
      EXPECT_NEAR(values("211", n), 2, 1e-5) << n;
      EXPECT_EQ(std::isfinite(values("112", n)), n != at(5, 1, 1)) << n;
    }
  }
}

TEST(DerivedSource, OfTheGridAloneAreItsIndicesAndVolumes) {
  auto grid = std::make_unique<NamedGrid>(
      std::vector{gridBlock(4, 5, 6)}, std::vector<std::string>{}, [](const GridNode& node) {
        return NodeValues{{2.0 * node.i, -3.0 * node.j, 0.5 * node.k}, {}, false};
      });
  const DerivedSource source(std::move(grid), {});
  EXPECT_EQ(source.description().scalars.size(), 5u);
  EXPECT_THROW(scalarsNamed(source.description(), {}), UsageError);
  const Values values = valuesOf(source, {"i", "j", "k", "jacobian", "volume"});
  for (size_t n = 0; n < 120; ++n) {
    EXPECT_EQ(values("i", n), n % 4);
    EXPECT_EQ(values("j", n), n / 4 % 5);
    EXPECT_EQ(values("k", n), n / 20);
    EXPECT_FLOAT_EQ(values("jacobian", n), -3);
    EXPECT_FLOAT_EQ(values("volume", n), 3);
  }
}

TEST(DerivedSource, GradientsAtPolesIgnoreWhatRoundingSetsApart) {
  // Shells around a point, up to both poles, where the nodes of a row are 1e-16 or 1e-8 apart. The pressure is z, but at the poles it
  // differs by 0.001 from one longitude to the next.
  constexpr uint64_t kAround = 9, kUp = 7, kShells = 5;
  for (const bool single : {false, true}) {
    auto grid = std::make_unique<NamedGrid>(
        std::vector{gridBlock(kAround, kUp, kShells)}, std::vector<std::string>{"Density", "Pressure"},
        [&](const GridNode& node) {
          const double pi = single ? static_cast<float>(M_PI) : M_PI;
          const double east = 2 * pi * static_cast<double>(node.i) / (kAround - 1),
                       north = pi * (static_cast<double>(node.j) / (kUp - 1) - 0.5);
          const double r = 1 + 0.1 * static_cast<double>(node.k);
          glm::dvec3 x = r * glm::dvec3(std::cos(north) * std::cos(east), std::cos(north) * std::sin(east),
                                        std::sin(north));
          if (single) x = glm::dvec3(glm::vec3(x));
          const bool pole = node.j == 0 || node.j + 1 == kUp;
          const double noise = pole ? 0.001 * static_cast<double>(node.i % 3) : 0.0;
          return NodeValues{x, {1, static_cast<float>(3 + x.z + noise)}, false};
        });
    if (single) grid->roundCoordinates();
    const DerivedSource source(std::move(grid), options());
    const Values values = valuesOf(source, {"pressure_gradient_magnitude"});
    for (uint64_t k = 0; k < kShells; ++k)
      for (const uint64_t j : {uint64_t{0}, kUp - 1})
        for (uint64_t i = 0; i < kAround; ++i)
          EXPECT_NEAR(values("pressure_gradient_magnitude", (k * kUp + j) * kAround + i), 1, 0.005)
              << single << ", " << i << " " << j << " " << k;
  }
}

TEST(DerivedSource, GradientsAtWallsAreThoseOfThinLayersFarFromTheOrigin) {
  // Plates in single precision, whose first cells are thinner than four roundings of the largest coordinate.
  struct Plate {
    double length, wall, first, shear;
  };
  constexpr uint64_t kAlong = 26, kWide = 5, kUp = 9;
  for (const auto& [length, wall, first, shear] : {Plate{2500, 150, 1e-3, 1}, Plate{2, 0, 4e-7, 100}}) {
    auto grid = std::make_unique<NamedGrid>(
        std::vector{gridBlock(kAlong, kWide, kUp)},
        std::vector<std::string>{"Density", "Pressure", "VelocityX", "VelocityY", "VelocityZ"},
        [length = length, wall = wall, first = first, shear = shear](const GridNode& node) {
          const double along = length * static_cast<double>(node.i) / (kAlong - 1),
                       across = 0.01 * length * static_cast<double>(node.j);
          const glm::dvec3 x(glm::vec3(
              glm::dvec3(along, across, wall + first * (std::exp2(static_cast<double>(node.k)) - 1))));
          const auto u = static_cast<float>(shear * (x.z - static_cast<float>(wall)));
          return NodeValues{x, {1, u, u, 0, 0}, false};
        });
    grid->roundCoordinates();
    const DerivedSource source(std::move(grid), options());
    const Values values = valuesOf(source, {"vorticity_magnitude", "pressure_gradient_magnitude"});
    for (size_t n = 0; n < kAlong * kWide * kUp; ++n) {
      EXPECT_NEAR(values("vorticity_magnitude", n) / shear, 1, 1e-4) << length << ": " << n;
      EXPECT_NEAR(values("pressure_gradient_magnitude", n) / shear, 1, 1e-4) << length << ": " << n;
    }
  }
}

TEST(DerivedSource, VolumesOfStretchedAndTwistedCellsAreExact) {
  // Nodes are stretched along i by a factor of 3 a step, and turned from plane to plane. Node (2, 2, 1) is blanked.
  const auto place = [](double i, double j, double k) {
    const double x = std::pow(3.0, i), angle = 0.2 * k;
    return glm::dvec3(x * std::cos(angle) - j * std::sin(angle), x * std::sin(angle) + j * std::cos(angle),
                      k);
  };
  auto grid = std::make_unique<NamedGrid>(std::vector{gridBlock(4, 5, 3)}, std::vector<std::string>{},
                                          [&](const GridNode& node) {
                                            const bool blank = node.i == 2 && node.j == 2 && node.k == 1;
                                            return NodeValues{place(node.i, node.j, node.k), {}, blank};
                                          });
  const DerivedSource source(std::move(grid), {});
  const Values values = valuesOf(source, {"volume"});
  // The integral of the trilinear map's Jacobian by Gauss' points, which are exact for it.
  const auto volume = [&](int i, int j, int k) {
    double sum = 0;
    for (int g = 0; g < 8; ++g) {
      const double u[3] = {0.5 + (g & 1 ? 1 : -1) / std::sqrt(12.0), 0.5 + (g & 2 ? 1 : -1) / std::sqrt(12.0),
                           0.5 + (g & 4 ? 1 : -1) / std::sqrt(12.0)};
      glm::dmat3 jacobian(0.0);
      for (int c = 0; c < 8; ++c) {
        const int at[3] = {c & 1, c >> 1 & 1, c >> 2};
        for (int axis = 0; axis < 3; ++axis) {
          double weight = 1;
          for (int a = 0; a < 3; ++a) {
            const double side = at[a] ? 1 : -1;
            weight *= a == axis ? side : at[a] ? u[a] : 1 - u[a];
          }
          jacobian[axis] += weight * place(i + at[0], j + at[1], k + at[2]);
        }
      }
      sum += glm::determinant(jacobian) / 8;
    }
    return std::abs(sum);
  };
  size_t n = 0;
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 5; ++j)
      for (int i = 0; i < 4; ++i, ++n) {
        double sum = 0;
        int cells = 0;
        for (int c = 0; c < 8; ++c) {
          const int at[3] = {i - (c & 1), j - (c >> 1 & 1), k - (c >> 2)};
          const auto has = [&](int axis, int node) { return at[axis] <= node && node <= at[axis] + 1; };
          if (at[0] < 0 || at[1] < 0 || at[2] < 0 || at[0] > 2 || at[1] > 3 || at[2] > 1) continue;
          if (has(0, 2) && has(1, 2) && has(2, 1)) continue;
          sum += volume(at[0], at[1], at[2]);
          ++cells;
        }
        if (cells == 0 || (i == 2 && j == 2 && k == 1))
          EXPECT_TRUE(std::isnan(values("volume", n))) << n;
        else
          EXPECT_NEAR(values("volume", n), sum / cells, 1e-5 * sum / cells) << n;
      }
}

TEST(DerivedSource, TakesCgnsNamesAndStoredPressure) {
  auto grid = std::make_unique<NamedGrid>(
      std::vector{gridBlock(5, 5, 5)},
      std::vector<std::string>{"Density", "Pressure", "VelocityX", "VelocityY", "VelocityZ"},
      [](const GridNode& node) {
        const auto x = static_cast<float>(node.i);
        return NodeValues{glm::dvec3(node.i, node.j, node.k), {2, 3 + x, 0, 4 * x, 1}, false};
      });
  const DerivedSource source(std::move(grid), options());
  EXPECT_EQ(scalarsNamed(source.description(), {"110"}), std::vector<uint32_t>{1});
  const Values values =
      valuesOf(source, {"vorticity_magnitude", "pressure_gradient_magnitude", "temperature"});
  for (size_t n = 0; n < 125; ++n) {
    EXPECT_NEAR(values("vorticity_magnitude", n), 4, 1e-5);
    EXPECT_NEAR(values("pressure_gradient_magnitude", n), 1, 1e-5);
    EXPECT_NEAR(values("temperature", n), (3 + n % 5) / 2.0 / kGasConstant, 1e-5);
  }
}

TEST(DerivedSource, OfCellsStandInCells) {
  const FunctionGridSource nodes({gridBlock(8, 8, 8)}, 0, [](const GridNode& node) {
    return NodeValues{bentPosition(node, 8, 8, 8), {}, node.i == 4 && node.j == 4 && node.k == 4};
  });
  class Renamed : public CellGridSource {
   public:
    Renamed(const GridSource& nodes, std::vector<Function> functions)
        : CellGridSource(nodes, std::move(functions)), description_(CellGridSource::description()) {
      const char* names[] = {"Density", "Velocity:x", "Velocity:y", "Velocity:z", "Pressure"};
      for (size_t n = 0; n < 5; ++n) description_.scalars[n].name = names[n];
    }
    const GridDescription& description() const override { return description_; }

   private:
    GridDescription description_;
  };
  auto cells = std::make_unique<Renamed>(
      nodes, std::vector<CellGridSource::Function>{
                 [](const GridCell&) { return 2; }, [](const GridCell& c) { return 1 - c.centre.y; },
                 [](const GridCell& c) { return c.centre.x; }, [](const GridCell&) { return 0.5; },
                 [](const GridCell& c) { return 4 + 3 * c.centre.z; }});
  const DerivedSource source(std::move(cells), {});
  const auto scalars = scalarsNamed(source.description(), {"211", "210", "mach"});
  for (const uint32_t scalar : scalars)
    EXPECT_EQ(source.description().scalars[scalar].centring, Centring::kCell);
  NodeArrays out;
  source.read(0, {0, 8, 0, 8}, scalars, out);
  int cells_there = 0;
  for (size_t n = 0; n < out.x.size(); ++n) {
    if (!std::isfinite(out.scalars[0][n])) continue;
    ++cells_there;
    EXPECT_NEAR(out.scalars[0][n], 2, 1e-4);
    EXPECT_NEAR(out.scalars[1][n], 3, 1e-4);
  }
  EXPECT_EQ(cells_there, 7 * 7 * 7 - 8);
  expectPartsOfRows(source);
  // Coordinates are still those of the nodes.
  EXPECT_EQ(out.x[3], bentPosition({0, 3, 0, 0}, 8, 8, 8).x);
}

TEST(DerivedSource, AFileVariablesNumberComesFirst) {
  class Numbered : public NamedGrid {
   public:
    Numbered()
        : NamedGrid({gridBlock(3, 3, 3)}, kConserved,
                    [](const GridNode& node) {
                      return NodeValues{glm::dvec3(node.i, node.j, node.k), {1, 0, 0, 0, 1}, false};
                    }),
          description_(NamedGrid::description()) {
      for (uint32_t n = 0; n < 5; ++n) description_.scalars[n].number = 108 + n;
    }
    const GridDescription& description() const override { return description_; }

   private:
    GridDescription description_;
  };
  const DerivedSource source(std::make_unique<Numbered>(), {});
  EXPECT_EQ(scalarsNamed(source.description(), {"110"}), std::vector<uint32_t>{2});
  const auto notes = notesOnNumbers(source.description(), {"110", "113", "109", "pressure"});
  ASSERT_EQ(notes.size(), 1u);
  expectSays(notes[0], "for PLOT3D's function 110 use pressure");
  EXPECT_EQ(source.description().scalars[scalarsNamed(source.description(), {"113"})[0]].name, "sound_speed");
}

TEST(DerivedSource, RefusesAnImpossibleGas) {
  for (const GasModel gas : {GasModel{1.0, {}}, GasModel{NAN, {}}, GasModel{{}, 0.0}, GasModel{{}, -1.0}})
    EXPECT_THROW(DerivedSource(bentFlow(3, vortexFlow), DerivedOptions{gas, {}}), UsageError);
}

TEST(DerivedSource, Converts) {
  const TemporaryFolder folder;
  const DerivedSource source(bentFlow(40, vortexFlow), options());
  ConvertOptions convert_options;
  convert_options.output = folder / "q.splats";
  convert_options.scalars = scalarsNamed(source.description(), {"q_criterion"});
  Progress progress;
  const ConvertReport report = convert(source, convert_options, progress);
  EXPECT_EQ(report.blanked.total(), 0u);
  EXPECT_EQ(CacheReader(folder / "q.splats").manifest().variables[0].name, "q_criterion");
}

}  // namespace
}  // namespace curvisplat
