// Maps of the Earth: the colour of a place, in the image and in pictures of the globe.
#include "render/surface/map_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>

#include "render/project/screen_view.h"
#include "render/surface/scene_layers.h"

namespace curvisplat {
namespace {

constexpr double kRadius = 6371;

/// Red grows eastwards by one at each of 256 columns, green southwards by two at each of 128 rows.
Image gradient() {
  Image image({256, 128});
  for (int y = 0; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x) {
      float* const pixel = image.pixel(x, y);
      pixel[0] = static_cast<float>(x) / 255;
      pixel[1] = static_cast<float>(2 * y) / 255;
      pixel[2] = 0.2f;
      pixel[3] = 1;
    }
  return image;
}

/// The image's colour in closed form, away from its edges.
glm::vec3 colourAt(double longitude, double latitude) {
  return {((longitude + 180) / 360 * 256 - 0.5) / 255, ((90 - latitude) / 180 * 128 - 0.5) * 2 / 255, 0.2};
}

void expectColourNear(const glm::vec3& found, const glm::vec3& expected, float tolerance) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], tolerance) << "channel " << c;
}

TEST(MapImage, HasTheColourOfAPlace) {
  const MapImage map(gradient());
  for (const double longitude : {-170.0, -3.3, 0.0, 88.0, 175.0})
    for (const double latitude : {-80.0, 0.0, 51.25}) {
      expectColourNear(map.at(longitude, latitude, 0.1), colourAt(longitude, latitude), 0.003f);
      expectColourNear(map.at(longitude + 360, latitude, 0), colourAt(longitude, latitude), 0.003f);
    }
  // At the poles it is that of the last rows; the date line lies between the last and the first column.
  expectColourNear(map.at(0, 90, 0), {127.5 / 255, 0, 0.2}, 0.003f);
  expectColourNear(map.at(0, -90, 0), {127.5 / 255, 254.0 / 255, 0.2}, 0.003f);
  expectColourNear(map.at(180, 0, 0), {127.5 / 255, 127.0 / 255, 0.2}, 0.003f);
}

TEST(MapImage, AWidePixelSeesTheMean) {
  Image stripes({64, 32});
  for (int n = 0; n < 64 * 32; ++n) {
    stripes.rgba[4 * n] = n % 2 == 0 ? 1.0f : 0.0f;
    stripes.rgba[4 * n + 3] = 1;
  }
  const MapImage map(stripes);
  const double pixel = 360.0 / 64, middle_of_first = -180 + pixel / 2;
  EXPECT_NEAR(map.at(middle_of_first, 0, pixel).x, 1, 1e-6);
  EXPECT_NEAR(map.at(middle_of_first + pixel, 0, pixel).x, 0, 1e-6);
  EXPECT_NEAR(map.at(middle_of_first, 0, 2 * pixel).x, 0.5, 0.01);
  EXPECT_NEAR(map.at(middle_of_first, 0, 360).x, 0.5, 0.01);
  stripes.rgba.assign(stripes.rgba.size(), 0);
  EXPECT_EQ(MapImage(stripes).at(10, 20, 1), glm::vec3(1));  // transparent
}

/// The globe from above a place, unlit; each pixel against a ray that meets the sphere in closed form.
void expectGlobe(Projection projection, const Globe& globe) {
  SurfaceScene scene;
  Surface& surface = scene.surfaces.emplace_back();
  surface.mesh = std::make_shared<TriangleMesh>(meshOfGlobe(globe, -5));
  surface.map = std::make_shared<PlacedMap>(PlacedMap{MapImage(gradient()), globe});
  Camera camera;
  const glm::dvec3 above = globe.column(30, 40), ground = globe.place(above, 0);
  camera.projection = projection;
  camera.focal_point = ground;
  camera.position = ground + 9000.0 * (globe.sphere() ? above : glm::dvec3(0, 0, 1));
  camera.view_up = globe.sphere() ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
  camera.parallel_scale = 5000;
  camera.view_angle_deg = 40;
  const ScreenView view = ScreenView::of(camera, {90, 60}, glm::dvec3(1.0), kLowPass, 1e-3);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const PixelLayers layers = layersOf(scene, view, {}, {colours, {}, {}, 0});
  const double radius = kRadius - 5 * globe.vertical_scale;
  int seen = 0;
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 90; ++x) {
      const auto found = layers.at(x, y);
      const glm::dvec3 aside =
          (x + 0.5 - 45) / view.focal_px * view.right + (y + 0.5 - 30) / view.focal_px * view.down;
      const bool perspective = projection == Projection::kPerspective;
      const glm::dvec3 from = perspective ? view.eye : view.eye + aside;
      const glm::dvec3 way = glm::normalize(perspective ? view.forward + aside : view.forward);
      const double along = -glm::dot(from, way), beside2 = glm::dot(from, from) - along * along;
      if (globe.sphere() && beside2 > 0.8 * radius * radius) continue;  // an outline
      const double distance = globe.sphere() ? along - std::sqrt(radius * radius - beside2)
                                             : (globe.place({}, -5).z - from.z) / way.z;
      const glm::dvec3 place = globe.geographic(from + distance * way);
      if (std::abs(place.x) > 170 || std::abs(place.y) > 75) continue;
      ASSERT_EQ(found.size(), 1U) << x << " " << y;
      EXPECT_EQ(found[0].colour.w, 1);
      expectColourNear(glm::vec3(found[0].colour), colourAt(place.x, place.y), 0.006f);
      ++seen;
    }
  EXPECT_GT(seen, 2000);
}

/// A pixel of the picture sees as many of the map's, however heights are stretched.
TEST(MapImage, IsAsSmoothUnderAScaleOfHeights) {
  Image stripes({256, 128});
  for (size_t n = 0; n < stripes.size.pixels(); ++n) {
    stripes.rgba[4 * n] = n % 2 == 0 ? 1.0f : 0.0f;
    stripes.rgba[4 * n + 3] = 1;
  }
  const Globe flat{Globe::Shape::kFlat, kRadius, 1, 0};
  SurfaceScene scene;
  Surface& surface = scene.surfaces.emplace_back();
  surface.mesh = std::make_shared<TriangleMesh>(meshOfGlobe(flat, 0));
  surface.map = std::make_shared<PlacedMap>(PlacedMap{MapImage(stripes), flat});
  Camera camera;
  camera.projection = Projection::kOrthographic;
  camera.position = {0, 0, 9000};
  camera.view_up = {0, 1, 0};
  camera.parallel_scale = 9000;
  const ScreenView view = ScreenView::of(camera, {60, 40}, glm::dvec3(1, 1, 100), kLowPass, 1e-3);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const PixelLayers layers = layersOf(scene, view, {}, {colours, {}, {}, 0});
  for (int x = 0; x < 60; ++x) {
    ASSERT_EQ(layers.at(x, 20).size(), 1U);
    EXPECT_NEAR(layers.at(x, 20)[0].colour.x, 0.5, 0.1) << x;
  }
}

TEST(MapImage, TheGlobeShowsItWhereItsPlacesAre) {
  const Globe sphere{Globe::Shape::kSphere, kRadius, 20, 0}, flat{Globe::Shape::kFlat, kRadius, 20, 5.3};
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective})
    for (const Globe& globe : {sphere, flat}) expectGlobe(projection, globe);
}

}  // namespace
}  // namespace curvisplat
