// Draws a grid's scalar, or an analytic scene, with the reference march: the picture that those of any
// program are compared with. Options for camera and function are those of `curvisplat render`.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

struct Words {
  std::string scene, grid, solution, scalar, function, output;
  std::optional<double> clustering;
  std::vector<int> size{256, 256};
  std::vector<double> range{0, 1};
  double length = 1;  // extinctions are per this length, in world units
  double agreement_db = 75;
  std::vector<double> position, focal_point, view_up{0, 0, 1};
  double parallel_scale = 1;
};

void addOptions(CLI::App& app, Words& words) {
  const auto numbers = [&](const std::string& name, std::vector<double>& to, int count, const char* help) {
    return app.add_option(name, to, help)->delimiter(',')->expected(count);
  };
  auto* scene = app.add_option("--scene", words.scene, "Analytic scene, as for `curvisplat generate`");
  app.add_option("--clustering", words.clustering, "Clustering of the scene")->needs(scene);
  auto* grid = app.add_option("--grid", words.grid, "Grid file, instead of a scene")->excludes(scene);
  app.add_option("--solution", words.solution, "Solution or function file of the grid")->needs(grid);
  app.add_option("--scalar", words.scalar, "Scalar of the grid")->needs(grid);
  app.add_option("--function", words.function, "Transfer function: smooth, band or step")
      ->required()
      ->check(CLI::IsMember({"smooth", "band", "step"}));
  numbers("--range", words.range, 2, "LO,HI: stretch the function over these scalars");
  app.add_option("--length", words.length, "Length that extinctions are per, in world units")
      ->check(CLI::PositiveNumber);
  app.add_option("--size", words.size, "WIDTHxHEIGHT in pixels")->delimiter('x')->expected(2);
  numbers("--position", words.position, 3, "x,y,z of the camera")->required();
  numbers("--focal-point", words.focal_point, 3, "x,y,z it looks at")->required();
  numbers("--view-up", words.view_up, 3, "x,y,z that points up");
  app.add_option("--parallel-scale", words.parallel_scale, "Half the picture's height in world units")
      ->required();
  app.add_option("--agreement", words.agreement_db,
                 "Halve the steps until two marches agree to this many dB");
  app.add_option("-o,--output", words.output, "Picture to write: PFM, EXR or PNG")->required();
}

Camera cameraOf(const Words& words) {
  const auto vector = [](const std::vector<double>& v) { return glm::dvec3(v[0], v[1], v[2]); };
  Camera camera;
  camera.position = vector(words.position);
  camera.focal_point = vector(words.focal_point);
  camera.view_up = vector(words.view_up);
  camera.parallel_scale = words.parallel_scale;
  return camera;
}

void march(const ReferenceField& field, const Words& words) {
  const KnownFunction function =
      KnownFunction::of(words.function, words.range[0], words.range[1], words.length);
  const ImageSize size{words.size[0], words.size[1]};
  if (size.width < 1 || size.height < 1) throw UsageError("--size: expected at least one pixel each way");
  MarchSteps steps;
  steps.step = 0.016 * words.length;
  steps.cells = 2;
  const ConvergedImage reference =
      convergedMarch(field, function.exact, cameraOf(words), size, steps, words.agreement_db);
  writeImage(toImage(reference.image), words.output);
  fmt::print("{{\"agreement_db\": {:.2f}}}\n", reference.agreement_db);
}

int run(int argc, char** argv) {
  CLI::App app(
      "Draw the reference picture of a grid or a scene by marching rays through the pixels' centres.");
  Words words;
  addOptions(app, words);
  CLI11_PARSE(app, argc, argv);
  if (!words.scene.empty()) {
    const std::shared_ptr<const Scene> scene = makeScene(words.scene, words.clustering);
    march(SceneField(*scene), words);
    return 0;
  }
  if (words.grid.empty()) throw UsageError("--scene or --grid is required");
  OpenGridOptions options;
  options.grid = words.grid;
  if (!words.solution.empty()) options.solutions = {words.solution};
  const std::unique_ptr<GridSource> source = openGrid(options);
  const uint32_t scalar =
      words.scalar.empty() ? 0 : scalarsNamed(source->description(), {words.scalar}).front();
  march(GridField(*source, scalar), words);
  return 0;
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  try {
    return curvisplat::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "curvisplat_reference: {}\n", error.what());
    return 1;
  }
}
