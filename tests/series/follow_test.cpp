// convert --follow: what a simulation writes is noticed without polling. kill_series.py and full_disk.sh have its ends.
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tests/support/folder_watch.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// Whether the process holds a queue of inotify with watches.
bool hasWatches(pid_t process) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(process) + "/fdinfo", error)) {
    std::ifstream in(entry.path());
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    if (text.find("inotify wd:") != std::string::npos) return true;
  }
  return false;
}

class Follow : public testing::Test {
 protected:
  std::string file(const std::string& name) const { return (folder / name).string(); }
  ProgramResult run(const std::vector<std::string>& arguments) {
    ProgramResult result = runProgram(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return result;
  }
  /// w.xyz and w_0000.fun, ..., which have been there for a while.
  void generate(int steps) {
    run({"generate", "wake", "--size", "24x20x16", "--steps", std::to_string(steps), "-o", file("w")});
    settle();
  }
  void settle() const {
    for (const auto& entry : fs::directory_iterator(folder.path()))
      if (entry.is_regular_file())
        fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - std::chrono::hours(1));
  }
  const TemporaryFolder folder;
};

TEST_F(Follow, NoticesChanges) {
  generate(2);
  fs::rename(file("w_0001.fun"), file("later"));
  RunningProgram following(
      {"convert", file("w.xyz"), file("w_*.fun"), "--follow", "--until", "2", "-o", file("a.splats")});
  {
    FolderWatch watch(folder.path());
    watch.waitUntil([&] { return fs::exists(file("a.splats")); });
  }
  EXPECT_TRUE(hasWatches(following.process()));
  fs::rename(file("later"), file("w_0001.fun"));
  const ProgramResult result = following.wait();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 2u);
}

TEST_F(Follow, WaitsForAFolder) {
  generate(1);
  RunningProgram following({"convert", file("run/w.xyz"), file("run/w_*.fun"), "--follow", "--until", "1",
                            "-o", file("a.splats")});
  fs::create_directories(file("run"));
  for (const char* name : {"w.xyz", "w_0000.nam", "w_0000.fun"})
    fs::rename(file(name), file(std::string("run/") + name));
  const ProgramResult result = following.wait();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 1u);
}

}  // namespace
}  // namespace curvisplat
