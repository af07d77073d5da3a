// Conversions that are interrupted while they scatter splats go on from the last note, and give the same bytes.
#include <gtest/gtest.h>
#include <signal.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <memory>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/scenes/scenes.h"
#include "preprocess/splats/node_splats.h"
#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// Stops the job at a write. Nothing is synced, which would take most of the time.
class UnsyncedStoppingCalls : public SystemCalls {
 public:
  UnsyncedStoppingCalls(Progress& progress, int64_t stop_at) : progress_(progress), stop_at_(stop_at) {}
  int fsync(int) override { return 0; }
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override {
    if (writes++ == stop_at_) progress_.stop(SIGINT);
    return SystemCalls::pwrite(fd, from, count, offset);
  }
  std::atomic<int64_t> writes = 0;

 private:
  Progress& progress_;
  const int64_t stop_at_;
};

/// Two blocks that share a face; one of their nodes is blanked.
FunctionGridSource twoBlocks(Centring centring) {
  return FunctionGridSource(
      {gridBlock(31, 18, 16), gridBlock(25, 18, 16)}, 1,
      [](const GridNode& node) {
        const double i = static_cast<double>(node.i) + (node.block == 1 ? 30 : 0);
        const double j = static_cast<double>(node.j), k = static_cast<double>(node.k);
        return NodeValues{{i + 0.02 * j * j, j + 0.1 * std::sin(i), k * std::pow(1.05, k)},
                          {static_cast<float>(std::sin(0.3 * i) + j * 0.1 + k)},
                          node.block == 1 && node.i == 12 && node.j == 9 && node.k == 7};
      },
      centring);
}

class ResumeScatter : public ::testing::Test {
 protected:
  explicit ResumeScatter() : output_(folder_ / "a.splats") {}

  ConvertOptions options(bool resume) const {
    ConvertOptions options;
    options.output = output_;
    options.scalars = {0};
    options.title = "interrupted";
    options.memory_bytes = memory_;
    options.threads = 2;
    options.resume = resume;
    options.limits.bucket_splats = 3000;
    options.limits.slab_bytes = slab_bytes_;
    options.limits.note_interval = std::chrono::milliseconds(0);
    return options;
  }

  ConvertReport finish(const GridSource& source) const {
    Progress progress;
    UnsyncedStoppingCalls unsynced(progress, -1);
    const ScopedSystemCalls scope(unsynced);
    return convert(source, options(true), progress);
  }

  /// Interrupts a conversion at a write. Whether it was, and had noted some of the splats.
  bool interruptedInScatter(const GridSource& source, int64_t at, bool resume = false) const {
    Progress progress;
    UnsyncedStoppingCalls calls(progress, at);
    const ScopedSystemCalls scope(calls);
    EXPECT_THROW(convert(source, options(resume), progress), Interrupted);
    const auto journal = readJournal(partial());
    return journal && journal->splats && journal->splats->unfinished;
  }

  /// The same at the first write of a scatter that has noted something.
  void interruptInScatter(const GridSource& source, int64_t writes) const {
    for (int64_t at = 0; at < writes / 2; ++at)
      if (interruptedInScatter(source, at)) return;
    FAIL() << "nothing was noted in " << writes / 2 << " writes";
  }

  /// Makes the expected files, and counts the writes.
  int64_t convertWhole(const GridSource& source) {
    Progress progress;
    UnsyncedStoppingCalls calls(progress, -1);
    const ScopedSystemCalls scope(calls);
    whole_ = convert(source, options(false), progress);
    expected_ = allFilesOf(output_);
    fs::remove_all(output_);
    return calls.writes;
  }

  void expectWhole() const {
    const Files files = allFilesOf(output_);
    EXPECT_EQ(files.size(), expected_.size());
    for (const auto& [name, bytes] : expected_)
      EXPECT_TRUE(files.contains(name) && files.at(name) == bytes) << name;
  }

  void expectTheSameAfterInterruptions(const GridSource& source) {
    const int64_t writes = convertWhole(source);
    // The splats are scattered in the first quarter of the writes. How many of those fall within it depends on the
    // threads, so that every eleventh may be too few: then the others follow.
    const bool is_whole = faults::isWholeSweep();
    const int64_t last = is_whole ? writes / 2 : writes / 4;
    const int stride = is_whole ? 1 : 11;
    int within = 0;
    for (int first = 0; first < stride && within < 3; ++first)
      for (int64_t at = first; at < last; at += stride) {
        SCOPED_TRACE(at);
        within += interruptedInScatter(source, at);
        const ConvertReport report = finish(source);
        expectWhole();
        EXPECT_EQ(report.degenerate, whole_.degenerate);
        EXPECT_EQ(report.inverted, whole_.inverted);
        EXPECT_EQ(report.merged_nodes, whole_.merged_nodes);
        if (HasFailure()) return;
        fs::remove_all(output_);
      }
    EXPECT_GE(within, 3);
  }

  fs::path partial() const { return folder_ / "a.splats.partial"; }

  const TemporaryFolder folder_;
  const fs::path output_;
  uint64_t memory_ = leastMemory(1), slab_bytes_ = 250'000;
  Files expected_;
  ConvertReport whole_;
};

TEST_F(ResumeScatter, OfNodesWhoseBlocksShareAFace) {
  expectTheSameAfterInterruptions(twoBlocks(Centring::kNode));
}

TEST_F(ResumeScatter, OfRowsThatAreCut) {
  slab_bytes_ = 120'000;
  expectTheSameAfterInterruptions(twoBlocks(Centring::kNode));
}

TEST_F(ResumeScatter, OfCells) {
  expectTheSameAfterInterruptions(twoBlocks(Centring::kCell));
}

TEST_F(ResumeScatter, OfAGridThatClosesInItself) {
  expectTheSameAfterInterruptions(SceneGridSource(makeScene("o-grid"), {40, 18, 16}));
}

TEST_F(ResumeScatter, AgainAndAgain) {
  const FunctionGridSource source = twoBlocks(Centring::kNode);
  const int64_t writes = convertWhole(source);
  interruptInScatter(source, writes);
  const auto noted = [&] { return readJournal(partial())->splats->unfinished->slabs; };
  uint64_t slabs = noted();
  // Each at the first write at which a further slab was noted.
  for (int further = 0, at = 0; further < 2; ++at) {
    ASSERT_TRUE(interruptedInScatter(source, at, true))
        << "at write " << at << " after " << slabs << " slabs";
    ASSERT_GE(noted(), slabs);
    if (noted() == slabs) continue;
    slabs = noted();
    ++further;
    at = -1;
  }
  EXPECT_TRUE(finish(source).resumed);
  expectWhole();
}

TEST_F(ResumeScatter, BeginsAnewAndSaysSoWithLessMemory) {
  const FunctionGridSource source = twoBlocks(Centring::kNode);
  const int64_t writes = convertWhole(source);
  interruptInScatter(source, writes);
  slab_bytes_ /= 2;
  const ConvertReport report = finish(source);
  ASSERT_EQ(report.notes.size(), 1u);
  expectSays(report.notes[0], "less --memory than before");
  expectWhole();
}

TEST_F(ResumeScatter, BeginsAnewWhereTheFileIsGoneOrShort) {
  const FunctionGridSource source = twoBlocks(Centring::kNode);
  const int64_t writes = convertWhole(source);
  for (const bool is_gone : {true, false}) {
    SCOPED_TRACE(is_gone);
    interruptInScatter(source, writes);
    const fs::path file = readJournal(partial())->scratch / "splats.bin";
    if (is_gone)
      fs::remove(file);
    else
      fs::resize_file(file, 4096);
    finish(source);
    expectWhole();
    fs::remove_all(output_);
  }
}

/// Only such nodes are made again of the slabs that were sent.
TEST(NodesForSeams, AreOnFacesOrNextToThem) {
  const uint64_t ni = 9, nj = 8, nk = 7;
  const FunctionGridSource source({gridBlock(ni, nj, nk)}, 1, [](const GridNode& node) {
    const auto grown = [](uint64_t n) { return std::pow(1.3, static_cast<double>(n)); };
    return NodeValues{{grown(node.i), grown(node.j), grown(node.k)}, {1.0f}, false};
  });
  NodeArrays nodes;
  const NodeBox box{0, nj, 0, nk};
  const std::vector<uint32_t> scalars{0};
  source.read(0, box, scalars, nodes);
  NodeScratch scratch;
  NodeSplats splats;
  computeNodeSplats({source.description().blocks[0], 0, box, &nodes}, box, scratch, splats, {});
  size_t inside = 0, for_seams = 0;
  for (const NodeSplat& splat : splats.splats) {
    const uint64_t i = splat.node % ni, j = splat.node / ni % nj, k = splat.node / (ni * nj);
    const auto isInside = [](uint64_t n, uint64_t count) { return n >= 2 && n + 2 < count; };
    if (isInside(i, ni) && isInside(j, nj) && isInside(k, nk)) {
      ++inside;
      EXPECT_FALSE(splat.isForSeams()) << splat.node;
    }
    for_seams += splat.isForSeams();
  }
  EXPECT_EQ(inside, (ni - 4) * (nj - 4) * (nk - 4));
  EXPECT_GT(for_seams, inside);
}

}  // namespace
}  // namespace curvisplat
