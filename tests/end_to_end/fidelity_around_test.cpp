// Clip planes and light for every function and level: the rows of the table of fidelity that go beyond
// fidelity_corrections_test's, each of which the picture without its correction misses.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>

#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{256, 256};
// Across the half-annulus, obliquely.
const ClipPlane kPlane{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}};

struct Row {
  const char* function;
  std::array<double, 3> least_db;  // finest, 4 pixels, 8 pixels
};

class AroundTheVolume : public testing::Test {
 protected:
  Image marched(const ReferenceField& field, const KnownFunction& function,
                const ReferenceLight* light) const {
    MarchSteps steps;
    steps.step = 0.008;
    return toImage(referenceMarch(field, function.exact, camera_, kSize, steps, {light}));
  }
  static DirectOptions atLevel(size_t level) {
    DirectOptions options;
    options.voxel = std::array{0.0, 4.0, 8.0}[level] * 2 * halfAnnulusCamera().parallel_scale / kSize.height;
    return options;
  }
  double db(const DirectOptions& options, const KnownFunction& function, const Image& reference) const {
    return compareImages(drawDirectly(source_, 0, options, function.table, camera_, kSize), reference)
        .psnr_db;
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
  const SceneGridSource source_{annulus_, {128, 64, 64}, 4};
  const Camera camera_ = halfAnnulusCamera();
};

TEST_F(AroundTheVolume, APlaneCutsTheSplats) {
  const ClippedField clipped(field_, {kPlane});
  for (const auto& [name, least_db] :
       {Row{"smooth", {71, 58, 50.5}}, Row{"band", {60, 51.5, 42.5}}, Row{"step", {59.5, 49, 38.5}}}) {
    const KnownFunction function = KnownFunction::of(name);
    const Image reference = marched(clipped, function, nullptr);
    for (size_t level = 0; level < 3; ++level) {
      DirectOptions options = atLevel(level);
      options.clip_planes = {kPlane};
      const double cut = db(options, function, reference);
      options.cut_splats = false;
      const double by_centre = db(options, function, reference);
      fmt::print("clip plane, {}, level {}: {:.1f} dB, by centres {:.1f} dB\n", name, level, cut, by_centre);
      EXPECT_GE(cut, least_db[level]) << name << ", level " << level;
      EXPECT_LT(by_centre, least_db[level]) << name << ", level " << level;
    }
  }
}

TEST_F(AroundTheVolume, LightIsFromEachSplatsGradient) {
  const ReferenceLight truth;
  for (const auto& [name, least_db] :
       {Row{"smooth", {66, 54, 47}}, Row{"band", {65, 52, 40.5}}, Row{"step", {54, 43.5, 33}}}) {
    const KnownFunction function = KnownFunction::of(name);
    const Image reference = marched(field_, function, &truth);
    for (size_t level = 0; level < 3; ++level) {
      DirectOptions options = atLevel(level);
      const double unlit = db(options, function, reference);
      options.light = Light{};
      const double lit = db(options, function, reference);
      fmt::print("light, {}, level {}: {:.1f} dB, unlit {:.1f} dB\n", name, level, lit, unlit);
      EXPECT_GE(lit, least_db[level]) << name << ", level " << level;
      EXPECT_LT(unlit, least_db[level]) << name << ", level " << level;
    }
  }
}

}  // namespace
}  // namespace curvisplat
