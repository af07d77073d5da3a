// Fidelity of pictures of real grids. Every grid is drawn as a uniform medium and with a scalar of its own,
// along the axes, nearly along them, and obliquely, and compared with rays marched through the trilinear map
// of its cells, with one sort of all splats, and with VTK's picture. real_grids.py runs it, and VTK.
//
//   rms %, p98/p2   uniform medium: ratio of the optical depth to the true one, two pixels and more inside the
//                   outline; its standard deviation over its mean, its 98th percentile over its 2nd. A perfect
//                   picture has 0 and 1
//   outside %       uniform medium: optical depth more than one pixel beyond the outline, of the whole
//   inside          uniform medium: PSNR two pixels and more from the outline
//   uniform         uniform medium: PSNR of all pixels
//   scalar          PSNR of the grid's scalar with the "smooth" function, all pixels; blank for scalars of
//                   cells, which have no truth between their values
//   order           the same picture: largest difference to that of one sort of all splats, of 255
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <utility>
#include <vector>

#include "bench/picture_sheet.h"
#include "bench/real_grids_cases.h"
#include "bench/vtk_job.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/grid_views.h"
#include "preprocess/survey/cell_bends.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/global_order.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

constexpr double kOpacity = 0.5;  // of the uniform medium, in its opacity unit

double opacityUnit(double extinction) {
  return -std::log1p(-kOpacity) / extinction;
}

/// Black, to be drawn over white: a pixel then shows the transmittance.
TransferFunction uniformMedium(double extinction, std::pair<double, double> range) {
  TransferFunctionDefinition definition;
  definition.name = definition.origin = "uniform medium";
  const auto [low, high] = intervalAround(range.first, range.second);
  definition.colours = {{low, glm::dvec3(0.0)}, {high, glm::dvec3(0.0)}};
  definition.opacities = {{low, kOpacity}, {high, kOpacity}};
  return TransferFunction(std::move(definition), nullptr, opacityUnit(extinction));
}

double opticalDepth(double transmittance) {
  return -std::log(std::clamp(transmittance, 1e-12, 1.0));
}

/// The depth in the grid of the ray through each pixel, from a picture of a uniform medium.
class Outline {
 public:
  explicit Outline(const Image& truth) : size_(truth.size), depth_(size_.pixels()) {
    for (size_t p = 0; p < depth_.size(); ++p) depth_[p] = opticalDepth(truth.rgba[4 * p]);
  }

  size_t at(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(size_.width) + static_cast<size_t>(x);
  }
  double depth(size_t p) const { return depth_[p]; }
  double largest() const { return *std::max_element(depth_.begin(), depth_.end()); }

  /// The least and the largest depth around a pixel.
  std::pair<double, double> around(int x, int y, int margin) const {
    std::pair<double, double> range(std::numeric_limits<double>::infinity(), 0.0);
    for (int v = std::max(0, y - margin); v <= std::min(size_.height - 1, y + margin); ++v)
      for (int u = std::max(0, x - margin); u <= std::min(size_.width - 1, x + margin); ++u)
        range = {std::min(range.first, depth_[at(u, v)]), std::max(range.second, depth_[at(u, v)])};
    return range;
  }

 private:
  ImageSize size_;
  std::vector<double> depth_;
};

struct Ripple {
  double rms_percent = 0, p98_over_p2 = 1, outside_percent = 0;
  double psnr_db = 0, inside_psnr_db = 0;
};

double decibels(double square_sum, size_t pixels) {
  constexpr double kMax = 99;
  if (square_sum == 0 || pixels == 0) return kMax;
  return std::min(kMax, -10 * std::log10(square_sum / static_cast<double>(pixels)));
}

/// The ripple of two pictures of a uniform medium, black over white.
Ripple rippleOf(const Image& picture, const Image& truth) {
  constexpr double kThin = 0.05;  // of the largest depth: thinner places have no ripple worth a ratio
  constexpr int kMargin = 2;
  const Outline outline(truth);
  const double largest = outline.largest();
  std::vector<double> ratios;
  double outside = 0, sum = 0, squares = 0;
  size_t inside = 0;
  for (int y = 0; y < truth.size.height; ++y)
    for (int x = 0; x < truth.size.width; ++x) {
      const size_t p = outline.at(x, y);
      const double drawn = opticalDepth(picture.rgba[4 * p]);
      sum += drawn;
      if (outline.around(x, y, 1).second == 0) outside += drawn;
      const double least = outline.around(x, y, kMargin).first;
      if (least > kThin * largest) ratios.push_back(drawn / outline.depth(p));
      if (least > 0) {
        const double off = picture.rgba[4 * p] - truth.rgba[4 * p];
        squares += off * off;
        ++inside;
      }
    }
  Ripple ripple;
  ripple.psnr_db = std::min(99.0, compareImages(picture, truth).psnr_db);
  ripple.inside_psnr_db = decibels(squares, inside);
  ripple.outside_percent = sum > 0 ? 100 * outside / sum : 0.0;
  if (ratios.empty()) return ripple;
  std::sort(ratios.begin(), ratios.end());
  double mean = 0, square = 0;
  for (const double ratio : ratios) mean += ratio;
  mean /= static_cast<double>(ratios.size());
  for (const double ratio : ratios) square += (ratio - mean) * (ratio - mean);
  ripple.rms_percent = 100 * std::sqrt(square / static_cast<double>(ratios.size())) / mean;
  const auto percentile = [&](double part) {
    return ratios[static_cast<size_t>(part * static_cast<double>(ratios.size() - 1))];
  };
  ripple.p98_over_p2 = percentile(0.98) / percentile(0.02);
  return ripple;
}

struct Settings {
  std::filesystem::path folder, data;
  std::string only = ".*", views = ".*", json;
  int pixels = 256, rays = 1;
  uint32_t refine = 1;  // 0: by need
  double lod_pixels = 0, voxel_pixels = 0;
  bool for_vtk = false, keep_drawn = false;
};

/// A grid with all that its pictures need.
struct OpenGrid {
  std::string name;
  std::unique_ptr<GridSource> source;
  uint32_t scalar;
  GridField field;
  double length;  // extinctions are per this length, in world units

  explicit OpenGrid(const RealGrid& grid)
      : name(grid.name),
        source(grid.open()),
        scalar(scalarsNamed(source->description(), {grid.scalar}).front()),
        field(*source, scalar),
        // As for the half-annulus, whose diagonal is 2.6.
        length(glm::length(field.bounds().second - field.bounds().first) / 3) {}
};

class Measurement {
 public:
  explicit Measurement(const Settings& settings)
      : settings_(settings), size_{settings.pixels, settings.pixels}, overview_(size_, 2) {
    std::filesystem::create_directories(settings_.folder);
  }

  /// Writes the grid's cells for VTK, and the job that draws them.
  void leaveJob(const RealGrid& named) const {
    const OpenGrid grid(named);
    const auto [low, high] = grid.field.range();
    const auto [least, most] = intervalAround(low, high);
    const auto cells = settings_.folder / fmt::format("{}_{}.vtk", grid.name, named.scalar);
    nlohmann::json job = {{"grid", cells.string()},
                          {"size", {size_.width, size_.height}},
                          {"range", {low, high}},
                          {"length", grid.length},
                          {"uniform",
                           {{"colours", {{least, 0, 0, 0}, {most, 0, 0, 0}}},
                            {"opacities", {{least, kOpacity}, {most, kOpacity}}},
                            {"opacity_unit", opacityUnit(1 / grid.length)}}}};
    for (const NamedView& view : chosenViews(grid)) {
      nlohmann::json pictures = {{"uniform", pathOf(grid, view, "uniform_vtk", "png").string()}};
      if (!grid.field.ofCells()) pictures["scalar"] = pathOf(grid, view, "scalar_vtk", "png").string();
      job["views"].push_back({{"camera", asJson(view.camera)}, {"pictures", pictures}});
    }
    if (!std::filesystem::exists(cells)) writeTetrahedra(grid.field, cells);
    writeFileAtomically(settings_.folder / (grid.name + "_vtk.json"), job.dump(1) + "\n");
  }

  void measure(const RealGrid& named) {
    const OpenGrid grid(named);
    const std::filesystem::path cache = settings_.folder / (grid.name + ".splats");
    if (settings_.voxel_pixels == 0)
      convertGrid(*refined(named.open(), refinementOf(*grid.source, grid.scalar)), cache, grid.scalar);
    PictureSheet sheet(size_, 1);
    for (const NamedView& view : chosenViews(grid)) {
      std::vector<Image> pictures;
      nlohmann::json row = {{"grid", grid.name}, {"view", view.name}, {"lod_pixels", settings_.lod_pixels}};
      measureUniform(grid, cache, view, row, pictures);
      measureScalar(grid, cache, view, row, pictures);
      print(row);
      sheet.addRow(labelOf(row), pictures);
      overview_.addRow(labelOf(row), pictures);
      rows_.push_back(std::move(row));
    }
    writeImage(sheet.image(), settings_.folder / fmt::format("sheet_{}.png", grid.name));
  }

  void finish() const {
    writeImage(overview_.image(), settings_.folder / "sheet.png");
    if (!settings_.json.empty()) writeFileAtomically(settings_.json, rows_.dump(1) + "\n");
  }

 private:
  Refinement refinementOf(const GridSource& source, uint32_t scalar) const {
    return settings_.refine == 0 ? refinementByNeed(source, {scalar}) : Refinement(settings_.refine);
  }

  std::vector<NamedView> chosenViews(const OpenGrid& grid) const {
    const auto [lower, upper] = grid.field.bounds();
    std::vector<NamedView> views = viewsOf(lower, upper, size_);
    const std::regex wanted(settings_.views);
    std::erase_if(views, [&](const NamedView& view) { return !std::regex_search(view.name, wanted); });
    return views;
  }

  std::filesystem::path pathOf(const OpenGrid& grid, const NamedView& view, const std::string& what,
                               const char* extension) const {
    std::string name = fmt::format("{}_{}_{}_{}.{}", grid.name, view.name, what, size_.width, extension);
    std::replace(name.begin(), name.end(), ' ', '_');
    return settings_.folder / name;
  }

  /// The marched picture. Marched once, and kept in the folder.
  Image truth(const OpenGrid& grid, const NamedView& view, const char* what, const OpticalFunction& function,
              bool is_uniform) const {
    const int rays = is_uniform ? settings_.rays : 1;
    const auto path = pathOf(grid, view, rays > 1 ? fmt::format("{}_{}rays", what, rays) : what, "pfm");
    if (!std::filesystem::exists(path)) {
      MarchSteps steps;
      if (is_uniform) {  // one step from end to end is exact
        steps.step = 1e3 * grid.length;
        steps.cells = std::numeric_limits<double>::infinity();
        const ImageSize size{rays * size_.width, rays * size_.height};
        writeImage(shrunk(toImage(referenceMarch(grid.field, function, view.camera, size, steps)), rays),
                   path);
      } else {
        constexpr double kAgreementDb = 60;
        steps.step = 0.016 * grid.length;
        steps.cells = 1;
        steps.tolerance = 2e-4;
        writeImage(
            toImage(convergedMarch(grid.field, function, view.camera, size_, steps, kAgreementDb).image),
            path);
      }
    }
    return readImage(path);
  }

  /// VTK's picture of the same size, or empty.
  Image byVtk(const OpenGrid& grid, const NamedView& view, const char* what) const {
    const auto path = pathOf(grid, view, what, "png");
    return std::filesystem::exists(path) ? readImage(path) : Image();
  }

  FrameOptions frame() const {
    FrameOptions options = knownFrame(size_);
    options.lod_pixels = settings_.lod_pixels;
    return options;
  }

  /// The picture of the cache, or of splats that are merged into voxels here.
  Image drawn(const OpenGrid& grid, const std::filesystem::path& cache, const NamedView& view,
              const TransferFunction& function) const {
    if (settings_.voxel_pixels == 0) return drawCache(cache, function, view.camera, frame());
    DirectOptions options;
    options.voxel = settings_.voxel_pixels * 2 * view.camera.parallel_scale / size_.height;
    return drawDirectly(*grid.source, grid.scalar, options, function, view.camera, size_);
  }

  static void show(const Image& picture, const Image& exact, const Image& vtk, float gain,
                   std::vector<Image>& pictures) {
    const bool has_truth = exact.size.pixels() > 0;
    pictures.push_back(picture);
    pictures.push_back(exact);
    pictures.push_back(vtk);
    pictures.push_back(has_truth ? signedDifference(picture, exact, gain) : Image());
    pictures.push_back(has_truth && vtk.size.pixels() > 0 ? signedDifference(vtk, exact, gain) : Image());
  }

  void measureUniform(const OpenGrid& grid, const std::filesystem::path& cache, const NamedView& view,
                      nlohmann::json& row, std::vector<Image>& pictures) const {
    const double extinction = 1 / grid.length;
    const OpticalFunction medium = [extinction](double) {
      return OpticalProperties{glm::dvec3(0.0), extinction};
    };
    const Image exact = truth(grid, view, "uniform", medium, true);
    const Image picture = drawn(grid, cache, view, uniformMedium(extinction, grid.field.range()));
    if (settings_.keep_drawn) writeImage(picture, pathOf(grid, view, "uniform_drawn", "pfm"));
    const Image vtk = byVtk(grid, view, "uniform_vtk");
    const Ripple ours = rippleOf(picture, exact);
    row["rms_percent"] = ours.rms_percent;
    row["p98_over_p2"] = ours.p98_over_p2;
    row["outside_percent"] = ours.outside_percent;
    row["inside_psnr_db"] = ours.inside_psnr_db;
    row["uniform_psnr_db"] = ours.psnr_db;
    if (vtk.size.pixels() > 0) {
      const Ripple theirs = rippleOf(vtk, exact);
      row["vtk_inside_psnr_db"] = theirs.inside_psnr_db;
      row["vtk_uniform_psnr_db"] = theirs.psnr_db;
    }
    show(picture, exact, vtk, 5, pictures);
  }

  void measureScalar(const OpenGrid& grid, const std::filesystem::path& cache, const NamedView& view,
                     nlohmann::json& row, std::vector<Image>& pictures) const {
    const auto [low, high] = grid.field.range();
    const KnownFunction function = KnownFunction::of("smooth", low, high, grid.length);
    const Image picture = drawn(grid, cache, view, function.table);
    row["order_255"] = 0.0;
    if (settings_.voxel_pixels == 0) {
      const Image sorted =
          globallySorted(CacheReader(cache), function.table, Backend::kCpu, view.camera, frame());
      row["order_255"] = 255 * compareImages(picture, sorted).largest;
    }
    Image exact, vtk;
    if (!grid.field.ofCells()) {
      exact = truth(grid, view, "scalar", function.exact, false);
      vtk = byVtk(grid, view, "scalar_vtk");
      row["scalar_psnr_db"] = compareImages(picture, exact).psnr_db;
      if (vtk.size.pixels() > 0) row["vtk_scalar_psnr_db"] = compareImages(vtk, exact).psnr_db;
    }
    show(picture, exact, vtk, 10, pictures);
  }

  static std::string number(const nlohmann::json& row, const char* key) {
    return row.contains(key) ? fmt::format("{:.1f}", row[key].get<double>()) : std::string();
  }

  void print(const nlohmann::json& row) const {
    if (rows_.empty())
      fmt::print("{:<15} {:<7} {:>6} {:>7} {:>9} {:>6} {:>7} {:>6} {:>5}   {:>6} {:>7} {:>6}\n", "grid",
                 "view", "rms %", "p98/p2", "outside %", "inside", "uniform", "scalar", "order", "VTK:", "",
                 "");
    fmt::print("{:<15} {:<7} {:6.2f} {:7.3f} {:9.3f} {:>6} {:>7} {:>6} {:5.2f}   {:>6} {:>7} {:>6}\n",
               row["grid"].get<std::string>(), row["view"].get<std::string>(),
               row["rms_percent"].get<double>(), row["p98_over_p2"].get<double>(),
               row["outside_percent"].get<double>(), number(row, "inside_psnr_db"),
               number(row, "uniform_psnr_db"), number(row, "scalar_psnr_db"), row["order_255"].get<double>(),
               number(row, "vtk_inside_psnr_db"), number(row, "vtk_uniform_psnr_db"),
               number(row, "vtk_scalar_psnr_db"));
    std::fflush(stdout);
  }

  static std::string labelOf(const nlohmann::json& row) {
    return fmt::format(
        "{} {}   uniform / truth / vtk / differences x5 / the same of the scalar x10   rms {:.2f} % "
        "p98/p2 {:.3f} outside {:.3f} %   db inside {} uniform {} scalar {}   vtk {} {} {}",
        row["grid"].get<std::string>(), row["view"].get<std::string>(), row["rms_percent"].get<double>(),
        row["p98_over_p2"].get<double>(), row["outside_percent"].get<double>(), number(row, "inside_psnr_db"),
        number(row, "uniform_psnr_db"), number(row, "scalar_psnr_db"), number(row, "vtk_inside_psnr_db"),
        number(row, "vtk_uniform_psnr_db"), number(row, "vtk_scalar_psnr_db"));
  }

  Settings settings_;
  ImageSize size_;
  PictureSheet overview_;
  nlohmann::json rows_ = nlohmann::json::array();
};

int run(int argc, char** argv) {
  CLI::App app("Measure the fidelity of pictures of real grids against rays marched through their cells.");
  Settings settings;
  app.add_option("FOLDER", settings.folder, "Folder for caches, marched pictures (reused) and sheets")
      ->required();
  app.add_option("--data", settings.data, "Folder of real grids (default: only the generated ones)")
      ->check(CLI::ExistingDirectory);
  app.add_option("--only", settings.only, "Regular expression of the grids to measure");
  app.add_option("--views", settings.views, "Regular expression of the views to measure");
  app.add_option("--pixels", settings.pixels, "Width and height of the pictures (default 256)")
      ->check(CLI::Range(16, 2048));
  app.add_option("--rays", settings.rays,
                 "Average the marched pictures of the uniform medium over N x N rays a pixel (default 1)")
      ->check(CLI::Range(1, 16));
  app.add_option(
         "--refine", settings.refine,
         "Convert each grid with its cells cut into N x N x N by their trilinear map, or with 0 by need "
         "(default 1)")
      ->check(CLI::Range(0, 16));
  app.add_option("--lod-pixels", settings.lod_pixels, "Screen error (default 0: the finest level)");
  app.add_option("--voxel-pixels", settings.voxel_pixels,
                 "Merge the finest splats into voxels of this size instead, as coarse levels do; not for "
                 "grids of cells");
  app.add_flag("--keep-drawn", settings.keep_drawn,
               "Keep the pictures of the uniform medium, beside the marched ones");
  app.add_flag("--for-vtk", settings.for_vtk, "Only write what peers/vtk_views.py needs");
  app.add_option("--json", settings.json, "Write the table as JSON to this file");
  CLI11_PARSE(app, argc, argv);
  Measurement measurement(settings);
  bool any = false, all = true;
  for (const RealGrid& grid : realGrids(settings.data)) {
    if (!std::regex_search(grid.name, std::regex(settings.only))) continue;
    any = true;
    try {
      settings.for_vtk ? measurement.leaveJob(grid) : measurement.measure(grid);
    } catch (const Error& error) {
      fmt::print(stderr, "curvisplat_real_grids: {}: {}\n", grid.name, error.what());
      all = false;
    }
  }
  if (!any) throw UsageError("--only {}: no such grid", settings.only);
  if (!settings.for_vtk) measurement.finish();
  return all ? 0 : 1;
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  try {
    return curvisplat::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "curvisplat_real_grids: {}\n", error.what());
    return 1;
  }
}
