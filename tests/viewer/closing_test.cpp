// A window that is closed while its pictures load: nothing of the loading stays.
#include <gtest/gtest.h>

#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_display.h"
#include "tools/viewer/frame_loop.h"

namespace curvisplat {
namespace {

/// Names of this process's threads, but for TBB's, which stay for whoever comes next.
std::multiset<std::string> threadNames() {
  std::multiset<std::string> names;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream file(task.path() / "comm");
    std::string name;
    std::getline(file, name);
    for (const char* ours : {"frames", "prepare", "pager", "read", "gl"})
      if (name == ours) names.insert(name);
  }
  return names;
}

auto openFiles() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

class ClosingTest : public testing::TestWithParam<PagerOptions::Way> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {128, 64, 64}), *folder_ / "scene.splats");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> ClosingTest::folder_;

TEST_P(ClosingTest, LeavesNoThreadAndNoFile) {
  const CacheReader cache(*folder_ / "scene.splats");
  const auto files = openFiles();
  FrameRequest request{
      DrawnScalars(0, TransferFunction::preset("viridis", 0, 1, 0.05)), 1, halfAnnulusCamera(), {}};
  request.options.size = {160, 120};
  request.options.lod_pixels = 0;
  request.options.read_by = GetParam();
  for (const int pictures : {0, 1, 2}) {
    SCOPED_TRACE(pictures);
    std::mutex mutex;
    std::condition_variable woken;
    int wakes = 0;
    {
      FrameLoop loop(cache, Backend::kCpu, [&] {
        const std::lock_guard lock(mutex);
        ++wakes;
        woken.notify_all();
      });
      loop.request(request);
      std::unique_lock lock(mutex);
      woken.wait(lock, [&] { return wakes >= pictures; });
      if (pictures > 0) {
        const std::multiset<std::string> names = threadNames();
        for (const char* name : {"frames", "pager", "prepare"}) EXPECT_TRUE(names.contains(name)) << name;
        EXPECT_EQ(names.contains("read"), GetParam() == PagerOptions::Way::kThreads);
      }
    }
    // One that was waited for may be seen for a moment more.
    EXPECT_TRUE(eventually([] { return threadNames().empty(); })) << *threadNames().begin();
    EXPECT_EQ(openFiles(), files);
  }
}

INSTANTIATE_TEST_SUITE_P(Ways, ClosingTest,
                         testing::Values(PagerOptions::Way::kAutomatic, PagerOptions::Way::kThreads));

}  // namespace
}  // namespace curvisplat
