// Fidelity of pictures of real grids. Every grid is drawn as a uniform medium and with a scalar of its own,
// along the axes, nearly along one, and obliquely, and compared with rays marched through the trilinear map of
// its cells. Prints a table, writes JSON on request, and leaves a sheet of pictures for each grid.
//
//   rms %, p98/p2   uniform medium: ratio of the optical depth to the true one, two pixels and more inside the
//                   outline; its standard deviation over its mean, its 98th percentile over its 2nd. A perfect
//                   picture has 0 and 1
//   outside %       uniform medium: optical depth more than one pixel beyond the outline, of the whole
//   inside          uniform medium: PSNR of the picture, all pixels
//   scalar          PSNR of the grid's scalar with the "smooth" function, all pixels
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <regex>
#include <utility>
#include <vector>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

/// A grid to draw.
struct Case {
  std::string name;
  std::function<std::unique_ptr<GridSource>()> open;
  std::string scalar;  // empty: the uniform medium only
};

struct View {
  std::string name;
  Camera camera;
};

/// +x, +y, +z, a little off +z, and obliquely, each with all of the box in the picture.
std::vector<View> viewsOf(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) {
  std::vector<View> views;
  for (const char* name : {"+x", "+y", "+z"})
    views.push_back({name, Camera::named(name, lower, upper, size, Projection::kOrthographic)});
  const Camera along_z = views.back().camera;
  for (const double degrees : {0.1, 1.0, 3.0}) {
    const double angle = degrees * std::numbers::pi / 180;
    const glm::dvec3 back = along_z.position - along_z.focal_point;
    Camera tilted = along_z;
    tilted.position =
        along_z.focal_point +
        glm::length(back) * glm::normalize(glm::dvec3(std::sin(angle), 0.6 * std::sin(angle), 1));
    tilted.parallel_scale = tilted.parallelScaleFor(lower, upper, size);
    views.push_back({fmt::format("+z {}", degrees), tilted});
  }
  views.push_back({"iso", Camera::named("iso", lower, upper, size, Projection::kOrthographic)});
  return views;
}

/// Black, to be drawn over white: a pixel then shows the transmittance.
TransferFunction uniformMedium(double extinction, std::pair<double, double> range) {
  TransferFunctionDefinition definition;
  definition.name = definition.origin = "uniform medium";
  constexpr double kOpacity = 0.5;
  const auto [low, high] = intervalAround(range.first, range.second);
  definition.colours = {{low, glm::dvec3(0.0)}, {high, glm::dvec3(0.0)}};
  definition.opacities = {{low, kOpacity}, {high, kOpacity}};
  return TransferFunction(std::move(definition), nullptr, -std::log1p(-kOpacity) / extinction);
}

double opticalDepth(double transmittance) {
  return -std::log(std::clamp(transmittance, 1e-12, 1.0));
}

struct Ripple {
  double rms_percent = 0, p98_over_p2 = 1, outside_percent = 0, psnr_db = 0;
};

/// Of two pictures of a uniform medium, black over white.
Ripple rippleOf(const Image& picture, const Image& truth) {
  constexpr double kThin = 0.05;  // of the largest depth: thinner places have no ripple worth a ratio
  constexpr int kMargin = 2;
  const ImageSize size = truth.size;
  std::vector<double> exact(size.pixels()), drawn(size.pixels());
  for (size_t p = 0; p < exact.size(); ++p) {
    exact[p] = opticalDepth(truth.rgba[4 * p]);
    drawn[p] = opticalDepth(picture.rgba[4 * p]);
  }
  const double largest = *std::max_element(exact.begin(), exact.end());
  // The least and the largest of the true depth around a pixel.
  const auto around = [&](int x, int y, int margin) {
    std::pair<double, double> range(std::numeric_limits<double>::infinity(), 0.0);
    for (int v = std::max(0, y - margin); v <= std::min(size.height - 1, y + margin); ++v)
      for (int u = std::max(0, x - margin); u <= std::min(size.width - 1, x + margin); ++u) {
        const double depth =
            exact[static_cast<size_t>(v) * static_cast<size_t>(size.width) + static_cast<size_t>(u)];
        range = {std::min(range.first, depth), std::max(range.second, depth)};
      }
    return range;
  };
  std::vector<double> ratios;
  double outside = 0, sum = 0;
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const size_t p = static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x);
      sum += drawn[p];
      if (around(x, y, 1).second == 0) outside += drawn[p];
      if (around(x, y, kMargin).first > kThin * largest) ratios.push_back(drawn[p] / exact[p]);
    }
  Ripple ripple;
  ripple.psnr_db = compareImages(picture, truth).psnr_db;
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

/// Pictures side by side, row by row, over white.
class Sheet {
 public:
  explicit Sheet(ImageSize tile) : tile_(tile) {}

  void addRow(std::vector<Image> row) { rows_.push_back(std::move(row)); }

  Image image() const {
    size_t columns = 0;
    for (const auto& row : rows_) columns = std::max(columns, row.size());
    Image sheet({static_cast<int>(columns) * (tile_.width + kGap),
                 static_cast<int>(rows_.size()) * (tile_.height + kGap)});
    std::fill(sheet.rgba.begin(), sheet.rgba.end(), 1.0f);
    for (size_t r = 0; r < rows_.size(); ++r)
      for (size_t c = 0; c < rows_[r].size(); ++c)
        for (int y = 0; y < tile_.height; ++y)
          std::copy_n(rows_[r][c].pixel(0, y), 4 * tile_.width,
                      sheet.pixel(static_cast<int>(c) * (tile_.width + kGap),
                                  static_cast<int>(r) * (tile_.height + kGap) + y));
    return sheet;
  }

 private:
  static constexpr int kGap = 4;
  ImageSize tile_;
  std::vector<std::vector<Image>> rows_;
};

Image differenceOf(const Image& a, const Image& b, float gain) {
  Image out(a.size);
  for (size_t n = 0; n < out.rgba.size(); ++n)
    out.rgba[n] = n % 4 == 3 ? 1 : std::min(1.0f, gain * std::abs(a.rgba[n] - b.rgba[n]));
  return out;
}

class Measurement {
 public:
  Measurement(std::filesystem::path folder, int pixels, double lod_pixels)
      : folder_(std::move(folder)), size_{pixels, pixels}, lod_pixels_(lod_pixels) {
    std::filesystem::create_directories(folder_);
  }

  void measure(const Case& grid) {
    const std::unique_ptr<GridSource> source = grid.open();
    const uint32_t scalar =
        grid.scalar.empty() ? 0 : scalarsNamed(source->description(), {grid.scalar}).front();
    const GridField field(*source, scalar);
    const std::filesystem::path cache = folder_ / (grid.name + ".splats");
    convertGrid(*source, cache, scalar);

    const auto [lower, upper] = field.bounds();
    const double length = glm::length(upper - lower) / 3;  // as the half-annulus, whose diagonal is 2.6
    Sheet sheet(size_);
    for (const View& view : viewsOf(lower, upper, size_)) {
      std::vector<Image> row;
      const Ripple ripple = measureUniform(field, cache, grid, view, length, row);
      const double psnr_db = grid.scalar.empty() ? 0.0 : measureScalar(field, cache, grid, view, length, row);
      sheet.addRow(std::move(row));
      if (rows_.empty())
        fmt::print("{:<18} {:<7} {:>7} {:>7} {:>9} {:>8} {:>8}\n", "grid", "view", "rms %", "p98/p2",
                   "outside %", "inside", "scalar");
      fmt::print("{:<18} {:<7} {:7.2f} {:7.3f} {:9.3f} {:8.1f} {:>8}\n", grid.name, view.name,
                 ripple.rms_percent, ripple.p98_over_p2, ripple.outside_percent, ripple.psnr_db,
                 grid.scalar.empty() ? "" : fmt::format("{:.1f}", psnr_db));
      std::fflush(stdout);
      nlohmann::json out = {{"grid", grid.name},
                            {"view", view.name},
                            {"lod_pixels", lod_pixels_},
                            {"rms_percent", ripple.rms_percent},
                            {"p98_over_p2", ripple.p98_over_p2},
                            {"outside_percent", ripple.outside_percent},
                            {"uniform_psnr_db", ripple.psnr_db}};
      if (!grid.scalar.empty()) out["scalar_psnr_db"] = psnr_db;
      rows_.push_back(std::move(out));
    }
    writeImage(sheet.image(), folder_ / (grid.name + "_sheet.png"));
  }

  nlohmann::json rows() const { return rows_; }

 private:
  /// The marched picture. Marched once, and kept in the folder.
  Image truth(const GridField& field, const std::string& name, const OpticalFunction& function,
              const Camera& camera, double length, double agreement_db) const {
    const auto path = folder_ / fmt::format("{}_{}.pfm", name, size_.width);
    if (!std::filesystem::exists(path)) {
      MarchSteps steps;
      steps.step = 0.016 * length;
      steps.cells = 1;
      writeImage(toImage(convergedMarch(field, function, camera, size_, steps, agreement_db)), path);
    }
    return readImage(path);
  }

  Image drawn(const std::filesystem::path& cache, const TransferFunction& function,
              const Camera& camera) const {
    FrameOptions options = knownFrame(size_);
    options.lod_pixels = lod_pixels_;
    return drawCache(cache, function, camera, options);
  }

  static std::string fileName(const Case& grid, const View& view, const char* what) {
    std::string name = fmt::format("{}_{}_{}", grid.name, view.name, what);
    std::replace(name.begin(), name.end(), ' ', '_');
    return name;
  }

  Ripple measureUniform(const GridField& field, const std::filesystem::path& cache, const Case& grid,
                        const View& view, double length, std::vector<Image>& row) const {
    const double extinction = 1 / length;
    const OpticalFunction medium = [extinction](double) {
      return OpticalProperties{glm::dvec3(0.0), extinction};
    };
    Image exact = truth(field, fileName(grid, view, "uniform"), medium, view.camera, length, 60);
    Image picture = drawn(cache, uniformMedium(extinction, field.range()), view.camera);
    const Ripple ripple = rippleOf(picture, exact);
    Image difference = differenceOf(picture, exact, 5);
    row.push_back(std::move(picture));
    row.push_back(std::move(exact));
    row.push_back(std::move(difference));
    return ripple;
  }

  double measureScalar(const GridField& field, const std::filesystem::path& cache, const Case& grid,
                       const View& view, double length, std::vector<Image>& row) const {
    const auto [low, high] = field.range();
    const KnownFunction function = KnownFunction::of("smooth", low, high, length);
    Image exact = truth(field, fileName(grid, view, "scalar"), function.exact, view.camera, length, 60);
    Image picture = drawn(cache, function.table, view.camera);
    const double psnr_db = compareImages(picture, exact).psnr_db;
    Image difference = differenceOf(picture, exact, 10);
    row.push_back(std::move(picture));
    row.push_back(std::move(exact));
    row.push_back(std::move(difference));
    return psnr_db;
  }

  std::filesystem::path folder_;
  ImageSize size_;
  double lod_pixels_;
  nlohmann::json rows_ = nlohmann::json::array();
};

/// n x n x n nodes of the unit cube.
std::unique_ptr<GridSource> uniformCube(uint64_t n) {
  return std::make_unique<FunctionGridSource>(std::vector{gridBlock(n, n, n)}, 1, [n](const GridNode& node) {
    const double last = static_cast<double>(n - 1);
    const glm::dvec3 at(static_cast<double>(node.i) / last, static_cast<double>(node.j) / last,
                        static_cast<double>(node.k) / last);
    return NodeValues{at, {static_cast<float>(at.z)}};
  });
}

std::vector<Case> allCases() {
  std::vector<Case> cases;
  cases.push_back({"cube", [] { return uniformCube(101); }, "s0"});
  const auto scene = [&](const std::string& name, SceneGridSize size) {
    cases.push_back({name,
                     [name, size]() -> std::unique_ptr<GridSource> {
                       return std::make_unique<SceneGridSource>(makeScenes(name), size, 4);
                     },
                     "f"});
  };
  scene("spectral", {49, 43, 37});
  scene("dome", {41, 25, 21});
  scene("globe", {33, 33, 6});
  scene("duct", {21, 17, 17});
  const std::filesystem::path data = CURVISPLAT_SHARED_DATA;
  const auto add = [&](const std::string& name, const std::string& grid, const std::string& solution,
                       const std::string& scalar) {
    if (!std::filesystem::exists(data / grid)) return;
    cases.push_back({name,
                     [grid = data / grid,
                      solution = solution.empty() ? std::filesystem::path() : data / solution, scalar] {
                       OpenGridOptions options;
                       options.grid = grid;
                       if (!solution.empty()) options.solutions = {solution};
                       if (!scalar.empty()) options.scalars = {scalar};
                       return openGrid(options);
                     },
                     scalar});
  };
  add("bluntfin", "bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin", "density");
  add("combustor", "combustor/combxyz.bin", "combustor/combq.bin", "density");
  add("lox_post", "lox_post/postxyz.bin", "lox_post/postq.bin", "density");
  add("nek", "nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun", "4");
  add("delta_wing", "delta_wing/delta_vertex.cgns", "", "Density");
  add("nemo_northsea", "nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun", "1");
  return cases;
}

int run(int argc, char** argv) {
  CLI::App app("How true pictures of real grids are, against rays marched through their cells.");
  std::string folder, only = ".*", json;
  int pixels = 256;
  double lod_pixels = 0;
  app.add_option("FOLDER", folder, "Caches, marched pictures (kept and used again) and sheets")->required();
  app.add_option("--only", only, "Grids to measure: a regular expression");
  app.add_option("--pixels", pixels, "Width and height of the pictures (default 256)")
      ->check(CLI::Range(16, 2048));
  app.add_option("--lod-pixels", lod_pixels, "Screen error allowed (default 0: the finest level)");
  app.add_option("--json", json, "Write the table to this file as well");
  CLI11_PARSE(app, argc, argv);
  Measurement measurement(folder, pixels, lod_pixels);
  for (const Case& grid : allCases())
    if (std::regex_search(grid.name, std::regex(only))) measurement.measure(grid);
  if (!json.empty()) writeFileAtomically(json, measurement.rows().dump(1) + "\n");
  return 0;
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
