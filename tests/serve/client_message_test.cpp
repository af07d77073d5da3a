// Messages of pages to the server, and what is refused: tokens, hosts and origins, and messages.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <fstream>
#include <set>

#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tools/serve/client_requests.h"
#include "tools/serve/served_caches.h"

namespace curvisplat {
namespace {

TEST(ErrorText, HasNeitherFoldersNorOptionsOfTheServer) {
  const std::string cache = CURVISPLAT_TEST_DATA "/caches/version_2/blocks.splats";
  ServedFolders folders({cache});
  const auto caches = folders.caches();
  EXPECT_EQ(caches->errorText(cache + "/geometry.bin: is truncated"),
            R"({"type":"error","text":"blocks/geometry.bin: is truncated"})");
  EXPECT_EQ(
      caches->errorText("OpenGL has no memory left; give --backend cpu"),
      R"({"type":"error","text":"OpenGL has no memory left; have the server started with --backend cpu"})");
}

TEST(Access, TokensAreLongAndNew) {
  std::set<std::string> tokens;
  for (int n = 0; n < 100; ++n) tokens.insert(newToken());
  EXPECT_EQ(tokens.size(), 100u);
  for (const std::string& token : tokens) {
    EXPECT_EQ(token.size(), 32u);
    EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos) << token;
  }
}

TEST(Access, OnlyTheWholeTokenIsTheToken) {
  const std::string token = "0123456789abcdef";
  EXPECT_TRUE(isSameToken(token, token));
  EXPECT_FALSE(isSameToken("", token));
  EXPECT_FALSE(isSameToken(token + "0", token));
  for (size_t length = 0; length < token.size(); ++length)
    EXPECT_FALSE(isSameToken(token.substr(0, length), token)) << length;
  for (size_t n = 0; n < token.size(); ++n) {
    std::string other = token;
    other[n] ^= 1;
    EXPECT_FALSE(isSameToken(other, token)) << n;
  }
  EXPECT_FALSE(isSameToken(std::string(16, '\0'), token));
  EXPECT_FALSE(isSameToken("", "")) << "a server without a token lets no one in";
}

TEST(Access, TargetsArePathAndToken) {
  const auto expect = [](std::string_view target, std::string_view path, std::string_view token) {
    const RequestTarget found = targetOf(target);
    EXPECT_EQ(found.path, path) << target;
    EXPECT_EQ(found.token, token) << target;
  };
  expect("/?token=abc", "/", "abc");
  expect("/socket?x=1&token=abc&y=2", "/socket", "abc");
  expect("/", "/", "");
  expect("", "", "");
  expect("?", "", "");
  expect("/?token=", "/", "");
  expect("/?nottoken=abc", "/", "");
  expect("/?&&token=a&&", "/", "a");
  expect("/../etc/passwd?token=abc", "/../etc/passwd", "abc");
}

TEST(Access, HostsAreThisMachineOrNamed) {
  for (const char* host :
       {"localhost", "localhost:8642", "LocalHost:1", "127.0.0.1:80", "[::1]:8642", "[::1]", "10.1.2.3:5"})
    EXPECT_TRUE(isKnownHost(host, {})) << host;
  for (const char* host :
       {"", "evil.example", "evil.example:8642", "localhost.evil.example", "127.0.0.1.evil.example",
        "localhost:8642x", "localhost:", "[::1", "[::1]x", "127.0.0.1:123456", "localhost:1:2"})
    EXPECT_FALSE(isKnownHost(host, {})) << host;
  EXPECT_TRUE(isKnownHost("Node7.cluster:8642", {"node7.cluster"}));
  EXPECT_FALSE(isKnownHost("node8.cluster:8642", {"node7.cluster"}));
}

TEST(Access, OnlyOurOwnPageIsOurs) {
  EXPECT_TRUE(isOwnOrigin("http://127.0.0.1:8642", "127.0.0.1:8642"));
  EXPECT_TRUE(isOwnOrigin("https://node7:8642", "node7:8642"));
  for (const char* origin :
       {"", "null", "http://evil.example", "http://127.0.0.1:8643", "http://127.0.0.1:8642.evil.example",
        "127.0.0.1:8642", "ftp://127.0.0.1:8642", "http://"})
    EXPECT_FALSE(isOwnOrigin(origin, "127.0.0.1:8642")) << origin;
  EXPECT_FALSE(isOwnOrigin("http://", ""));
}

TEST(Access, TokenFilesAreTheirOwnersAlone) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "token";
  const auto write = [&](const std::string& text, mode_t mode) {
    std::ofstream(file) << text;
    ::chmod(file.c_str(), mode);
  };
  write("0123456789abcdef\n", 0600);
  EXPECT_EQ(readToken(file), "0123456789abcdef");
  write("0123456789abcdef\n", 0640);
  EXPECT_THROW(readToken(file), Error);
  write("short\n", 0600);
  EXPECT_THROW(readToken(file), Error);
  write("0123456789abcdef&x=1\n", 0600);
  EXPECT_THROW(readToken(file), Error);
  EXPECT_THROW(readToken(folder.path() / "none"), Error);
  expectError([&] { readToken("/dev/null"); },
              {"/dev/null", "not a regular file"});  // not "run chmod 600 on it"
}

template <typename T>
T parsed(const std::string& text) {
  return std::get<T>(parseClientMessage(text));
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
  const auto choose =
      parsed<FunctionRequest>(R"({"type": "choose", "cache": 0, "scalar": "rho", "dark": false})");
  EXPECT_EQ(choose.scalar, "rho");
  EXPECT_FALSE(choose.dark);
  EXPECT_FALSE(choose.with_sheets);
  EXPECT_TRUE(parsed<FunctionRequest>(R"({"type": "choose", "cache": 0, "scalar": "rho"})").dark);
  EXPECT_TRUE(parsed<FunctionRequest>(R"({"type": "choose", "cache": 0, "scalar": "rho", "sheets": true})")
                  .with_sheets);
  const auto histogram = parsed<HistogramRequest>(
      R"({"type": "histogram", "cache": 0, "scalar": "rho", "low": -1, "high": 2, "log": false})");
  EXPECT_EQ(histogram.low, -1);
  EXPECT_EQ(histogram.high, 2);
  EXPECT_FALSE(histogram.asinh);
  const auto in_asinh = parsed<HistogramRequest>(
      R"({"type": "histogram", "cache": 0, "scalar": "a", "low": -1, "high": 2, "log": false, "asinh": [0.5, 0.1]})");
  ASSERT_TRUE(in_asinh.asinh);
  EXPECT_EQ(in_asinh.asinh->width, 0.1);
  EXPECT_EQ(parsed<ColoursRequest>(R"({"type": "colours", "map": "viridis"})").map, "viridis");
  const auto colours = parsed<ColoursRequest>(
      R"({"type": "colours", "map": "viridis", "parts": {"map": "grey", "range": [1, 3], "opacity_unit": 2}})");
  EXPECT_EQ(colours.parts.value().range.second, 3);
  const auto iso = parsed<IsosurfaceRequest>(
      R"({"type": "isosurface", "cache": 0, "step": 4, "scalar": "f", "state": {"a": 1}})");
  EXPECT_EQ(iso.step, 4u);
  EXPECT_EQ(iso.scalar, "f");
  const auto pick = parsed<PickRequest>(R"({"type": "pick", "x": 0.25, "y": 1})");
  EXPECT_EQ(pick.x, 0.25);
  EXPECT_EQ(pick.y, 1);
  EXPECT_FALSE(pick.hovers);
  EXPECT_TRUE(parsed<PickRequest>(R"({"type": "pick", "x": 0, "y": 1, "hovers": true})").hovers);
  EXPECT_THROW(parsed<PickRequest>(R"({"type": "pick", "x": 1.1, "y": 0})"), Error);
  const auto command = parsed<CommandRequest>(
      R"({"type": "command", "cache": 1, "size": [30, 20], "step": 2, "state": {"a": 1}})");
  EXPECT_EQ(command.cache, 1u);
  EXPECT_EQ(command.size.height, 20);
  EXPECT_EQ(command.step, 2u);
  EXPECT_EQ(command.state, R"({"a":1})");
  EXPECT_EQ(parsed<ShownReport>(R"({"type": "shown", "picture": 3})").picture, 3u);
}

TEST(ClientMessage, RefusesWithOneLineThatNamesThePlace) {
  const auto refuses = [](const std::string& text, const std::string& place) {
    const std::string error = errorOf([&] { parseClientMessage(text); });
    EXPECT_TRUE(error.starts_with("message: " + place)) << text << ": " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    EXPECT_LT(error.size(), 300u);
  };
  refuses("", "is not JSON");
  refuses("[", "is not JSON");
  refuses("[]", "");
  refuses("{}", "type is missing");
  refuses(R"({"type": 3})", "type");
  refuses(R"({"type": "read_file"})", "type");
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
  for (const char* asinh : {"[0.5]", "[0, 0]", "[0, 1e300]", "[1e300, 1]", "[0, 1e-300]"})
    refuses(
        R"({"type": "histogram", "cache": 0, "scalar": "a", "low": -1e9, "high": 1e9, "log": false, "asinh": )" +
            std::string(asinh) + "}",
        "asinh");
  refuses(
      R"({"type": "colours", "map": "grey", "parts": {"map": "grey", "range": [3, 1], "opacity_unit": 2}})",
      "parts.range");
  refuses(R"({"type": "isosurface", "cache": 0, "step": 4, "scalar": "f"})", "state");
  refuses(R"({"type": "colours", "map": ")" + std::string(1001, 'a') + R"("})", "map");
  refuses(R"({"type": "pick", "x": 0, "y": 1, "hovers": 1})", "hovers");
  refuses(R"({"type": "shown", "picture": 1e300})", "picture");
  refuses(R"({"type": "command", "cache": 0, "size": [1, 1], "step": 0, "state": []})", "state");
  refuses(R"({"type": "command", "cache": 0, "size": [1, 1], "step": -1, "state": {}})", "step");
  refuses(std::string(kLongestMessage + 1, ' '), "is too long");
  refuses(std::string(1000, '['), "has brackets");
  refuses("{\"type\": \"colours\", \"map\": \"\xff\xfe\"}", "is not JSON");
}

/// A page sends two messages in each frame of a screen of 240 Hz.
TEST(MessageRate, AllowsTheFastestScreensPaceAndRefusesAFlood) {
  MessageRate page;
  for (int n = 0; n < 20'000; ++n) ASSERT_TRUE(page.admits(n / 480.0)) << n;
  MessageRate flood;
  int passed = 0;
  while (flood.admits(5 + passed * 1e-5)) ++passed;
  EXPECT_NEAR(passed, 1200, 10);
  EXPECT_FALSE(flood.admits(5 + passed * 1e-5));
  EXPECT_TRUE(flood.admits(7)) << "after a while it may go on";
}

}  // namespace
}  // namespace curvisplat
