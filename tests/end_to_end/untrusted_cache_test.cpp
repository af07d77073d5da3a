// Caches that somebody has made to do harm. Their checksums are right, since whoever makes a cache can
// compute them. `info` and `render` end with status 1 and one line, within little memory.
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/stream_file.h"
#include "stream/codec/geometry_codec.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/memory_limit.h"
#include "tests/support/program_test.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kMax32 = std::numeric_limits<uint32_t>::max();
constexpr uint64_t kMax64 = std::numeric_limits<uint64_t>::max();

/// Runs the program where it gets two GiB of addresses: some times what it takes for a small cache, of which
/// most are libraries and threads' stacks, and less than the caches here ask for. Sanitizers need more than
/// there are.
ProgramResult runWithLittleMemory(Words arguments) {
  if (kIsSanitized) return runProgram(arguments);
  Words words{"-c", "ulimit -v 2097152; exec \"$0\" \"$@\"", CURVISPLAT_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return RunningProgram(words, "/bin/sh").wait();
}

/// A small cache, taken apart: a root, eight cells below it, leaves below them. One scalar.
struct HostileCache {
  explicit HostileCache(fs::path folder) : path(std::move(folder)) {
    writeRandomCache(path, 1, 200);
    manifest = nlohmann::ordered_json::parse(bytesOfFile(path / "manifest.json"));
    manifest.erase("checksum");
    geometry = bytesOfFile(path / "geometry.bin");
    read(bytesOfFile(path / "bricks.bin"), bricks_header, sizeof(BricksHeader), bricks);
    values = bytesOfFile(path / "var.0.bin");
    std::memcpy(&values_header, values.data(), sizeof values_header);
    read(values, values_header, values_header.table_offset, variables);
    values.resize(values_header.table_offset);
  }

  template <typename Header, typename Record>
  static void read(const std::string& bytes, Header& header, uint64_t table, std::vector<Record>& records) {
    std::memcpy(&header, bytes.data(), sizeof header);
    records.resize(header.bricks);
    std::memcpy(records.data(), &bytes[table], records.size() * sizeof(Record));
  }

  /// Puts another stream in the place of a brick's geometry.
  void replaceGeometry(size_t brick, std::span<const std::byte> stream) {
    bricks[brick].geometry_offset = geometry.size();
    bricks[brick].geometry_length = static_cast<uint32_t>(stream.size());
    bricks[brick].geometry_checksum = checksumOf(stream);
    geometry.append(reinterpret_cast<const char*>(stream.data()), stream.size());
  }

  void write() {
    std::memcpy(values.data(), &values_header, sizeof values_header);
    const auto put = [&](const char* name, const std::string& bytes, uint64_t checksum, uint64_t size) {
      overwriteFile(path / name, bytes);
      if (size > bytes.size()) fs::resize_file(path / name, size);
      for (auto& file : manifest["files"])
        if (file["name"] == name)
          file = {{"name", name},
                  {"size", std::max<uint64_t>(size, bytes.size())},
                  {"checksum", fmt::format("{:016x}", checksum)}};
    };
    Checksum of_bricks, of_values;
    of_bricks.add(bytesOf(bricks_header));
    of_bricks.add(bytesOf(bricks));
    of_values.add(bytesOf(values_header));
    of_values.add(bytesOf(variables));
    std::vector<Brick> plain;
    for (const BrickRecord& record : bricks) plain.push_back(brickOf(record));
    put("bricks.bin", textOf(bytesOf(bricks_header)) + textOf(bytesOf(bricks)), of_bricks.value(),
        bricks_bytes);
    put("geometry.bin", geometry, geometryChecksum(plain), geometry_bytes);
    put("var.0.bin", values + textOf(bytesOf(variables)), of_values.value(), 0);
    overwriteFile(path / "manifest.json", manifest.dump());
  }

  static std::string textOf(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

  fs::path path;
  nlohmann::ordered_json manifest;
  BricksHeader bricks_header;
  VariableHeader values_header;
  std::vector<BrickRecord> bricks;
  std::vector<VariableRecord> variables;
  std::string geometry, values;
  uint64_t bricks_bytes = 0, geometry_bytes = 0;  // sizes that files pretend to have
};

class UntrustedCache : public ProgramTest {
 protected:
  using Harm = std::function<void(HostileCache& cache)>;

  fs::path harmed(const Harm& harm) {
    HostileCache cache(folder_ / fmt::format("{}.splats", count_++));
    harm(cache);
    cache.write();
    return cache.path;
  }

  ProgramResult render(const fs::path& cache, const Words& more = {}) const {
    return runWithLittleMemory(Words{"render", cache.string(), "-o", file("a.png"), "--size", "40x30",
                                     "--lod-pixels", "0", "--memory", "128M", "--threads", "2"} +
                               more);
  }

  /// Expects that no command opens the cache. Usually one of them, in turn.
  void expectNoneOpens(const fs::path& cache, const std::string& says) {
    const int turn = turn_++ % 3;
    const auto isTried = [turn](int n) { return n == turn || faults::isWholeSweep(); };
    if (isTried(0)) expectRefused(render(cache), 1, {says});
    if (isTried(1)) expectRefused(runWithLittleMemory({"info", cache.string()}), 1, {says});
    if (isTried(2)) expectRefused(runWithLittleMemory({"bench", cache.string(), "--quick"}), 1, {says});
  }
  void expectNoneOpens(const std::string& says, const Harm& harm) {
    SCOPED_TRACE("to be refused: " + says);
    expectNoneOpens(harmed(harm), says);
  }
  /// Expects that the cache opens, since opening reads no payload; who reads the brick refuses it.
  void expectBrickRefused(const std::string& says, const Harm& harm) {
    SCOPED_TRACE("to be refused: " + says);
    const fs::path cache = harmed(harm);
    EXPECT_EQ(runWithLittleMemory({"info", cache.string()}).status, 0);
    expectRefused(render(cache), 1, {says});
    expectSays(findingsIn(cache), says);
    EXPECT_EQ(render(cache, {"--keep-going"}).status, 0);
  }

  /// The findings of `info --verify`. Splats are random, so that some findings are about weights.
  static std::string findingsIn(const fs::path& cache) {
    return runWithLittleMemory({"info", cache.string(), "--verify"}).out;
  }

  int count_ = 0, turn_ = 0;
};

TEST_F(UntrustedCache, IsReadIfItIsSound) {
  const fs::path cache = harmed([](HostileCache&) {});
  EXPECT_EQ(runWithLittleMemory({"info", cache.string()}).status, 0);
  EXPECT_EQ(findingsIn(cache).find("finding: brick"), std::string::npos);
  const ProgramResult result = render(cache);
  EXPECT_EQ(result.status, 0) << result.err;
}

TEST_F(UntrustedCache, NamesStayInItsFolder) {
  for (const char* name : {"../geometry.bin", "/etc/passwd", "..", "", "a/b"})
    expectNoneOpens("a plain file name",
                    [&](HostileCache& cache) { cache.manifest["steps"][0]["geometry"] = name; });
  expectNoneOpens("a plain file name",
                  [](HostileCache& cache) { cache.manifest["files"][0]["name"] = "../../bricks.bin"; });
}

TEST_F(UntrustedCache, LinksAndOtherThingsThanFilesAreNotOpened) {
  for (const char* name : {"manifest.json", "bricks.bin", "geometry.bin", "var.0.bin"}) {
    SCOPED_TRACE(name);
    const fs::path cache = harmed([](HostileCache&) {});
    fs::rename(cache / name, folder_ / name);
    fs::create_symlink(folder_ / name, cache / name);
    expectNoneOpens(cache, "is a symbolic link");
    fs::remove(cache / name);
    ASSERT_EQ(::mkfifo((cache / name).c_str(), 0600), 0);  // who opens it waits for ever
    expectNoneOpens(cache, "is not a regular file");
  }
}

TEST_F(UntrustedCache, SizesAndOffsetsDoNotOverflow) {
  expectNoneOpens("outside of the file", [](HostileCache& cache) {
    cache.bricks[3].geometry_offset = kMax64 - 100;  // the end is within the file again
  });
  expectNoneOpens("outside of the file",
                  [](HostileCache& cache) { cache.variables[3].offset = kMax64 - 100; });
  expectNoneOpens("its size is",
                  [](HostileCache& cache) { cache.values_header.table_offset = kMax64 - 1000; });
  expectNoneOpens("its size is", [](HostileCache& cache) {
    cache.bricks_header.bricks += uint64_t{1} << 60;  // times the size of a record is the same
  });
  expectNoneOpens("its octants have", [](HostileCache& cache) {
    std::fill_n(cache.bricks[0].octant_splats, 8, kMax32);
    cache.bricks[0].octant_splats[0] += cache.bricks[0].splats + 8;
  });
  expectNoneOpens("children from brick", [](HostileCache& cache) { cache.bricks[1].child_count = kMax32; });
  expectNoneOpens("children from brick", [](HostileCache& cache) {
    cache.bricks[1].first_child = kMax32 - 1;
    cache.bricks[1].child_count = 3;
  });
}

TEST_F(UntrustedCache, CountsAreCheckedBeforeMemoryIsAllocated) {
  expectNoneOpens("it has 4294967295 splats", [](HostileCache& cache) { cache.bricks[0].splats = kMax32; });
  expectNoneOpens("bricks", [](HostileCache& cache) { cache.manifest["bricks"] = 0x7fffffff; });
  // A file of 288 GiB that takes no space.
  expectNoneOpens("brick ", [](HostileCache& cache) {
    cache.bricks_header.bricks = 0x7fffffff;
    cache.manifest["bricks"] = 0x7fffffff;
    cache.bricks_bytes = sizeof(BricksHeader) + uint64_t{0x7fffffff} * sizeof(BrickRecord);
  });
  expectNoneOpens("is too long for", [](HostileCache& cache) {
    cache.bricks[5].geometry_offset = cache.geometry.size();
    cache.bricks[5].geometry_length = 0xf0000000;
    cache.geometry_bytes = cache.geometry.size() + 0xf0000000;
  });
  expectNoneOpens("a whole number from 1 to 25",
                  [](HostileCache& cache) { cache.manifest["levels"] = kMax32; });
  expectNoneOpens("cannot be opened", [](HostileCache& cache) {
    auto& variables = cache.manifest["variables"];
    for (int n = 1; n < 50000; ++n)
      variables.push_back({{"number", n}, {"name", std::to_string(n)}, {"unit", ""}, {"min", 0}, {"max", 1}});
  });
  expectNoneOpens("brackets more than", [](HostileCache& cache) {
    // A hundred are enough to tell; a program that goes down them needs more to run out of its stack.
    auto deep = nlohmann::ordered_json::array();
    for (int n = 0; n < 100; ++n) deep = nlohmann::ordered_json::array({deep});
    cache.manifest["title"] = deep;
  });
  expectNoneOpens("expected at most",
                  [](HostileCache& cache) { cache.manifest["title"] = std::string(18'000'000, 'x'); });
}

/// Header and frame of a leaf's geometry, for frames that are not what they say.
class Bomb {
 public:
  explicit Bomb(const HostileCache& cache, size_t brick) {
    const BrickRecord& record = cache.bricks[brick];
    const std::string stream = cache.geometry.substr(record.geometry_offset, record.geometry_length);
    header_ = stream.substr(0, sizeof(GeometryHeader));
    const std::string frame = stream.substr(sizeof(GeometryHeader));
    unpacked_ = ZSTD_getFrameContentSize(frame.data(), frame.size());
  }

  uint64_t unpacked() const { return unpacked_; }
  GeometryHeader header() const {
    GeometryHeader header;
    std::memcpy(&header, header_.data(), sizeof header);
    return header;
  }
  /// A zstd frame of `zeros` zeros; `sized`: with its size in its header.
  std::vector<std::byte> stream(const GeometryHeader& header, uint64_t zeros, bool sized = true) const {
    const std::string content(zeros, '\0');
    std::string frame(ZSTD_compressBound(content.size()), '\0');
    ZSTD_CCtx* const context = ZSTD_createCCtx();
    ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, sized);
    frame.resize(ZSTD_compress2(context, frame.data(), frame.size(), content.data(), content.size()));
    ZSTD_freeCCtx(context);
    std::vector<std::byte> bytes(sizeof header + frame.size());
    std::memcpy(bytes.data(), &header, sizeof header);
    std::memcpy(bytes.data() + sizeof header, frame.data(), frame.size());
    return bytes;
  }

 private:
  std::string header_;
  uint64_t unpacked_ = 0;
};

TEST_F(UntrustedCache, StreamsUnpackToWhatTheirRecordAllows) {
  constexpr size_t kBrick = 12;
  constexpr uint64_t kHuge = uint64_t{64} << 20;  // of zeros: 2 KiB packed
  expectBrickRefused("does not begin with a zstd frame of", [](HostileCache& cache) {
    const Bomb bomb(cache, kBrick);
    cache.replaceGeometry(kBrick, bomb.stream(bomb.header(), kHuge));
  });
  expectBrickRefused("does not begin with a zstd frame of", [](HostileCache& cache) {
    const Bomb bomb(cache, kBrick);
    cache.replaceGeometry(kBrick, bomb.stream(bomb.header(), kHuge, false));
  });
  expectBrickRefused("header is invalid", [](HostileCache& cache) {
    const Bomb bomb(cache, kBrick);
    GeometryHeader header = bomb.header();
    header.runs_bytes = static_cast<uint32_t>(kHuge);
    cache.replaceGeometry(kBrick, bomb.stream(header, kHuge + bomb.unpacked()));
  });
  // It says that it unpacks to little, and goes on: the size lies behind magic number and descriptor.
  expectBrickRefused("zstd cannot unpack it", [](HostileCache& cache) {
    const Bomb bomb(cache, kBrick);
    std::vector<std::byte> stream = bomb.stream(bomb.header(), kHuge);
    const auto said = static_cast<uint32_t>(bomb.unpacked());
    uint8_t descriptor;
    std::memcpy(&descriptor, &stream[sizeof(GeometryHeader) + 4], 1);
    ASSERT_EQ(descriptor >> 6, 2);  // four bytes of size
    const size_t at = sizeof(GeometryHeader) + (descriptor & 0x20 ? 5 : 6);
    std::memcpy(&stream[at], &said, sizeof said);
    cache.replaceGeometry(kBrick, stream);
  });
}

TEST_F(UntrustedCache, ItsTreeHasNoCycles) {
  expectNoneOpens("children from brick", [](HostileCache& cache) { cache.bricks[1].first_child = 1; });
  expectNoneOpens("children from brick", [](HostileCache& cache) { cache.bricks[1].first_child = 0; });
  expectNoneOpens("its parent is brick", [](HostileCache& cache) { cache.bricks[9].parent = 9; });
  expectNoneOpens("its parent is brick", [](HostileCache& cache) { cache.bricks[9].parent = 20; });
  expectNoneOpens("root with a parent", [](HostileCache& cache) { cache.bricks[0].parent = 1; });
  expectNoneOpens("leaf with a child", [](HostileCache& cache) { cache.bricks.back().first_child = 0; });
  expectNoneOpens("does not have it as a child", [](HostileCache& cache) { cache.bricks[9].parent = 2; });
  // One child of two.
  expectNoneOpens("roots and", [](HostileCache& cache) {
    cache.bricks[1].child_count = cache.bricks[2].first_child + 1 - cache.bricks[1].first_child;
  });
}

TEST_F(UntrustedCache, ItsNumbersAreFinite) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto nan = static_cast<float>(kNan), infinite = std::numeric_limits<float>::infinity();
  expectNoneOpens("is not inside its cell", [&](HostileCache& cache) { cache.bricks[2].lower[1] = kNan; });
  expectNoneOpens("is not inside its cell",
                  [&](HostileCache& cache) { cache.bricks[0].upper[2] = INFINITY; });
  expectNoneOpens("largest radius", [&](HostileCache& cache) { cache.bricks[2].largest_radius = nan; });
  expectNoneOpens("largest radius", [&](HostileCache& cache) { cache.bricks[2].largest_radius = infinite; });
  expectNoneOpens("its error is", [&](HostileCache& cache) { cache.bricks[2].error = nan; });
  expectNoneOpens("is invalid", [&](HostileCache& cache) { cache.variables[2].min = nan; });
  expectNoneOpens("is invalid",
                  [&](HostileCache& cache) { cache.variables[2].largest_deviation = infinite; });
  // Where the far corner of the cube is infinite, no box is outside of it.
  expectNoneOpens("three numbers of magnitude up to", [&](HostileCache& cache) {
    cache.manifest["root"]["min"] = {1.7e308, 1.7e308, 1.7e308};
    cache.manifest["root"]["size"] = 1.7e308;
    for (BrickRecord& brick : cache.bricks)
      std::fill_n(brick.lower, 3, INFINITY), std::fill_n(brick.upper, 3, INFINITY);
  });
  expectNoneOpens("three numbers of magnitude up to", [](HostileCache& cache) {
    cache.manifest["upper"] = {1e200, 1e200, 1e200};
  });
}

/// Watches what a program reads of one file.
class ReadWatch {
 public:
  explicit ReadWatch(const fs::path& file) : fd_(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK)) {
    if (fd_ < 0 || ::inotify_add_watch(fd_, file.c_str(), IN_OPEN | IN_ACCESS) < 0)
      throw std::system_error(errno, std::generic_category(), "inotify: " + file.string());
  }
  ~ReadWatch() { ::close(fd_); }
  ReadWatch(const ReadWatch&) = delete;
  ReadWatch& operator=(const ReadWatch&) = delete;

  /// Whether the file was opened since the last call.
  bool opened() {
    char events[4096];
    bool any = false;
    while (::read(fd_, events, sizeof events) > 0) any = true;
    return any;
  }

 private:
  int fd_;
};

TEST_F(UntrustedCache, ItsVdbIsNotOpenedOnTheWayToAPicture) {
  const fs::path cache = harmed([](HostileCache&) {});
  ReadWatch watch(cache / "bricks.vdb");
  EXPECT_EQ(render(cache).status, 0);
  EXPECT_EQ(runWithLittleMemory({"info", cache.string()}).status, 0);
  EXPECT_FALSE(watch.opened());
  const std::string picture = bytesOfFile(folder_ / "a.png");
  EXPECT_EQ(findingsIn(cache).find("bricks.vdb:"), std::string::npos);
  EXPECT_TRUE(watch.opened());

  overwriteFile(cache / "bricks.vdb", std::string(fs::file_size(cache / "bricks.vdb"), '\xff'));
  EXPECT_EQ(render(cache).status, 0);
  EXPECT_EQ(bytesOfFile(folder_ / "a.png"), picture);
  expectSays(findingsIn(cache), "bricks.vdb:");
}

}  // namespace
}  // namespace curvisplat
