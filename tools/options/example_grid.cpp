#include "tools/options/example_grid.h"

#include <fmt/format.h>

#include <string>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/options/kept_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr SceneGridSize kSize{64, 48, 24};
constexpr int kExampleSteps = 8;
constexpr double kTimeOfStep = 0.06;  // a wave length of the vortices takes 1

fs::path exampleFolder() {
  auto folder = keptFolder();
  if (!folder) throw Error("neither XDG_CACHE_HOME nor HOME is set, so there is no folder for an example");
  return *folder += "-example";
}

}  // namespace

std::vector<fs::path> exampleFiles() {
  return {exampleFolder() / "wake.xyz", exampleFolder() / "wake_%04d.fun"};
}

void writeExample(Progress& progress) {
  const fs::path folder = exampleFolder();
  makePrivateFolders(folder);
  const auto prefix = [&](int step) { return folder / fmt::format("wake_{:04}", step); };
  if (fs::exists(prefix(kExampleSteps - 1).string() + ".fun")) return;
  for (int step = 0; step < kExampleSteps; ++step) {
    const SceneGridSource source(makeScenesAt("wake", {}, {kTimeOfStep * step, false}), kSize);
    Plot3dOutputs outputs = plot3dOutputs(prefix(step));
    outputs.grid = step == 0 ? exampleFiles().front() : fs::path();
    writePlot3d(source, outputs, progress);
  }
}

}  // namespace curvisplat
