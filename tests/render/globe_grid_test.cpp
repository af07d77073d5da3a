// The axes grid of data on a globe: lines and coordinates where its longitudes and latitudes are.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render/annotate/annotations.h"
#include "render/camera/camera.h"
#include "render/image/image.h"

namespace curvisplat {
namespace {

class GlobeGrid : public testing::Test {
 protected:
  void put(const AnnotatedScene::OnGlobe& box) {
    scene_.on_globe = box;
    const ImageSize size{600, 600};
    scene_.picture = size;
    scene_.lower = glm::dvec3(-box.globe.radius_km);
    scene_.upper = glm::dvec3(box.globe.radius_km);
    const Camera camera =
        Camera::named("+x", scene_.lower, scene_.upper, size, Projection::kOrthographic, 30);
    scene_.view = ScreenView::of(camera, size, glm::dvec3(1.0), kLowPass, 1e-3);
    Annotations shown;
    shown.axes_grid = true;
    layer_ = annotationLayer(shown, scene_);
    Image lines(size);
    putBehind(lines, shown, scene_);
    for (size_t n = 0; n < layer_.size(); n += 4)
      for (size_t c = 0; c < 3; ++c)
        if (lines.rgba[n + c] != scene_.background[static_cast<int>(c)]) layer_[n + 3] = 255;
  }
  /// Whether ink is within a pixel of a place.
  bool isInked(const glm::dvec3& place) const {
    const glm::dvec2 at =
        scene_.view.pixelFromView(scene_.view.viewFromData(scene_.on_globe->globe.placeAt(place)));
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const auto column = static_cast<size_t>(at.x) + static_cast<size_t>(x + 1) - 1,
                   row = static_cast<size_t>(at.y) + static_cast<size_t>(y + 1) - 1;
        if (layer_.at(4 * (row * 600 + column) + 3) > 0) return true;
      }
    return false;
  }

  AnnotatedScene scene_;
  std::vector<uint8_t> layer_;
};

TEST_F(GlobeGrid, OfAllOfTheEarthHasTheMeridiansThatAreSeen) {
  put({Globe{Globe::Shape::kSphere, 1000, 1, 0}, {-180, -90, -5}, {180, 90, 0}});
  for (const double latitude : {-52.0, -20.0, 13.0, 41.0}) {
    EXPECT_TRUE(isInked({30, latitude, -5})) << latitude;
    EXPECT_TRUE(isInked({-60, latitude, -5})) << latitude;
  }
  // Between meridians; and those on the other side, which the Earth hides.
  for (const double longitude : {15.0, 44.0, 135.0 + 8})
    EXPECT_FALSE(isInked({longitude, -14, -5})) << longitude;
  const size_t inked =
      static_cast<size_t>(std::count_if(layer_.begin(), layer_.end(), [](uint8_t n) { return n > 0; }));
  EXPECT_GT(inked, 8000u);
}

TEST_F(GlobeGrid, OfAPartHasItsSidesBehindTheData) {
  // The bottom is seen from above, and so are the walls behind it.
  put({Globe{Globe::Shape::kSphere, 1000, 1, 0}, {-40, -40, -300}, {40, 40, 0}});
  EXPECT_TRUE(isInked({30, 7, -300}));
  EXPECT_TRUE(isInked({7, -30, -300}));
  EXPECT_FALSE(isInked({7, 7, -300}));
  // Coordinates stand outside of its southern edge.
  const glm::dvec3 edge = scene_.view.viewFromData(scene_.on_globe->globe.placeAt({0, -40, 0}));
  size_t inked = 0;
  for (auto n = 4 * 600 * (static_cast<size_t>(scene_.view.pixelFromView(edge).y) + 12) + 3;
       n < layer_.size(); n += 4)
    inked += layer_[n] > 200;
  EXPECT_GT(inked, 100u);
}

TEST_F(GlobeGrid, OfAFlatMapIsABox) {
  put({Globe{Globe::Shape::kFlat, 1000, 100, 0}, {-30, -30, -5}, {30, 30, 0}});
  EXPECT_TRUE(isInked({-30, 0, -2.5})) << "a circle of latitude, on the wall behind";
  EXPECT_FALSE(isInked({-30, 10, -1.0}));
}

}  // namespace
}  // namespace curvisplat
