// Camera paths, and the cameras on them.
#include "render/camera/camera_path.h"
#include "stream/base/check.h"

#include <cmath>

#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzCameraPath(std::span<const std::byte> bytes) {
  const CameraPath path = CameraPath::fromFile(fuzzFile("path.json", bytes));
  for (int n = -1; n <= 9; ++n) {
    const Camera camera = path.at(path.begin() + n / 8.0 * (path.end() - path.begin()));
    const glm::dmat4 view = camera.viewFromWorld();
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 4; ++row) CURVISPLAT_CHECK(std::isfinite(view[column][row]));
    CURVISPLAT_CHECK(camera.projection == Projection::kPerspective
                         ? camera.view_angle_deg > 0 && camera.view_angle_deg < 180
                         : camera.parallel_scale > 0);
  }
}

const RegisteredFuzzTarget camera_path_target("camera_path", fuzzCameraPath);

}  // namespace
}  // namespace curvisplat
