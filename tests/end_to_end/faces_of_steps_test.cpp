// Faces of the grid in series and after additions: what a step shows of them is what a cache of that step alone does.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "render/image/image_file.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

/// Two blocks that share a face. The grid moves in step 2.
FunctionGridSource gridAt(uint64_t step) {
  return {{gridBlock(20, 14, 12), gridBlock(10, 14, 12)}, 2, [step](const GridNode& node) {
            const double i = static_cast<double>(node.i) + (node.block == 1 ? 19.0 : 0.0);
            const auto j = static_cast<double>(node.j), k = static_cast<double>(node.k);
            const auto t = static_cast<double>(step);
            return NodeValues{
                {i + 0.2 * std::sin(j) + (step >= 2 ? 3.0 : 0.0), j + 0.1 * std::cos(k), k + 0.002 * i * i},
                {static_cast<float>(std::sin(0.3 * i - 0.8 * t) * std::cos(0.2 * j)),
                 static_cast<float>(10 + 0.1 * k + std::cos(0.5 * i + 0.7 * t))}};
          }};
}

class TimedGrid : public GridSource {
 public:
  explicit TimedGrid(uint64_t step) : grid_(gridAt(step)), description_(grid_.description()) {
    description_.times = {static_cast<double>(step)};
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    grid_.read(block, box, scalars, out);
  }

 private:
  FunctionGridSource grid_;
  GridDescription description_;
};

ConvertOptions optionsFor(const std::filesystem::path& output, std::vector<uint32_t> scalars) {
  ConvertOptions options;
  options.output = output;
  options.scalars = std::move(scalars);
  options.planes = {{0u, 2, 5}};
  return options;
}

/// A view in which the faces are in sight, without the volume.
const Words kView = {"--size",         "160x120", "--position",       "40,-50,60", "--focal-point", "15,6,6",
                     "--view-up",      "0,0,1",   "--parallel-scale", "16",        "--range",       "-1,1",
                     "--opacity-unit", "5",       "--volume",         "off"};

class FacesOfSteps : public ProgramTest {
 protected:
  void convertSteps(const std::string& name, const std::vector<uint64_t>& steps) const {
    SeriesInput input;
    input.count = steps.size();
    input.name = [](uint64_t step) { return "step " + std::to_string(step); };
    input.open = [steps](uint64_t step) { return std::make_unique<TimedGrid>(steps[step]); };
    input.scalars = [](const GridDescription&) { return std::vector<uint32_t>{0, 1}; };
    SeriesOptions options;
    options.convert = optionsFor(folder_ / name, {0, 1});
    Progress progress;
    convertSeries(input, options, progress, [](const SeriesEvent&) {});
  }
  Image drawn(const std::string& cache, const Words& more) const {
    return pictureOf(file(cache), file("a.pfm"), kView + more);
  }
};

TEST_F(FacesOfSteps, AStepHasTheFacesAndValuesOfItsOwn) {
  convertSteps("series.splats", {0, 1, 2, 3});
  Image before;
  for (uint64_t step = 0; step < 4; ++step) {
    SCOPED_TRACE(step);
    convertSteps("alone" + std::to_string(step) + ".splats", {step});
    for (const char* face : {"kmax,imax", "k=5"}) {
      const Image series =
          drawn("series.splats", {"--step", std::to_string(step), "--surface", face, "--surface-by", "s0"});
      const Image alone =
          drawn("alone" + std::to_string(step) + ".splats", {"--surface", face, "--surface-by", "s0"});
      EXPECT_EQ(series.rgba, alone.rgba) << face;
      EXPECT_NE(series.rgba, before.rgba);
      before = series;
    }
  }
  run({"info", file("series.splats"), "--verify"});
  // Frames of steps one after the other.
  run(Words{"render", file("series.splats"), "-o", file("f_%02d.pfm"), "--steps", "0:3", "--surface",
            "kmax,imax", "--surface-by", "s0"} +
      kView);
  for (uint64_t step = 0; step < 4; ++step)
    EXPECT_EQ(readImage(folder_ / ("f_0" + std::to_string(step) + ".pfm")).rgba,
              drawn("series.splats",
                    {"--step", std::to_string(step), "--surface", "kmax,imax", "--surface-by", "s0"})
                  .rgba)
        << step;
}

TEST_F(FacesOfSteps, AnAddedScalarColoursTheFaces) {
  const TimedGrid grid(0);
  Progress progress;
  convert(grid, optionsFor(folder_ / "both.splats", {0, 1}), progress);
  convert(grid, optionsFor(folder_ / "added.splats", {0}), progress);
  AddScalarOptions adding;
  adding.cache = folder_ / "added.splats";
  adding.scalars = {1};
  addScalars(grid, adding, progress);
  for (const char* face : {"kmax,imax", "k=5"})
    for (const char* scalar : {"s0", "s1"}) {
      const Words options{"--scalar", scalar, "--surface", face, "--surface-by", scalar};
      EXPECT_EQ(drawn("added.splats", options).rgba, drawn("both.splats", options).rgba)
          << face << ", " << scalar;
    }
  run({"info", file("added.splats"), "--verify"});
}

}  // namespace
}  // namespace curvisplat
