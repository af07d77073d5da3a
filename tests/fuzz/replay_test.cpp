// Every input that is kept, through its target: seeds, and what fuzzing has found.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "stream/base/file.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

class Corpus : public testing::TestWithParam<FuzzTarget> {};

TEST_P(Corpus, IsReadOrRefused) {
  std::vector<std::filesystem::path> inputs;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(CURVISPLAT_FUZZ_CORPUS) / GetParam().name))
    inputs.push_back(entry.path());
  std::sort(inputs.begin(), inputs.end());
  int read = 0;
  for (const std::filesystem::path& input : inputs) {
    std::printf("%s\n", input.filename().c_str());  // the last one, should the program end here
    std::fflush(stdout);
    const std::string bytes = readTextFile(input);
    const std::string refusal = runFuzzTarget(GetParam(), std::as_bytes(std::span(bytes)));
    if (!refusal.empty()) std::printf("  refused: %s\n", refusal.c_str());
    read += refusal.empty();
  }
  EXPECT_GT(read, 0) << "a target that refuses all of its seeds reaches nothing";
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Corpus, testing::ValuesIn(fuzzTargets()),
                         [](const auto& with) { return with.param.name; });

}  // namespace
}  // namespace curvisplat
