// `curvisplat convert`, killed, stopped, short of disk, and two at once: as a person meets it. At which call
// a conversion is killed is for tests/preprocess/resume_test.cpp to vary; at which moment, for
// tests/kill_conversion.sh.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>
#include <optional>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

std::map<std::string, uint64_t> checksumsOf(const fs::path& folder) {
  std::map<std::string, uint64_t> checksums;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string bytes = readTextFile(entry.path(), uint64_t{1} << 30);
    checksums[entry.path().filename().string()] = checksumOf(std::as_bytes(std::span(bytes)));
  }
  return checksums;
}

class InterruptedConversion : public ProgramSuite<InterruptedConversion> {
 protected:
  // Makes a grid so large that the least memory takes several buckets.
  static void prepare() {
    Progress progress;
    writePlot3d(SceneGridSource(makeScene("wake"), {100, 64, 56}), *folder_ / "in", progress);
    const fs::path undisturbed = *folder_ / "a.splats";
    run(wordsFor(undisturbed, {}));
    expected_ = checksumsOf(undisturbed);
  }

  static Words wordsFor(const fs::path& output, const Words& more) {
    return Words{"convert", file("in.xyz"), file("in.fun"), "-o", output, "--memory", "192M"} + more;
  }
  Words convert(const Words& more) const { return wordsFor(output_, more); }

  /// Starts a conversion, and returns once it has appended `bricks`. By one thread it takes long enough to be met under way.
  std::unique_ptr<RunningProgram> startedUntil(int bricks, const Words& more = {}) const {
    FolderWatch outside(output_.parent_path());
    auto program = std::make_unique<RunningProgram>(wordsFor(output_, more + Words{"--threads", "1"}));
    outside.waitUntil([&] { return fs::exists(partial()); });
    FolderWatch inside(partial());
    inside.waitUntil([&] { return bricksAppended() >= bricks; });
    return program;
  }

  int bricksAppended() const {
    constexpr uintmax_t kLogEntryBytes = 200;  // stream/cache/partial_folder.h, with one variable
    std::error_code error;
    const auto bytes = fs::file_size(partial() / "bricks.log", error);
    return error ? -1 : static_cast<int>(bytes / kLogEntryBytes);
  }

  fs::path partial() const { return output_.string() + ".partial"; }

  void expectUnfinished() const {
    for (const fs::path& path : {output_, partial()}) expectRefused({"info", path}, 1, {});
  }

  /// The cache is there, as if nothing had happened, and nothing else is.
  void expectWhole() const {
    EXPECT_TRUE(checksumsOf(output_) == expected_);
    EXPECT_EQ(entriesOf(output_.parent_path()), 1u);
  }

  static inline std::map<std::string, uint64_t> expected_;
  const TemporaryFolder own_folder_;  // of the test
  fs::path output_ = own_folder_ / "a.splats";
};

TEST_F(InterruptedConversion, KilledItIsResumed) {
  for (const int bricks : {-1, 0, 1, 6}) {
    if (bricks % 6 != 0 && !faults::isWholeSweep()) continue;
    SCOPED_TRACE(bricks);
    const auto program = startedUntil(bricks);
    program->signal(SIGKILL);
    EXPECT_EQ(program->wait().status, 128 + SIGKILL);
    expectUnfinished();
    const fs::path statistics = *folder_ / "stats.json";
    const ProgramResult resumed = run(convert({"--resume", "--stats", statistics, "--threads", "1"}));
    expectWhole();
    const auto json = jsonOf(statistics);
    EXPECT_EQ(json["resumed"], bricks > 0);
    if (bricks > 0) {
      EXPECT_GE(json["resumed_bricks"], bricks);
      expectSays(resumed.err, "resumed");
    }
    fs::remove_all(output_);
  }
}

TEST_F(InterruptedConversion, KilledItBlocksAnotherToTheSameOutput) {
  const auto program = startedUntil(1);
  program->signal(SIGKILL);
  program->wait();
  expectRefused(convert({}), 1, {"--resume"});
  const ProgramResult different = runProgram(convert({"--resume", "--blank", "7"}));
  EXPECT_EQ(different.status, 1);
  expectSays(different.err, "--blank has changed from none to 7");
  run(convert({"--overwrite"}));
  expectWhole();
}

TEST_F(InterruptedConversion, StoppedItPrintsHowToContinue) {
  for (const int signal : {SIGINT, SIGTERM}) {
    if (signal == SIGINT && !faults::isWholeSweep()) continue;  // StoppedEarlyItLeavesNothing
    // On a busy machine the signal may come when all is done: then it is tried again.
    ProgramResult stopped;
    for (int attempt = 0; attempt < 5; ++attempt) {
      fs::remove_all(output_);
      const auto program = startedUntil(1);
      program->signal(signal);
      stopped = program->wait();
      if (stopped.status != 0) break;
    }
    expectRefused(stopped, 128 + signal, {"--resume"});
    expectUnfinished();
    const ProgramResult resumed = run(convert({"--resume"}));
    expectSays(resumed.err, "resumed");
    expectWhole();
    fs::remove_all(output_);
  }
}

TEST_F(InterruptedConversion, StoppedEarlyItLeavesNothing) {
  FolderWatch outside(own_folder_.path());
  RunningProgram program(wordsFor(output_, {"--threads", "1"}));
  outside.waitUntil([&] { return fs::exists(partial()); });
  program.signal(SIGINT);
  const ProgramResult stopped = program.wait();
  expectRefused(stopped, 128 + SIGINT, {});
  EXPECT_EQ(entriesOf(output_.parent_path()), 0u);
}

TEST_F(InterruptedConversion, LocksItsOutput) {
  const auto program = startedUntil(0);
  program->signal(SIGSTOP);
  for (const char* word : {"--resume", "--overwrite"}) {
    expectRefused(convert({word}), 1, {"another conversion"});
  }
  program->signal(SIGCONT);
  const ProgramResult first = program->wait();
  EXPECT_EQ(first.status, 0) << first.err;
  expectWhole();
}

/// A small file system of its own; for root only.
class SmallDisk {
 public:
  explicit SmallDisk(fs::path folder) : folder_(std::move(folder)) {
    fs::create_directory(folder_);
    mounted_ = ::mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=256m") == 0;
    why_ = mounted_ ? "" : std::strerror(errno);
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(folder_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool mounted() const { return mounted_; }
  const std::string& why() const { return why_; }

  /// Takes all that is free.
  void fill() const {
    const std::vector<char> ballast(size_t{1} << 20, 'x');
    const int fd = ::open((folder_ / "ballast").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    while (::write(fd, ballast.data(), ballast.size()) > 0) {
    }
    ::close(fd);
  }
  void empty() const { fs::remove(folder_ / "ballast"); }

 private:
  fs::path folder_;
  bool mounted_ = false;
  std::string why_;
};

TEST_F(InterruptedConversion, OnAFullDiskLosesNothing) {
  const SmallDisk disk(own_folder_ / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "no small disk can be mounted: " << disk.why();
  output_ = own_folder_ / "disk/a.splats";
  fs::copy(*folder_ / "a.splats", output_);
  const auto program = startedUntil(0, {"--overwrite"});
  program->signal(SIGSTOP);
  disk.fill();
  program->signal(SIGCONT);
  const ProgramResult failed = program->wait();
  expectRefused(failed, 1, {"No space left on device"});
  disk.empty();
  expectWhole();  // the old one
}

TEST_F(InterruptedConversion, OnAFullDiskKeepsFinishedWorkForResuming) {
  const SmallDisk disk(own_folder_ / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "no small disk can be mounted: " << disk.why();
  output_ = own_folder_ / "disk/a.splats";
  const auto program = startedUntil(1, {"--resume"});
  program->signal(SIGSTOP);
  disk.fill();
  program->signal(SIGCONT);
  const ProgramResult failed = program->wait();
  expectRefused(failed, 1, {"continue with --resume"});
  disk.empty();
  expectUnfinished();
  run(convert({"--resume"}));
  expectWhole();
}

}  // namespace
}  // namespace curvisplat
