// Measures how faithful pictures are: converts and draws scenes and real grids, and compares the pictures
// with the reference ray march. Prints a table, and writes JSON on request.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>

#include "bench/picture_sheet.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/grid_views.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

constexpr int kPixels = 256;  // width and height of the picture
constexpr SceneGridSize kNodes{128, 64, 64};

struct View {
  std::string name;
  Camera camera;
};

/// A grid, and the field that its picture is compared with.
struct Case {
  std::string name;
  std::unique_ptr<GridSource> corners;  // what `source` or `field` is made from, where that is another grid
  std::unique_ptr<GridSource> source;
  uint32_t scalar = 0;
  std::shared_ptr<const Scene> scene;  // the scene behind `field`, if it is analytic
  std::unique_ptr<ReferenceField> field;
  std::pair<double, double> range{0, 1};
  double length = 1;  // extinctions are per this length, in world units
  std::vector<View> views;
};

Case sceneCase(const std::string& name, const std::string& scene, std::optional<double> clustering,
               std::vector<View> views, std::optional<std::array<uint64_t, 3>> cuts = {}) {
  Case out;
  out.name = name;
  out.scene = makeScene(scene, clustering);
  out.source = std::make_unique<SceneGridSource>(out.scene, kNodes, 4);
  if (cuts) {
    Rearrangement how;
    how.cuts = *cuts;
    out.source = std::make_unique<RearrangedGridSource>(*out.source, how);
  }
  out.field = std::make_unique<SceneField>(*out.scene);
  out.views = std::move(views);
  return out;
}

/// A scene with as many cells as the other cases have nodes.
Case cellCase(const std::string& name, const std::string& scene, std::vector<View> views) {
  Case out = sceneCase(name, scene, {}, std::move(views));
  out.corners = std::make_unique<SceneGridSource>(
      out.scene, SceneGridSize{kNodes.ni + 1, kNodes.nj + 1, kNodes.nk + 1}, 4);
  out.source = std::make_unique<CellGridSource>(
      *out.corners, std::vector<CellGridSource::Function>{
                        [&scene = *out.scene](const GridCell& cell) { return scene.scalar(cell.centre); }});
  out.scalar = 1;
  return out;
}

/// A scene's grid compared with its own trilinear interpolation: what differs is due to the splats alone.
Case trilinearCase(const std::string& name, const std::string& scene, std::optional<double> clustering,
                   std::vector<View> views) {
  Case out = sceneCase(name, scene, clustering, std::move(views));
  out.field = std::make_unique<GridField>(*out.source, 0);
  return out;
}

struct RealGrid {
  std::filesystem::path grid, solution;
  std::string scalar;
};

Case realCase(const std::string& name, const RealGrid& real, uint32_t refine) {
  Case out;
  out.name = refine == 1 ? name : fmt::format("{} /{}", name, refine);
  OpenGridOptions options;
  options.grid = real.grid;
  options.solutions = {real.solution};
  out.corners = openGrid(options);
  out.source = refined(openGrid(options), refine);
  out.scalar = scalarsNamed(out.corners->description(), {real.scalar}).front();
  auto field = std::make_unique<GridField>(*out.corners, out.scalar);
  const auto [lower, upper] = field->bounds();
  out.range = field->range();
  out.length = glm::length(upper - lower) / 3;  // as for half-annulus, whose diagonal is 2.6
  for (const char* view : {"iso", "-x"})
    out.views.push_back(
        {view, Camera::named(view, lower, upper, {kPixels, kPixels}, Projection::kOrthographic)});
  out.views.push_back(
      {"iso 30", Camera::named("iso", lower, upper, {kPixels, kPixels}, Projection::kPerspective)});
  out.field = std::move(field);
  return out;
}

struct NamedCase {
  std::string name;
  std::function<Case()> make;
};

std::vector<NamedCase> allCases(uint32_t refine) {
  const View front{"front", halfAnnulusCamera()}, edge{"edge-on", edgeOnCamera()},
      perspective{"30 degrees", perspectiveCamera(30)}, wide{"90 degrees", perspectiveCamera(90)};
  Camera from_afar = halfAnnulusCamera();
  from_afar.focal_point = {0, 0, 0.5};
  from_afar.position = from_afar.focal_point - 6.0 * glm::normalize(glm::dvec3(0.8, 0.35, -0.45));
  from_afar.parallel_scale = 1.4;
  const View whole{"whole", from_afar};
  from_afar.focal_point = {0, 0, 0};
  from_afar.parallel_scale = 2.6;
  const View sheared{"whole", from_afar};

  std::vector<NamedCase> cases;
  const auto add = [&](const std::string& name, const std::string& scene, std::optional<double> clustering,
                       std::vector<View> views, std::optional<std::array<uint64_t, 3>> cuts = {}) {
    cases.push_back({name, [=] { return sceneCase(name, scene, clustering, views, cuts); }});
  };
  add("half-annulus 2.5", "half-annulus", 2.5, {front, edge, perspective, wide});
  add("half-annulus 5", "half-annulus", 5, {front});
  add("half-annulus 7", "half-annulus", 7, {front});
  add("half-annulus 9", "half-annulus", 9, {front, edge});
  add("constant", "half-annulus-constant", {}, {front, edge});
  cases.push_back({"cells", [=] { return cellCase("cells", "half-annulus", {front, edge}); }});
  add("two blocks", "half-annulus", 2.5, {front}, {{2, 1, 1}});
  add("o-grid", "o-grid", {}, {whole});
  add("axis", "axis", {}, {whole});
  add("shell", "shell", {}, {front});
  add("sheared waves", "sheared-waves", {}, {sheared});
  for (const double clustering : {2.5, 9.0}) {
    const std::string name = fmt::format("trilinear {}", clustering);
    cases.push_back({name, [=] { return trilinearCase(name, "half-annulus", clustering, {front}); }});
  }
  const std::filesystem::path data = CURVISPLAT_SHARED_DATA;
  const auto real = [&](const std::string& name, const std::string& grid, const std::string& solution,
                        const std::string& scalar) {
    if (std::filesystem::exists(data / grid))
      cases.push_back({name, [=] { return realCase(name, {data / grid, data / solution, scalar}, refine); }});
  };
  real("bluntfin density", "bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin", "density");
  real("combustor density", "combustor/combxyz.bin", "combustor/combq.bin", "density");
  real("nek pressure", "nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun", "4");
  return cases;
}

struct Settings {
  std::filesystem::path folder;
  std::string only = ".*", views = ".*";
  int pixels = kPixels, rays = 1;
  uint32_t refine = 1;
  Backend backend = Backend::kCpu;
  double low_pass_px2 = FrameOptions().low_pass_px2;
  bool pictures = false, quick = false;
};

class Measurement {
 public:
  explicit Measurement(const Settings& settings)
      : settings_(settings), folder_(settings.folder), size_{settings.pixels, settings.pixels} {
    std::filesystem::create_directories(folder_);
  }

  void measure(const Case& grid) {
    const std::filesystem::path cache = folder_ / (fileName(grid.name) + ".splats");
    convertGrid(*grid.source, cache, grid.scalar);
    for (const View& view : grid.views) {
      if (!std::regex_search(view.name, std::regex(settings_.views))) continue;
      for (const std::string function : {"smooth", "band", "step"})
        // The constant scene has its value at the step's jump, where the result means nothing.
        if (!(grid.name == "constant" && function == "step")) measure(grid, view, function, cache);
    }
  }

  nlohmann::json rows() const { return rows_; }

 private:
  static std::string fileName(std::string name) {
    for (char& c : name)
      if (c == ' ' || c == '/') c = '_';
    return name;
  }

  /// The reference picture; marched on the first call and kept in the folder.
  Image reference(const Case& grid, const View& view, const std::string& function_name,
                  const KnownFunction& function) {
    const std::string kind = (size_.width == kPixels ? "" : fmt::format("_{}", size_.width)) +
                             (settings_.rays == 1 ? "" : fmt::format("_{}rays", settings_.rays));
    const auto path = folder_ / fmt::format("{}_{}_{}{}_reference.pfm", fileName(grid.name),
                                            fileName(view.name), function_name, kind);
    if (!std::filesystem::exists(path)) {
      MarchSteps steps;
      steps.step = 0.016 * grid.length;
      steps.cells = 2;
      const ImageSize rays{settings_.rays * size_.width, settings_.rays * size_.height};
      const ConvergedImage reference =
          convergedMarch(*grid.field, function.exact, view.camera, rays, steps, 75);
      if (reference.agreement_db < 75)
        fmt::print(stderr, "{}: successive references agree to {:.1f} dB only\n", path.string(),
                   reference.agreement_db);
      const Image image = toImage(reference.image);
      writeImage(settings_.rays == 1 ? image : shrunk(image, settings_.rays), path);
    }
    return readImage(path);
  }

  void measure(const Case& grid, const View& view, const std::string& function_name,
               const std::filesystem::path& cache) {
    const KnownFunction function =
        KnownFunction::of(function_name, grid.range.first, grid.range.second, grid.length);
    const Image exact = reference(grid, view, function_name, function);
    if (rows_.empty()) fmt::print("{:<18} {:<10} {:<7} {:>31}   {:>31}\n", "", "", "", "per pixel", "flat");
    std::string line = fmt::format("{:<18} {:<10} {:<7}", grid.name, view.name, function_name);
    for (const auto classification : {Classification::kPixel, Classification::kFlat}) {
      for (const double lod_pixels : {0.0, 4.0, 8.0}) {
        if (settings_.quick && (lod_pixels > 0 || classification == Classification::kFlat)) continue;
        FrameOptions options = knownFrame(size_);
        options.low_pass_px2 = settings_.low_pass_px2;
        options.lod_pixels = lod_pixels;
        options.classification = classification;
        uint64_t splats = 0;
        const Image picture =
            drawCache(cache, function.table, view.camera, options, &splats, settings_.backend);
        const ImageDifference difference = compareImages(picture, exact);
        const bool flat = classification == Classification::kFlat;
        line +=
            fmt::format(" {:5.1f}{:>7}", difference.psnr_db, flat ? "" : fmt::format("({}k)", splats / 1000));
        rows_.push_back({{"case", grid.name},
                         {"view", view.name},
                         {"function", function_name},
                         {"classification", flat ? "flat" : "pixel"},
                         {"lod_pixels", lod_pixels},
                         {"splats", splats},
                         {"psnr_db", difference.psnr_db},
                         {"largest", difference.largest}});
        if (settings_.pictures && lod_pixels == 0 && !flat) leave(picture, exact, grid, view, function_name);
      }
      line += "  ";
    }
    fmt::print("{}\n", line);
    std::fflush(stdout);
  }

  void leave(const Image& picture, const Image& exact, const Case& grid, const View& view,
             const std::string& function_name) {
    const std::string prefix =
        fmt::format("{}_{}_{}", fileName(grid.name), fileName(view.name), function_name);
    Image difference(picture.size);
    for (size_t n = 0; n < difference.rgba.size(); ++n)
      difference.rgba[n] = n % 4 == 3 ? 1 : 20 * std::abs(picture.rgba[n] - exact.rgba[n]);
    writeImage(picture, folder_ / (prefix + "_picture.png"));
    writeImage(exact, folder_ / (prefix + "_reference.png"));
    writeImage(difference, folder_ / (prefix + "_difference_x20.png"));
  }

  Settings settings_;
  std::filesystem::path folder_;
  ImageSize size_;
  nlohmann::json rows_ = nlohmann::json::array();
};

int run(int argc, char** argv) {
  CLI::App app(
      "Compare pictures with the reference march: dB, and splats drawn.\n"
      "Columns: the finest level, 4 pixels, 8 pixels.");
  Settings settings;
  std::string json;
  const std::map<std::string, Backend> backends{{"cpu", Backend::kCpu},
                                                {"osmesa", Backend::kOsmesa},
                                                {"egl", Backend::kEgl},
                                                {"auto", Backend::kAutomatic}};
  app.add_option("FOLDER", settings.folder, "Folder for caches and references; references are reused")
      ->required();
  app.add_option("--only", settings.only, "Regular expression of the cases to measure");
  app.add_option("--views", settings.views, "Regular expression of the views to measure");
  app.add_option("--pixels", settings.pixels,
                 "Width and height of the pictures (default 256, for which figures are published)")
      ->check(CLI::Range(8, 4096));
  app.add_option("--rays", settings.rays, "Average the references over N x N rays a pixel (default 1)")
      ->check(CLI::Range(1, 16));
  app.add_option("--refine", settings.refine, "Cut the cells of real grids into N x N x N, as convert does")
      ->check(CLI::Range(1, 16));
  app.add_option("--json", json, "Write the table as JSON to this file");
  app.add_option("--backend", settings.backend, "Backend: cpu, osmesa, egl or auto")
      ->transform(CLI::CheckedTransformer(backends));
  app.add_option("--low-pass", settings.low_pass_px2, "Low-pass of the projection, in pixels squared");
  app.add_flag("--pictures", settings.pictures, "Keep pictures, references and differences in FOLDER");
  app.add_flag("--quick", settings.quick, "Only the finest level, classified per pixel");
  CLI11_PARSE(app, argc, argv);
  Measurement measurement(settings);
  for (const NamedCase& named : allCases(settings.refine))
    if (std::regex_search(named.name, std::regex(settings.only))) measurement.measure(named.make());
  if (!json.empty()) writeFileAtomically(json, measurement.rows().dump(1) + "\n");
  return 0;
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  try {
    return curvisplat::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "curvisplat_fidelity: {}\n", error.what());
    return 1;
  }
}
