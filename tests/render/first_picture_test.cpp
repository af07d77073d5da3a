#include "render/frame/first_picture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "render/project/screen_view.h"

namespace curvisplat {
namespace {

TEST(ReducedSize, HasTwoPixelsADetailAndAtMostAnEighth) {
  const auto sizeFor = [](double detail_px) { return ReducedSize({600, 400}, detail_px).size(); };
  EXPECT_EQ(sizeFor(0).height, 400);
  EXPECT_EQ(sizeFor(2.9).height, 400);
  EXPECT_TRUE(ReducedSize({600, 400}, 2.9).isWhole());
  EXPECT_EQ(sizeFor(4).height, 200);
  EXPECT_EQ(sizeFor(4).width, 300);
  EXPECT_FALSE(ReducedSize({600, 400}, 4).isWhole());
  EXPECT_EQ(sizeFor(1e3).height, 50);
  EXPECT_EQ(sizeFor(INFINITY).height, 50);
  EXPECT_EQ(sizeFor(INFINITY).width, 75);
}

TEST(ReducedSize, SmallImagesStayImages) {
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{3, 2}, ImageSize{1, 400}, ImageSize{400, 1}}) {
    const ReducedSize reduced(size, 1e3);
    EXPECT_GE(reduced.size().width, 1);
    EXPECT_GE(reduced.size().height, 1);
    Image picture(reduced.size());
    picture.rgba.assign(picture.rgba.size(), 0.25f);
    const Image image = reduced.enlarge(picture);
    EXPECT_EQ(image.size.width, size.width);
    EXPECT_EQ(image.size.height, size.height);
    for (const float value : image.rgba) EXPECT_EQ(value, 0.25f);
  }
}

// What a camera shows at a pixel of the whole image is at the same place of the enlarged one: a plane of
// values in the world stays that plane.
TEST(ReducedSize, ShowsWhatTheCameraShowsInTheWholeImage) {
  Camera camera;
  camera.parallel_scale = 2;
  const auto colourAt = [](double x, double y) { return static_cast<float>(0.5 + 0.1 * x - 0.07 * y); };
  for (const ImageSize size : {ImageSize{600, 400}, ImageSize{601, 397}, ImageSize{100, 333}})
    for (const double detail_px : {3.0, 5.3, 16.0}) {
      const ReducedSize reduced(size, detail_px);
      const auto paint = [&](ImageSize wanted) {
        const ScreenView view = ScreenView::of(camera, wanted, glm::dvec3(1), 1.5, 1);
        Image image(wanted);
        for (int y = 0; y < wanted.height; ++y)
          for (int x = 0; x < wanted.width; ++x)
            for (int c = 0; c < 4; ++c)
              image.pixel(x, y)[c] = colourAt((x + 0.5 - 0.5 * wanted.width) / view.focal_px,
                                              (y + 0.5 - 0.5 * wanted.height) / view.focal_px);
        return image;
      };
      const Image whole = paint(size), enlarged = reduced.enlarge(paint(reduced.size()));
      const int margin = 9;  // at the edges the nearest pixel goes on
      for (int y = margin; y < size.height - margin; ++y)
        for (int x = margin; x < size.width - margin; ++x)
          ASSERT_NEAR(enlarged.pixel(x, y)[1], whole.pixel(x, y)[1], 1e-5) << x << ' ' << y;
    }
}

}  // namespace
}  // namespace curvisplat
