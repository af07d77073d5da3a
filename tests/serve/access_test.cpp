// Tokens, hosts and origins.
#include "tools/serve/access.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <set>

#include "stream/base/error.h"

#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

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
}

}  // namespace
}  // namespace curvisplat
