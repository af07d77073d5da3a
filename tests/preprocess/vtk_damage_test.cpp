// Damaged VTK files: truncated, and with one byte changed. The reader refuses them in words, or reads
// well-formed data in which only what the byte stands for has changed; it asks for no more memory than a
// small file implies.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <optional>
#include <random>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/memory_limit.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

using test::TestFolder;

// The files have some tens of KiB; readers have buffers.
constexpr uint64_t kMoreMemory = uint64_t{64} << 20;
constexpr uint64_t kMaxRows = 4096;

/// All that a grid holds, in one row of numbers; of blocks that claim to be huge, the beginning.
struct Content {
  std::vector<std::string> names;
  std::vector<std::array<uint64_t, 3>> blocks;
  std::vector<double> numbers;
};

Content contentOf(const std::filesystem::path& path) {
  OpenGridOptions options;
  options.grid = path;
  options.temporary_folder = path.parent_path();
  const auto source = openGrid(options);
  Content content;
  for (const GridScalar& scalar : source->description().scalars) content.names.push_back(scalar.name);
  std::vector<uint32_t> scalars(content.names.size());
  std::iota(scalars.begin(), scalars.end(), 0u);
  for (uint32_t b = 0; b < source->description().blocks.size(); ++b) {
    const GridBlock& block = source->description().blocks[b];
    content.blocks.push_back({block.ni, block.nj, block.nk});
    if (block.ni > kMaxRows) continue;
    NodeArrays nodes;
    source->read(b, {0, std::min<uint64_t>(block.nj, 64), 0, std::min<uint64_t>(block.nk, 64)}, scalars,
                 nodes);
    for (const auto* axis : {&nodes.x, &nodes.y, &nodes.z})
      content.numbers.insert(content.numbers.end(), axis->begin(), axis->end());
    for (const auto& values : nodes.scalars)
      content.numbers.insert(content.numbers.end(), values.begin(), values.end());
    content.numbers.insert(content.numbers.end(), nodes.blank.begin(), nodes.blank.end());
  }
  return content;
}

struct Ending {
  enum class Kind { kSame, kChanged, kRefused } kind = Kind::kSame;
  size_t changed = 0;  // numbers, if the names and blocks are as they were
  std::string error;
};

/// The ending of reading a damaged file; fails the test where it must not end so.
Ending endingOf(const std::filesystem::path& path, const Content& whole, const std::string& what) {
  Ending ending;
  try {
    std::optional<test::MemoryLimit> limit;
    if (!kIsSanitized) limit.emplace(kMoreMemory);
    const Content content = contentOf(path);
    if (content.names == whole.names && content.blocks == whole.blocks) {
      for (size_t n = 0; n < whole.numbers.size(); ++n) {
        const double a = content.numbers[n], b = whole.numbers[n];
        ending.changed += a != b && !(std::isnan(a) && std::isnan(b));
      }
      if (ending.changed == 0) return ending;
    }
    ending.kind = Ending::Kind::kChanged;
  } catch (const Error& error) {
    ending.kind = Ending::Kind::kRefused;
    ending.error = error.what();
    EXPECT_EQ(ending.error.find('\n'), std::string::npos) << what << ": " << ending.error;
    EXPECT_NE(ending.error.find(path.parent_path().string()), std::string::npos)
        << what << ": " << ending.error;
  } catch (const std::exception& exception) {
    ADD_FAILURE() << what << ": " << exception.what();
  }
  return ending;
}

/// Truncations and wrong bytes of a file: all with tools/test.sh --whole, usually one in four.
constexpr size_t kTruncations = 100, kWrongBytes = 1000;
size_t tried(size_t of_all) {
  return faults::isWholeSweep() ? of_all : of_all / 4;
}

struct DamagedFile {
  std::string name;                     // with the extension
  std::optional<VtsEncoding> encoding;  // else it is one of tests/data
  std::string bytes;  // of which the tests' list has none: it is made whenever the program starts
  size_t data_begins = std::string::npos;  // bytes from here on are stored numbers
  size_t most_changed = 0;                 // numbers, by one of these bytes; 0: such a byte is refused
};

void PrintTo(const DamagedFile& file, std::ostream* out) {
  *out << file.name;
}

std::string made(const char* name) {
  return readTextFile(std::filesystem::path(CURVISPLAT_TEST_DATA) / "vtk" / name);
}

std::vector<DamagedFile> damagedFiles() {
  std::vector<DamagedFile> files;
  for (VtsEncoding encoding : allVtsEncodings()) {
    if (encoding.header_bytes == 8 && !encoding.big_endian) continue;  // enough of them
    encoding.block_bytes = 200;
    DamagedFile file;
    file.name = encoding.describe() + ".vts";
    for (char& c : file.name)
      if (c == ' ' || c == '-') c = '_';
    file.encoding = encoding;
    // Vectors: a component, and the magnitude; a coordinate; base64: two numbers may share a character. LZ4
    // has no checksum: a whole block may change, 50 numbers, each vector with its magnitude.
    if (encoding.format == VtsEncoding::Format::kAppendedRaw) file.most_changed = 2;
    if (encoding.format == VtsEncoding::Format::kAppendedBase64) file.most_changed = 4;
    if (encoding.compressor == VtsEncoding::Compressor::kLz4 && file.most_changed > 0)
      file.most_changed = 2 * 50 + 2;
    if (encoding.compressor == VtsEncoding::Compressor::kZlib ||
        encoding.compressor == VtsEncoding::Compressor::kLzma)
      file.most_changed = 0;
    files.push_back(std::move(file));
  }
  for (const char* const name :
       {"structured_ascii.vtk", "structured_binary.vtk", "rectilinear_binary.vtk", "rectilinear_ascii.vtk",
        "uniform_binary.vtk", "turned.vti", "rectilinear.vtr", "blanked.vts", "ghosts_1.vts"})
    files.push_back({name, std::nullopt, {}, std::string::npos, 0});
  return files;
}

DamagedFile withBytes(DamagedFile file) {
  file.bytes = file.encoding ? vtsFile(annulusVtsGrid(5, 4, 4), *file.encoding, &file.data_begins)
                             : made(file.name.c_str());
  return file;
}

class VtkDamage : public testing::TestWithParam<DamagedFile> {
 protected:
  std::filesystem::path write(const std::string& bytes) const {
    return folder_.write(GetParam().name, bytes);
  }

  TestFolder folder_{"vtk-damage"};
  const DamagedFile file_ = withBytes(GetParam());
  const Content whole_ = contentOf(write(file_.bytes));
};

TEST_P(VtkDamage, TruncatedFilesAreRefused) {
  const std::string& bytes = file_.bytes;
  size_t refused = 0;
  const size_t count = tried(kTruncations);
  for (size_t n = 0; n < count; ++n) {
    const size_t size = bytes.size() * n / count;
    const Ending ending = endingOf(write(bytes.substr(0, size)), whole_, fmt::format("cut at {}", size));
    refused += ending.kind == Ending::Kind::kRefused;
    // XML files say where they end. Legacy ones may end behind any of their parts.
    const bool tells_its_end = !file_.name.ends_with(".vtk");
    EXPECT_FALSE(tells_its_end && ending.kind == Ending::Kind::kChanged) << size;
  }
  EXPECT_GE(10 * refused, 9 * count);
}

TEST_P(VtkDamage, AWrongByteIsRefusedOrChangesWhatItStandsFor) {
  const std::string& bytes = file_.bytes;
  std::mt19937_64 random(5);
  size_t refused = 0, changed = 0, in_data = 0;
  for (size_t n = 0; n < tried(kWrongBytes); ++n) {
    std::string damaged = bytes;
    const size_t at = random() % damaged.size();
    damaged[at] = static_cast<char>(damaged[at] ^ static_cast<char>(1 + random() % 255));
    const Ending ending = endingOf(write(damaged), whole_, fmt::format("byte {}", at));
    refused += ending.kind == Ending::Kind::kRefused;
    changed += ending.kind == Ending::Kind::kChanged;
    if (at < file_.data_begins || ending.kind != Ending::Kind::kChanged) continue;
    ++in_data;
    EXPECT_GT(ending.changed, 0u) << "byte " << at;
    EXPECT_LE(ending.changed, file_.most_changed) << "byte " << at;
  }
  EXPECT_GT(refused, tried(20));
  EXPECT_GT(refused + changed, tried(300));
  EXPECT_TRUE(file_.most_changed == 0 || in_data > tried(50)) << in_data;
}

INSTANTIATE_TEST_SUITE_P(Files, VtkDamage, testing::ValuesIn(damagedFiles()), [](const auto& file) {
  return file.param.name.substr(0, file.param.name.rfind('.')) + "_" +
         file.param.name.substr(file.param.name.rfind('.') + 1);
});

// Sets and series: the file that names others.
TEST(VtkDamageOfSets, AreRefusedOrReadOtherwise) {
  const TestFolder folder("vtk-damaged-sets");
  for (const char* const name : {"ghosts_0.vts", "ghosts_1.vts", "ghosts_2.vts", "ghosts_3.vts", "step0.vts",
                                 "step1.vts", "step2.vts"})
    folder.write(name, made(name));
  std::filesystem::create_directory(folder.path() / "blocks");
  for (const char* const name : {"blocks/blocks_0.vts", "blocks/blocks_1.vtp", "blocks/blocks_2.vts"})
    folder.write(name, made(name));
  std::mt19937_64 random(9);
  for (const char* const name : {"ghosts.pvts", "blocks.vtm", "series.pvd"}) {
    const std::string bytes = made(name);
    const Content whole = contentOf(folder.write(name, bytes));
    for (size_t n = 0; n < tried(kTruncations); ++n) {
      const size_t size = bytes.size() * n / tried(kTruncations);
      const Ending ending =
          endingOf(folder.write(name, bytes.substr(0, size)), whole, fmt::format("cut at {}", size));
      EXPECT_EQ(ending.kind, Ending::Kind::kRefused) << name << " " << size;
    }
    for (size_t n = 0; n < tried(kWrongBytes); ++n) {
      std::string damaged = bytes;
      const size_t at = random() % damaged.size();
      damaged[at] = static_cast<char>(damaged[at] ^ static_cast<char>(1 + random() % 255));
      endingOf(folder.write(name, damaged), whole, fmt::format("{} byte {}", name, at));
    }
  }
}

// Heads that promise far more than a file has.
TEST(VtkDamageOfNames, BytesThatATerminalDoesNotPrintAreLeftOut) {
  const TestFolder folder("vtk-names");
  const std::string name = "\x1b[2J\xff\x80" + std::string(200, 'n');
  for (const std::string& end : {std::string(), "</" + name + "x>"}) {
    const std::filesystem::path path =
        folder.write("a.vts", "<VTKFile type=\"StructuredGrid\"><" + name + ">" + end);
    const std::string line = errorOf([&] { contentOf(path); });
    EXPECT_FALSE(line.empty());
    EXPECT_TRUE(std::all_of(line.begin(), line.end(), [](char c) { return c >= ' ' && c <= '~'; })) << line;
    EXPECT_LT(line.size(), 300u) << line;
  }
}

TEST(VtkDamageOfSizes, HugeCountsAreRefusedBeforeAnythingIsAllocated) {
  const TestFolder folder("vtk-huge");
  for (const VtsEncoding& encoding : allVtsEncodings()) {
    std::string file = vtsFile(annulusVtsGrid(5, 4, 4), encoding);
    for (size_t at; (at = file.find("0 4 0 3 0 3")) != std::string::npos;)
      file.replace(at, 11, "0 40000 0 30000 0 30000");
    const Ending ending = endingOf(folder.write("huge.vts", file), {}, encoding.describe());
    EXPECT_EQ(ending.kind, Ending::Kind::kRefused) << encoding.describe();
  }
}

}  // namespace
}  // namespace curvisplat
