// A simulation's own arrays, converted and drawn without a grid file between: example FOLDER makes FOLDER/bent.splats
// and FOLDER/bent.png.
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <span>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/grid/grid_source.h"
#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "render/image/image_file.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace {

using namespace curvisplat;

constexpr uint64_t kNi = 64, kNj = 24, kNk = 16;

/// The memory of a simulation: a bent duct of kNi x kNj x kNk nodes, i fastest, and a temperature at each.
struct Simulation {
  std::vector<double> x, y, z;
  std::vector<float> temperature;

  Simulation() {
    for (uint64_t k = 0; k < kNk; ++k)
      for (uint64_t j = 0; j < kNj; ++j)
        for (uint64_t i = 0; i < kNi; ++i) {
          const double angle = 1.5 * static_cast<double>(i) / (kNi - 1);
          const double radius = 1 + static_cast<double>(j) / (kNj - 1);
          x.push_back(radius * std::cos(angle));
          y.push_back(radius * std::sin(angle));
          z.push_back(static_cast<double>(k) / (kNk - 1));
          temperature.push_back(static_cast<float>(300 + 50 * std::sin(6 * angle) * radius));
        }
  }
};

/// The arrays as conversion reads them: boxes of nodes, of one block with one scalar.
class SimulationSource : public GridSource {
 public:
  explicit SimulationSource(const Simulation& simulation) : simulation_(simulation) {
    description_.format = "arrays in memory";
    description_.blocks = {{.name = "duct", .ni = kNi, .nj = kNj, .nk = kNk}};
    description_.scalars = {{.name = "temperature", .unit = "K"}};
    description_.coordinate_bytes = 8;
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t /*block*/, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const uint64_t nodes = kNi * (box.j1 - box.j0) * (box.k1 - box.k0);
    for (std::vector<double>* coordinate : {&out.x, &out.y, &out.z}) coordinate->resize(nodes);
    out.blank.assign(nodes, 0);
    out.scalars.assign(scalars.size(), std::vector<float>(nodes));
    uint64_t to = 0;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < kNi; ++i, ++to) {
          const uint64_t from = (k * kNj + j) * kNi + i;
          out.x[to] = simulation_.x[from];
          out.y[to] = simulation_.y[from];
          out.z[to] = simulation_.z[from];
          for (std::vector<float>& scalar : out.scalars) scalar[to] = simulation_.temperature[from];
        }
  }

 private:
  const Simulation& simulation_;
  GridDescription description_;
};

void run(const std::filesystem::path& folder) {
  const Simulation simulation;
  Progress progress;
  ConvertOptions options;
  options.output = folder / "bent.splats";
  options.overwrite = true;
  options.scalars = {0};
  const ConvertReport report = convert(SimulationSource(simulation), options, progress);
  std::printf("%llu nodes, %llu splats\n", static_cast<unsigned long long>(report.nodes),
              static_cast<unsigned long long>(report.splats));

  const CacheReader cache(options.output);
  const Manifest& manifest = cache.manifest();
  const VariableInfo& temperature = manifest.variables[0];
  FrameOptions frame;
  frame.size = {320, 240};
  const TransferFunction colours = TransferFunction::preset("inferno", temperature.min, temperature.max, 0.1);
  const Camera camera =
      Camera::named("iso", manifest.lower, manifest.upper, frame.size, Projection::kOrthographic);
  FrameRenderer renderer(cache, 0, colours);
  FrameStatistics statistics;
  writeImage(renderer.render(camera, frame, statistics), folder / "bent.png");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: example FOLDER\n");
    return 2;
  }
  try {
    run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "example: %s\n", error.what());
    return 1;
  }
  return 0;
}
