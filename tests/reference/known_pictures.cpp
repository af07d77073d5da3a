#include "tests/reference/known_pictures.h"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <tuple>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/reference_march.h"

namespace curvisplat {

KnownFunction KnownFunction::of(const std::string& name, double low, double high, double length) {
  constexpr double kUnit = 0.01;  // of the files' opacities
  const std::pair<double, double> range(low, high);
  const auto plain = name == "smooth" ? smoothFunction : name == "band" ? bandFunction : stepFunction;
  return {[plain, low, high, length](double scalar) {
            OpticalProperties properties = plain((scalar - low) / (high - low));
            properties.extinction /= length;
            return properties;
          },
          TransferFunction::fromFile(fmt::format("{}/half_annulus_{}.json", CURVISPLAT_TEST_DATA, name),
                                     &range, kUnit * length, kUnit * length)};
}

Camera edgeOnCamera() {
  Camera camera = halfAnnulusCamera();
  camera.position = camera.focal_point - 4.0 * glm::normalize(glm::dvec3(0.001, 0, -1));
  camera.view_up = {0, 1, 0};
  return camera;
}

Camera perspectiveCamera(double view_angle_deg) {
  Camera camera = halfAnnulusCamera();
  const double half = 0.5 * view_angle_deg * std::numbers::pi / 180;
  const glm::dvec3 back = glm::normalize(camera.position - camera.focal_point);
  camera.position = camera.focal_point + camera.parallel_scale / std::tan(half) * back;
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = view_angle_deg;
  return camera;
}

const Image& knownReference(const std::string& function, ImageSize size) {
  static std::mutex mutex;
  static std::map<std::tuple<std::string, int, int>, Image> marched;
  const std::lock_guard lock(mutex);
  const auto [entry, is_new] = marched.try_emplace({function, size.width, size.height});
  if (is_new)
    entry->second = toImage(referenceMarch(*makeScene("half-annulus"), KnownFunction::of(function).exact,
                                           halfAnnulusCamera(), size));
  return entry->second;
}

void convertGrid(const GridSource& source, const std::filesystem::path& cache, uint32_t scalar) {
  ConvertOptions options;
  options.output = cache;
  options.overwrite = true;
  options.scalars = {scalar};
  options.memory_bytes = uint64_t{1} << 30;
  Progress progress;
  convert(source, options, progress);
}

FrameOptions knownFrame(ImageSize size) {
  FrameOptions options;
  options.size = size;
  options.lod_pixels = 0;
  return options;
}

Image drawCache(const std::filesystem::path& cache, const TransferFunction& function, const Camera& camera,
                const FrameOptions& options, uint64_t* splats, Backend backend) {
  const CacheReader reader(cache);
  FrameRenderer renderer(reader, 0, function, backend);
  FrameStatistics statistics;
  Image image = renderer.render(camera, options, statistics);
  if (splats) *splats = statistics.splats_drawn;
  return image;
}

std::vector<std::string> halfAnnulusWords(const std::string& cache, const std::string& output,
                                          const std::string& function, ImageSize size,
                                          const std::string& lod_pixels) {
  const Camera camera = halfAnnulusCamera();
  const auto words = [](const glm::dvec3& v) { return fmt::format("{},{},{}", v.x, v.y, v.z); };
  return {"render",
          cache,
          "-o",
          output,
          "--size",
          fmt::format("{}x{}", size.width, size.height),
          "--tf",
          fmt::format("{}/half_annulus_{}.json", CURVISPLAT_TEST_DATA, function),
          "--position",
          words(camera.position),
          "--focal-point",
          words(camera.focal_point),
          "--view-up",
          words(camera.view_up),
          "--parallel-scale",
          fmt::format("{}", camera.parallel_scale),
          "--background",
          "white",
          "--lod-pixels",
          lod_pixels,
          "--classify",
          "pixel"};
}

}  // namespace curvisplat
