// What pages send, and what is refused.
#include "tools/serve/client_message.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stream/base/error.h"
#include "tools/serve/message_rate.h"

namespace curvisplat {
namespace {

template <typename T>
T parsed(const std::string& text) {
  return std::get<T>(parseClientMessage(text, 2));
}

TEST(ClientMessage, IsReadWithEachType) {
  const auto open = parsed<OpenRequest>(R"({"type": "open", "cache": 1, "size": [800, 600]})");
  EXPECT_EQ(open.cache, 1u);
  EXPECT_EQ(open.size.width, 800);
  EXPECT_EQ(open.size.height, 600);
  const auto view = parsed<ViewRequest>(
      R"({"type": "view", "number": 7, "cache": 0, "size": [4096, 1], "moving": true, "step": 3, "next": 4, "state": {"a": [1.5]}})");
  EXPECT_EQ(view.number, 7u);
  EXPECT_TRUE(view.moving);
  EXPECT_EQ(view.step, 3u);
  EXPECT_EQ(view.next, 4u);
  EXPECT_EQ(view.state, R"({"a":[1.5]})");
  EXPECT_EQ(parsed<FunctionRequest>(R"({"type": "choose", "cache": 0, "scalar": "rho"})").scalar, "rho");
  const auto histogram = parsed<HistogramRequest>(
      R"({"type": "histogram", "cache": 0, "scalar": "rho", "low": -1, "high": 2, "log": false})");
  EXPECT_EQ(histogram.low, -1);
  EXPECT_EQ(histogram.high, 2);
  EXPECT_EQ(parsed<ColoursRequest>(R"({"type": "colours", "map": "viridis"})").map, "viridis");
  const auto pick = parsed<PickRequest>(R"({"type": "pick", "x": 0.25, "y": 1})");
  EXPECT_EQ(pick.x, 0.25);
  EXPECT_EQ(pick.y, 1);
  EXPECT_THROW(parsed<PickRequest>(R"({"type": "pick", "x": 1.1, "y": 0})"), Error);
  EXPECT_EQ(parsed<ShownReport>(R"({"type": "shown", "picture": 3})").picture, 3u);
}

TEST(ClientMessage, RefusesWithOneLineThatNamesThePlace) {
  const auto refuses = [](const std::string& text, const std::string& place) {
    try {
      parseClientMessage(text, 2);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_TRUE(what.starts_with("message: " + place)) << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      EXPECT_LT(what.size(), 300u);
    }
  };
  refuses("", "is not JSON");
  refuses("[", "is not JSON");
  refuses("[]", "");
  refuses("{}", "type is missing");
  refuses(R"({"type": 3})", "type");
  refuses(R"({"type": "read_file"})", "type");
  refuses(R"({"type": "open", "cache": 2, "size": [1, 1]})", "cache");
  refuses(R"({"type": "open", "cache": -1, "size": [1, 1]})", "cache");
  refuses(R"({"type": "open", "cache": 0.5, "size": [1, 1]})", "cache");
  for (const char* size : {"[0, 1]", "[1, 4097]", "[4096, 4096]", "[1]", "[1, 1, 1]", "\"1x1\"", "null"})
    refuses(std::string(R"({"type": "open", "cache": 0, "size": )") + size + "}", "size");
  refuses(R"({"type": "view", "number": 1, "cache": 0, "size": [1, 1], "moving": 1, "step": 0, "state": {}})",
          "moving");
  refuses(
      R"({"type": "view", "number": 1, "cache": 0, "size": [1, 1], "moving": true, "step": 0, "state": "x"})",
      "state");
  refuses(R"({"type": "histogram", "cache": 0, "scalar": "a", "low": 2, "high": 2, "log": false})", "high");
  refuses(R"({"type": "histogram", "cache": 0, "scalar": "a", "low": -1e308, "high": 1e308, "log": false})",
          "high");
  refuses(R"({"type": "histogram", "cache": 0, "scalar": "a", "low": 0, "high": 2, "log": true})", "low");
  refuses(R"({"type": "colours", "map": ")" + std::string(1001, 'a') + R"("})", "map");
  refuses(R"({"type": "shown", "picture": 1e300})", "picture");
  refuses(std::string(kLongestMessage + 1, ' '), "is too long");
  refuses(std::string(1000, '['), "has brackets");
  refuses("{\"type\": \"colours\", \"map\": \"\xff\xfe\"}", "is not JSON");
}

/// A page sends two messages in each frame of a screen of 240 Hz.
TEST(MessageRate, AllowsTheFastestScreensPaceAndRefusesAFlood) {
  MessageRate page;
  for (int n = 0; n < 20'000; ++n) ASSERT_TRUE(page.take(n / 480.0)) << n;
  MessageRate flood;
  int passed = 0;
  while (flood.take(5 + passed * 1e-5)) ++passed;
  EXPECT_NEAR(passed, 1200, 10);
  EXPECT_FALSE(flood.take(5 + passed * 1e-5));
  EXPECT_TRUE(flood.take(7)) << "after a while it may go on";
}

}  // namespace
}  // namespace curvisplat
