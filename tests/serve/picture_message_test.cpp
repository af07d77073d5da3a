// Pictures as messages: the header's bytes, lossless pixels, and JPEGs that resemble them. Pictures become
// as large as the line is fast: against a line that is simulated.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <random>
#include <span>
#include <vector>

#include "render/image/image_file.h"
#include "tools/serve/picture_message.h"

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

TEST(PictureMessage, OfNoiseAreAsLongAsPromisedAtMost) {
  std::mt19937 random(1);
  for (const ImageSize size : {ImageSize{1, 1}, {1, 3000}, {3000, 1}, {300, 200}}) {
    Image image(size);
    for (size_t n = 0; n < image.rgba.size(); ++n)
      image.rgba[n] = n % 4 == 3 ? 1 : static_cast<float>(random() % 256) / 255;
    EXPECT_LE(jpegMessage(header(), image, {90, 1}).size(), messageBytes(size));
    for (size_t n = 3; n < image.rgba.size(); n += 4) image.rgba[n] = 0.5f + 0.5f * image.rgba[n - 1];
    EXPECT_LE(losslessMessage(header(), image).size(), messageBytes(size));
  }
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

/// A line with a delay and a rate, and a page that reports each picture. Pictures are drawn in 40 ms; their bytes
/// halve from level to level.
struct Line {
  double bytes_per_s, delay_s;
  LineQuality quality = {};
  double now_s = 0, free_at_s = 0;
  uint64_t pictures = 0;
  std::deque<std::pair<double, uint64_t>> reports = {};  // when each arrives

  double bytes() const { return 100'000.0 / (1 << quality.level()); }

  void report() {
    now_s = std::max(now_s, reports.front().first);
    quality.shown(reports.front().second, now_s);
    reports.pop_front();
  }

  /// Draws and sends for a while; returns pictures a second.
  double run(double seconds) {
    const double end_s = now_s + seconds;
    const uint64_t before = pictures;
    while (now_s < end_s) {
      now_s += 0.04;
      while (!reports.empty() && reports.front().first <= now_s) report();
      while (!quality.isOpen()) report();
      free_at_s = std::max(free_at_s, now_s) + bytes() / bytes_per_s;
      quality.sent(++pictures, now_s, true);
      reports.emplace_back(free_at_s + delay_s, pictures);
      EXPECT_LE(reports.size(), LineQuality::kMaxOnTheWay);
    }
    return static_cast<double>(pictures - before) / seconds;
  }
};

TEST(LineQuality, StaysFineOnAFastLine) {
  Line line{100e6, 0.001};
  EXPECT_GT(line.run(20), 24);
  EXPECT_EQ(line.quality.level(), 0);
}

TEST(LineQuality, IsNotMistakenForSlowWhenTheLineIsLong) {
  Line line{100e6, 0.15};
  line.run(20);
  EXPECT_EQ(line.quality.level(), 0);
}

TEST(LineQuality, KeepsAFrameRateOnASlowLine) {
  Line line{300e3, 0.02};  // 3 full pictures a second
  line.run(10);
  EXPECT_GT(line.quality.level(), 0);
  EXPECT_GT(line.run(20), 10);
}

TEST(LineQuality, ComesBackWhenTheLineDoes) {
  Line line{200e3, 0.02};
  line.run(20);
  EXPECT_GT(line.quality.level(), 0);
  line.bytes_per_s = 100e6;
  line.run(20);
  EXPECT_EQ(line.quality.level(), 0);
}

TEST(LineQuality, EndsAtTheCoarsest) {
  Line line{2e3, 0.02};
  line.run(2000);
  EXPECT_EQ(line.quality.level(), LineQuality::kCoarsest);
}

TEST(LineQuality, IgnoresReportsOfPicturesThatWereNotSent) {
  LineQuality quality;
  quality.shown(7, 1);
  for (uint64_t n = 1; n <= 3; ++n) quality.sent(n, 1, true);
  EXPECT_FALSE(quality.isOpen());
  quality.shown(99, 2);
  quality.shown(0, 2);
  EXPECT_FALSE(quality.isOpen());
  quality.shown(2, 2);
  EXPECT_EQ(quality.onTheWay(), 1u) << "the first was shown before the second";
  quality.shown(2, 2);
  EXPECT_EQ(quality.onTheWay(), 1u);
}

TEST(LineQuality, CountsTheBytesOnTheWay) {
  LineQuality quality;
  quality.sent(1, 1, true, 100);
  quality.sent(2, 1, true, 50);
  EXPECT_TRUE(quality.isOpen(150));
  EXPECT_FALSE(quality.isOpen(149));
  quality.shown(1, 2);
  EXPECT_TRUE(quality.isOpen(50));
  EXPECT_FALSE(quality.isOpen(49));
  quality.shown(2, 2);
  EXPECT_TRUE(quality.isOpen(0));
}

TEST(LineQuality, LearnsNothingFromLosslessPictures) {
  LineQuality quality;
  double now_s = 0;
  for (uint64_t n = 1; n < 100; n += 2) {
    quality.sent(n, now_s, false);
    quality.sent(n + 1, now_s, true);
    now_s += 3;
    quality.shown(n, now_s);
    quality.shown(n + 1, now_s);
  }
  EXPECT_EQ(quality.level(), 0);
}

}  // namespace
}  // namespace curvisplat
