// A small series of steps for tests: two blocks that share a face, whose grid may move.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "tests/reference/function_grid.h"

namespace curvisplat {

namespace fs = std::filesystem;

/// The properties of a step of the test series.
struct StepKind {
  double time = 0;
  double shift = 0;  // of the grid
  bool other_blocks = false;
  bool lacks_scalar = false;
  bool blanks_more = false;
  bool time_in_header = false;  // as in a Q file
};

/// A step of a function's grid, with a description that may differ from the grid's.
class FunctionStep : public GridSource {
 public:
  explicit FunctionStep(const FunctionGridSource& grid) : grid_(grid), description_(grid_.description()) {}

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    grid_.read(block, box, scalars, out);
  }

 private:
  const FunctionGridSource grid_;

 protected:
  GridDescription description_;
};

/// Two blocks that share a face, with blanked nodes, and two scalars that move with time.
class StepSource : public FunctionStep {
 public:
  explicit StepSource(const StepKind& kind)
      : FunctionStep({{gridBlock(kind.other_blocks ? 15 : 18, 12, 10), gridBlock(10, 12, 10)},
                      2,
                      [kind](const GridNode& node) {
                        NodeValues values;
                        const double i = static_cast<double>(node.i) + (node.block == 1 ? 17.0 : 0.0);
                        const auto j = static_cast<double>(node.j), k = static_cast<double>(node.k);
                        values.position = {i + 0.2 * std::sin(j) + kind.shift, j + 0.1 * std::cos(k),
                                           k + 0.002 * i * i};
                        const double t = 0.1 * kind.time;
                        values.scalars = {static_cast<float>(std::sin(0.3 * i - t) * std::cos(0.2 * j)),
                                          static_cast<float>(10 + 0.1 * k + std::cos(0.5 * i + t))};
                        values.blank = node.block == 0 && node.i < 3 && node.j < (kind.blanks_more ? 6u : 4u);
                        return values;
                      }}) {
    description_.times = {kind.time};
    description_.files = {"step " + std::to_string(kind.time)};
    if (kind.time_in_header) {
      description_.times.clear();
      description_.flow.emplace_back().time = kind.time;
    }
    if (kind.lacks_scalar) description_.scalars[1].name = "other";
  }
};

inline std::vector<StepKind> steadyGrid(size_t steps) {
  std::vector<StepKind> kinds;
  for (size_t n = 0; n < steps; ++n) kinds.push_back({static_cast<double>(n)});
  return kinds;
}

inline SeriesInput inputOf(const std::vector<StepKind>& kinds) {
  SeriesInput input;
  input.count = kinds.size();
  input.name = [](uint64_t step) { return "file " + std::to_string(step); };
  input.open = [kinds](uint64_t step) { return std::make_unique<StepSource>(kinds[step]); };
  input.scalars = [](const GridDescription&) { return std::vector<uint32_t>{0, 1}; };
  return input;
}

inline SeriesOptions optionsFor(const fs::path& output) {
  SeriesOptions options;
  options.convert.output = output;
  options.convert.memory_bytes = uint64_t{1} << 30;
  options.convert.threads = 2;
  options.convert.title = "series";
  options.convert.limits.bucket_splats = 1200;
  return options;
}

struct Conversion {
  SeriesReport report;
  std::vector<std::string> left_out;
};

inline Conversion convertQuietly(const SeriesInput& input, const SeriesOptions& options) {
  Progress progress;
  Conversion run;
  run.report = convertSeries(input, options, progress, [&](const SeriesEvent& event) {
    if (!event.reason.empty()) run.left_out.push_back(event.name + ": " + event.reason);
  });
  return run;
}

}  // namespace curvisplat
