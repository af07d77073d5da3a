#include "tests/reference/half_annulus_arguments.h"

#include <fmt/format.h>

#include "tests/reference/reference_march.h"

namespace curvisplat {

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
