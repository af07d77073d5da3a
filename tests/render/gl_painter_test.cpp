#include "render/gl/gl_painter.h"
#include "render/gl/offscreen_context.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "render/gl/gl_thread.h"
#include "stream/base/error.h"
#include "tests/reference/painted_splats.h"

namespace curvisplat {
namespace {

TEST(GlPainter, RefusesAnImageBeyondTheLimitAndGoesOn) {
  const auto table = lively();
  GlThread gl(GlLibrary::kOsmesa);
  gl.run([&](const GlContext& context) {
    GlPainter painter(context);
    try {
      painter.begin({1 << 20, 8}, glm::vec4(1), table, {});
      ADD_FAILURE() << "an image of a million columns was accepted";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("1048576x8"), std::string::npos) << error.what();
    }
    painter.begin({8, 8}, glm::vec4(1), table, {});
    EXPECT_EQ(painter.end().pixel(4, 4)[0], 1.0f);
  });
}

TEST(GlPainter, DrawsFromMappedMemoryWithoutCopying) {
  const ImageSize size{160, 120};
  auto splats = cutSome(randomSplats(3000, 8, size), 6);
  splats.resize(4000);
  ASSERT_TRUE(isRecord(splats.back()) || !hasCut(splats.back()));
  const auto table = lively();
  GlThread gl(GlLibrary::kOsmesa);
  gl.run([&](const GlContext& context) {
    GlPainter painter(context);
    painter.begin(size, glm::vec4(1), table, {});
    painter.draw(splats);
    const Image copied = painter.end();
    for (int repetition = 0; repetition < 2; ++repetition) {
      const std::span<ScreenSplat> mapped = painter.mapSplats(splats.size() + 7);
      ASSERT_EQ(mapped.size(), splats.size() + 7) << painter.drawsUnderWay();
      std::copy(splats.begin(), splats.end(), mapped.begin() + 5);
      painter.begin(size, glm::vec4(1), table, {});
      for (size_t begin = 0; begin < splats.size(); begin += 500) {
        painter.draw(mapped.subspan(5 + begin, 500));
        EXPECT_LE(painter.drawsUnderWay(), begin / 500 + 1);
        EXPECT_LT(painter.drawsUnderWay(), 4u);
      }
      EXPECT_EQ(painter.end().rgba, copied.rgba);
      EXPECT_EQ(painter.uploadSeconds(), 0);
      EXPECT_GT(painter.glSeconds(), 0);
      painter.finishDraws();
      EXPECT_EQ(painter.drawsUnderWay(), 0u);
      // What lies elsewhere is copied all the same.
      painter.begin(size, glm::vec4(1), table, {});
      painter.draw(splats);
      EXPECT_EQ(painter.end().rgba, copied.rgba);
      EXPECT_GT(painter.uploadSeconds(), 0);
    }
  });
}

TEST(GlThread, HandsErrorsToTheCaller) {
  GlThread gl(GlLibrary::kOsmesa);
  EXPECT_NE(gl.contextName().find("OpenGL"), std::string::npos) << gl.contextName();
  EXPECT_THROW(gl.run([](const GlContext&) { throw Error("no"); }), Error);
  bool ran = false;
  gl.run([&](const GlContext&) { ran = true; });
  EXPECT_TRUE(ran);
}

}  // namespace
}  // namespace curvisplat
