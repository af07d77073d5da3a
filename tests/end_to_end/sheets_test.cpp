// Translucent surfaces, and slices whose opacity is the transfer function's, against the ray march of the same.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numeric>

#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{160, 160};
const glm::vec3 kGrey{0.6f, 0.7f, 0.8f};
// Across the half-annulus, obliquely; one behind the other.
const glm::dvec3 kNormal{0.6, 0.5, -0.7};
const glm::dvec3 kPoints[] = {{-0.4, 0, 0.5}, {-0.55, -0.1, 0.7}, {-0.3, 0.1, 0.3}};

/// Squares that are larger than the picture, in one mesh.
std::shared_ptr<SurfaceScene> squares(float opacity) {
  RawMesh raw;
  const glm::dvec3 n = glm::normalize(kNormal), u = 8.0 * glm::normalize(glm::cross(n, {0.3, 0.4, 0.8})),
                   v = glm::cross(n, u);
  for (const glm::dvec3& p : kPoints) {
    const auto first = static_cast<uint32_t>(raw.positions.size());
    raw.positions.insert(raw.positions.end(), {p - u - v, p + u - v, p + u + v, p - u + v});
    raw.triangles.insert(raw.triangles.end(), {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  }
  auto scene = std::make_shared<SurfaceScene>();
  Surface& surface = scene->surfaces.emplace_back();
  surface.mesh = std::make_shared<TriangleMesh>(meshOf(std::move(raw)));
  surface.colour = kGrey;
  surface.opacity.factor = double{opacity};
  return scene;
}

class Sheets : public testing::Test {
 protected:
  Image marched(const KnownFunction& function, const ReferenceLayers& layers) const {
    MarchSteps steps;
    steps.step = 0.008;
    return toImage(referenceMarch(field_, function.exact, camera_, kSize, steps, {nullptr, layers}));
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
  const SceneGridSource source_{annulus_, {64, 32, 32}, 4};
  const Camera camera_ = halfAnnulusCamera();
};

TEST_F(Sheets, WhatLiesBehindATranslucentSurfaceIsSeenThroughIt) {
  const KnownFunction function = KnownFunction::of("smooth");
  for (const float opacity : {0.4f, 1.0f}) {
    const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
      std::vector<ReferenceLayer> found;
      const double facing = std::abs(glm::dot(glm::normalize(kNormal), direction));
      const glm::dvec3 lit =
          glm::min((0.3 + 0.7 * facing) * glm::dvec3(kGrey) + glm::dvec3(0.25 * std::pow(facing, 32)),
                   glm::dvec3(1.0));
      for (const glm::dvec3& p : kPoints)
        found.push_back({glm::dot(kNormal, p - origin) / glm::dot(kNormal, direction), lit, double{opacity}});
      std::sort(found.begin(), found.end(),
                [](const auto& a, const auto& b) { return a.distance < b.distance; });
      return found;
    };
    DirectOptions options;
    options.scene = squares(opacity);
    const double db = compareImages(drawDirectly(source_, 0, options, function.table, camera_, kSize),
                                    marched(function, layers))
                          .psnr_db;
    fmt::print("three squares of opacity {}: {:.1f} dB\n", opacity, db);
    EXPECT_GE(db, 60);
  }
}

TEST_F(Sheets, ASliceHasTheOpacityOfTheFunction) {
  for (const char* name : {"smooth", "band"}) {
    const KnownFunction function = KnownFunction::of(name);
    const double unit = function.table.opacityUnit();
    const glm::dvec3 p = kPoints[0];
    const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
      const double distance = glm::dot(kNormal, p - origin) / glm::dot(kNormal, direction);
      const glm::dvec3 at = origin + distance * direction;
      std::vector<ReferenceLayer> found;
      if (!annulus_->contains(at)) return found;
      const OpticalProperties value = function.exact(annulus_->scalar(at));
      found.push_back({distance, value.colour, 0.8 * -std::expm1(-value.extinction * unit)});
      return found;
    };
    const Image reference = marched(function, layers);
    DirectOptions options;
    auto scene = std::make_shared<SurfaceScene>();
    scene->slices = {{p, kNormal}};
    scene->slice_opacity = 0.8;
    options.scene = scene;
    const auto db = [&] {
      return compareImages(drawDirectly(source_, 0, options, function.table, camera_, kSize), reference)
          .psnr_db;
    };
    const double even = db();
    scene->slices_by_function = true;
    const double by_function = db();
    fmt::print("slice with the opacity of {}: {:.1f} dB, evenly {:.1f} dB\n", name, by_function, even);
    EXPECT_GE(by_function, 46) << name;  // outlines of the slice are smooth here
    EXPECT_LT(even, 40) << name;
  }
}

}  // namespace
}  // namespace curvisplat
