// The real program in tests. run() runs it and expects it to succeed; expectRefused() expects one line of
// error. ProgramTest and ProgramSuite are fixtures with a folder: of each test, or of all tests of a suite,
// where what they share is made once. The functions may be called anywhere in a test, SetUpTestSuite()
// included, by one thread.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/expect_error.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

/// Arguments of the program.
using Words = std::vector<std::string>;

inline Words operator+(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Runs the program, which must succeed: otherwise throws std::runtime_error with the words and what the
/// program has printed, which ends the test or the suite as failed.
inline ProgramResult run(const Words& words) {
  ProgramResult result = runProgram(words);
  if (result.status != 0)
    throw std::runtime_error(testing::PrintToString(words) + " ended with status " +
                             std::to_string(result.status) + ": " + result.err + result.out);
  return result;
}

/// Expects this exit status and one line of error that has each of `says` in it.
inline void expectRefused(const ProgramResult& result, int status, const Words& says,
                          const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  const testing::ScopedTrace trace(file, line, "is refused");
  EXPECT_EQ(result.status, status) << result.err;
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  for (const std::string& part : says) expectSays(result.err, part, file, line);
}

/// Runs the program and expects that it refuses these words.
inline void expectRefused(const Words& words, int status, const Words& says,
                          const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  const testing::ScopedTrace trace(file, line, testing::PrintToString(words));
  expectRefused(runProgram(words), status, says, file, line);
}

inline nlohmann::json jsonOf(const std::filesystem::path& file) {
  return nlohmann::json::parse(readTextFile(file));
}

/// `words`, with --size `size` unless they have one.
inline Words sized(const Words& words, const char* size) {
  if (std::find(words.begin(), words.end(), "--size") != words.end()) return words;
  return words + Words{"--size", size};
}

/// The picture of `render CACHE -o OUTPUT more...`, with --size `size` unless `more` has one.
inline Image pictureOf(const std::string& cache, const std::string& output, const Words& more,
                       const char* size = "96x96") {
  run(sized(Words{"render", cache, "-o", output} + more, size));
  return readImage(output);
}

/// Generates a scene (STEM.xyz, STEM.fun) and converts it with `more`. The cache: STEM.splats.
inline std::string madeCache(const std::string& stem, const std::string& scene, const std::string& size,
                             const Words& more = {}) {
  run({"generate", scene, "--size", size, "-o", stem});
  run(Words{"convert", stem + ".xyz", stem + ".fun", "-o", stem + ".splats"} + more);
  return stem + ".splats";
}

/// A folder for each test.
class ProgramTest : public testing::Test {
 protected:
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  const TemporaryFolder folder_;
};

/// One folder for all tests of a suite. `Suite` derives from this and has a static prepare(), which makes in
/// the folder what the tests share.
template <typename Suite>
class ProgramSuite : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    struct Access : Suite {
      using Suite::prepare;
    };
    folder_.emplace();
    Access::prepare();
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string file(const std::string& name) { return (*folder_ / name).string(); }

  static inline std::optional<TemporaryFolder> folder_;
};

}  // namespace curvisplat
