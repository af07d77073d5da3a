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
#include <nlohmann/json.hpp>
#include <optional>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/support/folder_watch.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

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

class InterruptedConversion : public testing::Test {
 protected:
  // So many that the least memory takes several buckets.
  static void SetUpTestSuite() {
    inputs_ = std::make_unique<TemporaryFolder>();
    Progress progress;
    writePlot3d(SceneGridSource(makeScene("wake"), {160, 100, 90}), *inputs_ / "in", progress);
    const fs::path undisturbed = *inputs_ / "a.splats";
    ASSERT_EQ(runProgram(wordsFor(undisturbed, {})).status, 0);
    expected_ = checksumsOf(undisturbed);
  }
  static void TearDownTestSuite() { inputs_.reset(); }

  static std::vector<std::string> wordsFor(const fs::path& output, std::vector<std::string> more) {
    std::vector<std::string> words{
        "convert", *inputs_ / "in.xyz", *inputs_ / "in.fun", "-o", output, "--memory", "192M"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  ProgramResult convert(std::vector<std::string> more) const { return runProgram(wordsFor(output_, more)); }

  /// Starts a conversion, and returns once it has appended `bricks`.
  std::unique_ptr<RunningProgram> startedUntil(int bricks, std::vector<std::string> more = {}) const {
    FolderWatch outside(output_.parent_path());
    auto program = std::make_unique<RunningProgram>(wordsFor(output_, more));
    outside.waitUntil([&] { return fs::exists(partial()); });
    FolderWatch inside(partial());
    inside.waitUntil([&] { return bricksAppended() >= bricks; });
    return program;
  }

  int bricksAppended() const {
    constexpr uintmax_t kLogEntryBytes = 200;  // stream/brick_log.h, with one variable
    std::error_code error;
    const auto bytes = fs::file_size(partial() / "bricks.log", error);
    return error ? -1 : static_cast<int>(bytes / kLogEntryBytes);
  }

  fs::path partial() const { return output_.string() + ".partial"; }

  void expectUnfinished() const {
    for (const fs::path& path : {output_, partial()}) {
      const ProgramResult info = runProgram({"info", path});
      EXPECT_EQ(info.status, 1) << info.out;
      EXPECT_EQ(lineCount(info.err), 1) << info.err;
    }
  }

  /// The cache is there, as if nothing had happened, and nothing else is.
  void expectWhole() const {
    EXPECT_TRUE(checksumsOf(output_) == expected_);
    EXPECT_EQ(entries(), 1);
  }
  long entries() const { return std::distance(fs::directory_iterator(output_.parent_path()), {}); }

  static std::unique_ptr<TemporaryFolder> inputs_;
  static std::map<std::string, uint64_t> expected_;
  const TemporaryFolder folder_;
  fs::path output_ = folder_ / "a.splats";
};

std::unique_ptr<TemporaryFolder> InterruptedConversion::inputs_;
std::map<std::string, uint64_t> InterruptedConversion::expected_;

TEST_F(InterruptedConversion, KilledItIsResumed) {
  for (const int bricks : {-1, 0, 1, 12}) {
    SCOPED_TRACE(bricks);
    const auto program = startedUntil(bricks);
    program->signal(SIGKILL);
    EXPECT_EQ(program->wait().status, 128 + SIGKILL);
    expectUnfinished();
    const fs::path statistics = *inputs_ / "stats.json";
    const ProgramResult resumed = convert({"--resume", "--stats", statistics, "--threads", "1"});
    EXPECT_EQ(resumed.status, 0) << resumed.err;
    expectWhole();
    const auto json = nlohmann::json::parse(readTextFile(statistics));
    EXPECT_EQ(json["resumed"], bricks > 0);
    if (bricks > 0) {
      EXPECT_GE(json["resumed_bricks"], bricks);
      EXPECT_NE(resumed.err.find("resumed"), std::string::npos) << resumed.err;
    }
    fs::remove_all(output_);
  }
}

TEST_F(InterruptedConversion, KilledItBlocksAnotherToTheSameOutput) {
  const auto program = startedUntil(1);
  program->signal(SIGKILL);
  program->wait();
  const ProgramResult another = convert({});
  EXPECT_EQ(another.status, 1);
  EXPECT_EQ(lineCount(another.err), 1) << another.err;
  EXPECT_NE(another.err.find("--resume"), std::string::npos) << another.err;
  const ProgramResult different = convert({"--resume", "--blank", "7"});
  EXPECT_EQ(different.status, 1);
  EXPECT_NE(different.err.find("--blank has changed from none to 7"), std::string::npos) << different.err;
  EXPECT_EQ(convert({"--overwrite"}).status, 0);
  expectWhole();
}

TEST_F(InterruptedConversion, StoppedItPrintsHowToContinue) {
  for (const int signal : {SIGINT, SIGTERM}) {
    // On a busy machine the signal may come when all is done: then it is tried again.
    ProgramResult stopped;
    for (int attempt = 0; attempt < 5; ++attempt) {
      fs::remove_all(output_);
      const auto program = startedUntil(1);
      program->signal(signal);
      stopped = program->wait();
      if (stopped.status != 0) break;
    }
    EXPECT_EQ(stopped.status, 128 + signal) << stopped.err;
    EXPECT_EQ(lineCount(stopped.err), 1) << stopped.err;
    EXPECT_NE(stopped.err.find("--resume"), std::string::npos) << stopped.err;
    expectUnfinished();
    const ProgramResult resumed = convert({"--resume"});
    EXPECT_EQ(resumed.status, 0) << resumed.err;
    EXPECT_NE(resumed.err.find("resumed"), std::string::npos) << resumed.err;
    expectWhole();
    fs::remove_all(output_);
  }
}

TEST_F(InterruptedConversion, StoppedEarlyItLeavesNothing) {
  FolderWatch outside(folder_.path());
  RunningProgram program(wordsFor(output_, {}));
  outside.waitUntil([&] { return fs::exists(partial()); });
  program.signal(SIGINT);
  const ProgramResult stopped = program.wait();
  EXPECT_EQ(stopped.status, 128 + SIGINT) << stopped.err;
  EXPECT_EQ(lineCount(stopped.err), 1) << stopped.err;
  EXPECT_EQ(entries(), 0);
}

TEST_F(InterruptedConversion, LocksItsOutput) {
  const auto program = startedUntil(0);
  program->signal(SIGSTOP);
  for (const char* word : {"--resume", "--overwrite"}) {
    const ProgramResult second = convert({word});
    EXPECT_EQ(second.status, 1);
    EXPECT_EQ(lineCount(second.err), 1) << second.err;
    EXPECT_NE(second.err.find("another conversion"), std::string::npos) << second.err;
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
  const SmallDisk disk(folder_ / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "no small disk can be mounted: " << disk.why();
  output_ = folder_ / "disk/a.splats";
  fs::copy(*inputs_ / "a.splats", output_);
  const auto program = startedUntil(0, {"--overwrite"});
  program->signal(SIGSTOP);
  disk.fill();
  program->signal(SIGCONT);
  const ProgramResult failed = program->wait();
  EXPECT_EQ(failed.status, 1);
  EXPECT_EQ(lineCount(failed.err), 1) << failed.err;
  EXPECT_NE(failed.err.find("No space left on device"), std::string::npos) << failed.err;
  disk.empty();
  expectWhole();  // the old one
}

TEST_F(InterruptedConversion, OnAFullDiskKeepsFinishedWorkForResuming) {
  const SmallDisk disk(folder_ / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "no small disk can be mounted: " << disk.why();
  output_ = folder_ / "disk/a.splats";
  const auto program = startedUntil(1, {"--resume"});
  program->signal(SIGSTOP);
  disk.fill();
  program->signal(SIGCONT);
  const ProgramResult failed = program->wait();
  EXPECT_EQ(failed.status, 1);
  EXPECT_EQ(lineCount(failed.err), 1) << failed.err;
  EXPECT_NE(failed.err.find("continue with --resume"), std::string::npos) << failed.err;
  disk.empty();
  expectUnfinished();
  const ProgramResult resumed = convert({"--resume"});
  EXPECT_EQ(resumed.status, 0) << resumed.err;
  expectWhole();
}

}  // namespace
}  // namespace curvisplat
