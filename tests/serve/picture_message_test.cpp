// Pictures as messages: the header's bytes, lossless pixels, and JPEGs that resemble them.
#include "tools/serve/picture_message.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <span>

#include "render/image/image_formats.h"

namespace curvisplat {
namespace {

Image gradient(ImageSize size) {
  Image image(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      float* const pixel = image.pixel(x, y);
      pixel[0] = static_cast<float>(x) / static_cast<float>(size.width);
      pixel[1] = static_cast<float>(y) / static_cast<float>(size.height);
      pixel[2] = 0.5f + 0.5f * std::sin(0.1f * static_cast<float>(x + y));
      pixel[3] = 1;
    }
  return image;
}

template <typename T>
T at(const std::string& message, size_t place) {
  T value;
  std::memcpy(&value, message.data() + place, sizeof value);
  return value;
}

PictureHeader header() {
  PictureHeader header;
  header.picture = 5;
  header.request = 1234567890123.0;
  header.step = 6;
  header.size = {70, 50};
  header.level = 2;
  header.seconds = 0.25f;
  header.error_px = 1.5f;
  header.splats = 77;
  return header;
}

TEST(PictureMessage, HasTheHeadersNumbers) {
  PictureHeader lossless = header();
  lossless.is_png = lossless.is_final = true;
  const std::string message = losslessMessage(lossless, gradient({70, 50}));
  EXPECT_EQ(message.substr(0, 4), "CVP1");
  EXPECT_EQ(at<uint32_t>(message, 4), 5u);
  EXPECT_EQ(at<double>(message, 8), 1234567890123.0);
  EXPECT_EQ(at<uint32_t>(message, 16), 6u);
  EXPECT_EQ(at<uint16_t>(message, 20), 70);
  EXPECT_EQ(at<uint16_t>(message, 22), 50);
  EXPECT_EQ(at<uint8_t>(message, 24), 1);
  EXPECT_EQ(at<uint8_t>(message, 25), 1);
  EXPECT_EQ(at<uint8_t>(message, 26), 2);
  EXPECT_EQ(at<float>(message, 28), 0.25f);
  EXPECT_EQ(at<float>(message, 32), 1.5f);
  EXPECT_EQ(at<uint32_t>(message, 36), 77u);
}

TEST(PictureMessage, LosslessOnesHaveThePixelsOfAWrittenFile) {
  const Image image = gradient({70, 50});
  const std::string message = losslessMessage(header(), image);
  const auto* const file = reinterpret_cast<const std::byte*>(message.data() + kPictureHeaderBytes);
  const Image sent = decodePng({file, message.size() - kPictureHeaderBytes}, "sent");
  EXPECT_EQ(sent.rgba, decodePng(encodePng(image), "written").rgba);
}

TEST(PictureMessage, CoarserQualitiesHaveFewerBytes) {
  const Image image = gradient({640, 480});
  size_t last = 1 << 30;
  for (const PictureQuality& quality : {PictureQuality{90, 1}, {50, 1}, {50, 2}, {25, 4}}) {
    const std::string message = jpegMessage(header(), image, quality);
    EXPECT_EQ(message.substr(kPictureHeaderBytes, 2), "\xff\xd8");
    EXPECT_LT(message.size(), last);
    last = message.size();
  }
}

TEST(PictureMessage, ReductionsOfTinyPicturesHaveAPixel) {
  for (const ImageSize size : {ImageSize{1, 1}, {3, 1}, {1, 9}, {5, 5}})
    EXPECT_GT(jpegMessage(header(), gradient(size), {50, 4}).size(), kPictureHeaderBytes + 100);
}

}  // namespace
}  // namespace curvisplat
