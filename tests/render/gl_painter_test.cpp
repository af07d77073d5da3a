#include "render/gl_painter.h"

#include <gtest/gtest.h>

#include "render/gl_thread.h"
#include "stream/error.h"
#include "tests/support/painted_splats.h"

namespace curvisplat {
namespace {

TEST(GlPainter, RefusesAnImageBeyondTheLimitAndGoesOn) {
  const auto table = lively();
  GlThread gl;
  gl.run([&](const GlContext& context) {
    GlPainter painter(context);
    try {
      painter.begin({1 << 20, 8}, glm::vec4(1), table, true);
      ADD_FAILURE() << "an image of a million columns was accepted";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("1048576x8"), std::string::npos) << error.what();
    }
    painter.begin({8, 8}, glm::vec4(1), table, true);
    EXPECT_EQ(painter.end().pixel(4, 4)[0], 1.0f);
  });
}

TEST(GlThread, HandsErrorsToTheCaller) {
  GlThread gl;
  EXPECT_NE(gl.contextName().find("OpenGL"), std::string::npos) << gl.contextName();
  EXPECT_THROW(gl.run([](const GlContext&) { throw Error("no"); }), Error);
  bool ran = false;
  gl.run([&](const GlContext&) { ran = true; });
  EXPECT_TRUE(ran);
}

}  // namespace
}  // namespace curvisplat
