// Values where pixels have half of their opacity: against rays through the scene, for the volume, an
// isosurface and a plane in it; with any threads; and the channels of .exr files.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

constexpr ImageSize kChannelPicture{128, 128};

struct At {
  double depth = 0, scalar = 0;
  glm::dvec3 normal{0.0};
};

class ValueChannelsTest : public ProgramSuite<ValueChannelsTest> {
 protected:
  static void prepare() {
    convertGrid(SceneGridSource(makeScene("half-annulus"), {128, 64, 64}), *folder_ / "a.splats");
  }

  PixelValues drawn(const TransferFunction& function, const FrameOptions& options, const Camera& camera,
                    Image* picture = nullptr) const {
    const CacheReader cache(*folder_ / "a.splats");
    FrameRenderer renderer(cache, 0, function, Backend::kCpu);
    FrameStatistics statistics;
    PixelValues values;
    const Image image = renderer.renderWithValues(camera, options, statistics, values);
    if (picture) *picture = image;
    return values;
  }

  glm::dvec3 gradientAt(const glm::dvec3& at) const {
    glm::dvec3 gradient;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 step(0.0);
      step[axis] = 1e-5;
      gradient[axis] = annulus_->scalar(at + step) - annulus_->scalar(at - step);
    }
    return glm::normalize(gradient);
  }

  /// The ray of a pixel: origin and direction; depths count from the origin.
  static std::pair<glm::dvec3, glm::dvec3> rayOf(const Camera& camera, int x, int y) {
    const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
    const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.view_up)),
                     up = glm::cross(right, forward);
    const double across = (2 * (x + 0.5) - kChannelPicture.width) / kChannelPicture.height;
    const double upwards = (kChannelPicture.height - 2 * (y + 0.5)) / kChannelPicture.height;
    if (camera.projection == Projection::kOrthographic)
      return {camera.position + camera.parallel_scale * (across * right + upwards * up), forward};
    const double half = std::tan(0.5 * camera.view_angle_deg * std::numbers::pi / 180);
    return {camera.position, glm::normalize(forward + half * (across * right + upwards * up))};
  }

  /// The point at which the ray has half of its opacity; `kappa` at a point.
  std::optional<At> halfAlong(const std::function<double(const glm::dvec3&)>& kappa, const glm::dvec3& origin,
                              const glm::dvec3& direction) const {
    constexpr double kStep = 0.002;
    std::vector<double> depths{0};
    for (double t = 0; t < 10; t += kStep) {
      const glm::dvec3 at = origin + (t + 0.5 * kStep) * direction;
      depths.push_back(depths.back() + (annulus_->contains(at) ? kStep * kappa(at) : 0));
    }
    const double opacity = -std::expm1(-depths.back());
    if (opacity < 0.05) return std::nullopt;
    const double wanted = -std::log(1 - 0.5 * opacity);
    const auto found = std::lower_bound(depths.begin(), depths.end(), wanted);
    const double t = kStep * (static_cast<double>(found - depths.begin()) - 0.5);
    const glm::dvec3 at = origin + t * direction;
    return At{t, annulus_->scalar(at), gradientAt(at)};
  }

  /// Median errors: depth, scalar, and the normal's angle in degrees.
  std::array<double, 3> errors(const PixelValues& values, const Camera& camera,
                               const std::function<double(const glm::dvec3&)>& kappa) const {
    std::array<std::vector<double>, 3> all;
    for (int y = 4; y < kChannelPicture.height; y += 8)
      for (int x = 4; x < kChannelPicture.width; x += 8) {
        const auto [origin, direction] = rayOf(camera, x, y);
        const auto exact = halfAlong(kappa, origin, direction);
        const size_t n = static_cast<size_t>(y * kChannelPicture.width + x);
        if (!exact || !std::isfinite(values.depth[n])) continue;
        all[0].push_back(std::abs(values.depth[n] - exact->depth));
        all[1].push_back(std::abs(values.scalar[n] - exact->scalar));
        const double cosine = std::abs(glm::dot(glm::dvec3(values.normal[n]), exact->normal));
        all[2].push_back(std::acos(std::min(cosine, 1.0)) * 180 / std::numbers::pi);
        EXPECT_LE(glm::dot(glm::dvec3(values.normal[n]), direction), 0.3);
      }
    std::array<double, 3> medians{};
    for (size_t of = 0; of < 3; ++of) {
      EXPECT_GT(all[of].size(), 20u);
      if (all[of].empty()) continue;
      std::nth_element(all[of].begin(), all[of].begin() + static_cast<std::ptrdiff_t>(all[of].size() / 2),
                       all[of].end());
      medians[of] = all[of][all[of].size() / 2];
    }
    return medians;
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
};

TEST_F(ValueChannelsTest, AreThoseOfTheRaysInTheVolume) {
  for (const std::string name : {"smooth", "step"})
    for (const Camera& camera : {halfAnnulusCamera(), perspectiveCamera()}) {
      const bool is_step = name == "step", is_perspective = camera.projection == Projection::kPerspective;
      if (is_step != is_perspective && !faults::isWholeSweep()) continue;
      const KnownFunction function = KnownFunction::of(name);
      const auto kappa = [&](const glm::dvec3& at) {
        return function.exact(annulus_->scalar(at)).extinction;
      };
      FrameOptions options = knownFrame(kChannelPicture);
      const auto [depth, scalar, angle] = errors(drawn(function.table, options, camera), camera, kappa);
      fmt::print("{}: depth {:.4f}, scalar {:.4f}, normal {:.2f} degrees\n", name, depth, scalar, angle);
      EXPECT_LT(depth, 0.012);
      EXPECT_LT(scalar, 0.012);
      EXPECT_LT(angle, 3);
    }
}

TEST_F(ValueChannelsTest, AreThoseOfAnIsosurface) {
  FrameOptions options = knownFrame(kChannelPicture);
  auto scene = std::make_shared<SurfaceScene>();
  scene->isovalues = {0.5};
  options.scene = scene;
  const TransferFunction function = KnownFunction::of("smooth").table;
  for (const bool volume : {false, true}) {
    scene->volume = volume;
    const PixelValues values = drawn(function, options, halfAnnulusCamera());
    size_t near = 0, seen = 0;
    for (const float scalar : values.scalar) {
      if (std::isnan(scalar)) continue;
      ++seen;
      near += std::abs(scalar - 0.5f) < 0.03f;
    }
    fmt::print("isosurface{}: {} of {} pixels have its value\n", volume ? " in the volume" : "", near, seen);
    EXPECT_GT(seen, 1000u);
    EXPECT_GT(static_cast<double>(near), (volume ? 0.2 : 0.8) * static_cast<double>(seen));
  }
}

TEST_F(ValueChannelsTest, AreThoseOfASurfaceInFrontOfTheHalf) {
  // A plane alone: its depth and its normal everywhere.
  const glm::dvec3 point(-0.4, 0, 0.5), n = glm::normalize(glm::dvec3(0.6, 0.5, -0.7));
  const glm::dvec3 u = 8.0 * glm::normalize(glm::cross(n, {0.3, 0.4, 0.8})), v = glm::cross(n, u);
  auto scene = std::make_shared<SurfaceScene>();
  RawMesh raw{{point - u - v, point + u - v, point + u + v, point - u + v}, {{0, 1, 2}, {0, 2, 3}}};
  scene->surfaces.push_back({std::make_shared<TriangleMesh>(meshOf(std::move(raw))), glm::vec3(0.5f)});
  scene->volume = false;
  FrameOptions options = knownFrame(kChannelPicture);
  options.scene = scene;
  const Camera camera = perspectiveCamera();
  const PixelValues values = drawn(KnownFunction::of("smooth").table, options, camera);
  for (int y = 4; y < kChannelPicture.height; y += 8)
    for (int x = 4; x < kChannelPicture.width; x += 8) {
      const auto [origin, direction] = rayOf(camera, x, y);
      const double t = glm::dot(n, point - origin) / glm::dot(n, direction);
      const size_t at = static_cast<size_t>(y * kChannelPicture.width + x);
      if (t < 0) continue;
      EXPECT_NEAR(values.depth[at], t, 1e-3 * t) << x << ' ' << y;
      EXPECT_GT(std::abs(glm::dot(glm::dvec3(values.normal[at]), n)), 0.999) << x << ' ' << y;
      EXPECT_TRUE(std::isnan(values.scalar[at]));
    }
}

TEST_F(ValueChannelsTest, ThePictureAndTheValuesDoNotDependOnThreads) {
  const TransferFunction function = KnownFunction::of("smooth").table;
  FrameOptions options = knownFrame(kChannelPicture);
  Image picture;
  const PixelValues values = drawn(function, options, halfAnnulusCamera(), &picture);
  const Image plain = drawCache(*folder_ / "a.splats", function, halfAnnulusCamera(), options);
  EXPECT_GT(compareImages(picture, plain).psnr_db, 120);
  options.threads = 1;
  options.memory_bytes = uint64_t{128} << 20;
  EXPECT_EQ(drawn(function, options, halfAnnulusCamera()).depth, values.depth);
}

TEST_F(ValueChannelsTest, TheProgramWritesThem) {
  const std::string output = file("a.exr");
  const auto render = [&](const Words& more) {
    return Words{"render", file("a.splats"), "-o", output, "--size", "150x100", "--view", "iso"} + more;
  };
  const auto names = [&] {
    Words found;
    for (const ImageChannel& channel : readChannels(output)) {
      found.push_back(channel.name);
      EXPECT_EQ(channel.values.size(), 15000u);
    }
    return found;
  };
  run(render({}));
  EXPECT_EQ(names(), Words{"Z"});
  run(render({"--channels", "normal,scalar", "--scalar-bar"}));
  EXPECT_EQ(names(), (Words{"N.X", "N.Y", "N.Z", "scalar"}));
  run(render({"--channels", "none"}));
  EXPECT_TRUE(names().empty());
  const struct {
    Words options;
    std::string words;
  } refused[] = {
      {{"--channels", "alpha"}, "--channels alpha: unknown channel 'alpha'; expected none, or some of"},
      {{"--channels", "depth", "--first-image", file("b.exr")}, "leave out --channels"}};
  for (const auto& [options, words] : refused) {
    const ProgramResult result = runProgram(render(options));
    EXPECT_EQ(result.status, 2) << result.err;
    expectSays(result.err, words);
  }
  const ProgramResult of_png =
      runProgram({"render", file("a.splats"), "-o", file("a.png"), "--channels", "depth"});
  EXPECT_EQ(of_png.status, 2);
  expectSays(of_png.err, "only .exr files have channels");
}

}  // namespace
}  // namespace curvisplat
