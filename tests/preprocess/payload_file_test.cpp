#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <random>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/plot3d/plot3d_layout.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"

namespace curvisplat {
namespace {

using namespace test;

Bytes randomBytes(size_t count, std::mt19937_64& random) {
  Bytes bytes(count);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  return bytes;
}

Plot3dLayout withRecords(RecordMarkers records, ByteOrder order) {
  Plot3dLayout layout;
  layout.records = records;
  layout.byte_order = order;
  return layout;
}

PayloadFile openPayload(const std::filesystem::path& path, const Plot3dLayout& layout) {
  auto file = std::make_shared<InputFile>(path);
  const uint64_t size = file->size();
  return {std::move(file), size, layout.records, layout.byte_order};
}

TEST(PayloadFile, IsTheRecordsWithoutTheirMarkers) {
  const TestFolder folder("payload");
  std::mt19937_64 random(1);
  for (const RecordMarkers records : {RecordMarkers::kBytes4, RecordMarkers::kBytes8})
    for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig})
      for (const uint64_t subrecord : {0, 1, 7, 64}) {
        if (records == RecordMarkers::kBytes8 && subrecord > 0) continue;
        const Plot3dLayout layout = withRecords(records, order);
        Bytes file, expected;
        std::vector<uint64_t> sizes;
        for (const size_t size : {4, 0, 100, 1, 333}) {
          const Bytes record = randomBytes(size, random);
          appendRecord(file, record, layout, subrecord);
          expected.insert(expected.end(), record.begin(), record.end());
          sizes.push_back(size);
        }
        file.resize(file.size() + 3);
        PayloadFile payload = openPayload(folder.write("records", file), layout);
        for (const uint64_t size : sizes) EXPECT_EQ(payload.nextRecord(), size);
        EXPECT_EQ(payload.size(), expected.size());
        EXPECT_EQ(payload.bytesBehind(), 3u);
        for (int n = 0; n < 200; ++n) {
          const uint64_t begin = random() % (expected.size() + 1);
          const uint64_t count = random() % (expected.size() - begin + 1);
          Bytes found(count);
          payload.readAt(begin, found);
          EXPECT_TRUE(
              std::equal(found.begin(), found.end(), expected.begin() + static_cast<ptrdiff_t>(begin)));
          if (begin == expected.size()) continue;
          EXPECT_EQ(file[payload.offsetInFile(begin)], expected[begin]);
        }
        Bytes beyond(1);
        EXPECT_THROW(payload.readAt(expected.size(), beyond), Error);
      }
}

TEST(PayloadFile, EveryMarkerIsChecked) {
  const TestFolder folder("markers");
  std::mt19937_64 random(2);
  const Plot3dLayout layout = withRecords(RecordMarkers::kBytes4, ByteOrder::kLittle);
  Bytes file;
  appendRecord(file, randomBytes(40, random), layout, 16);  // 3 subrecords: 6 markers
  for (const size_t marker : {0, 20, 24, 44, 48, 60})
    for (size_t byte = marker; byte < marker + 4; ++byte) {
      Bytes damaged = file;
      damaged[byte] ^= std::byte{0x40};
      PayloadFile payload = openPayload(folder.write("records", damaged), layout);
      EXPECT_THROW(payload.nextRecord(), RecordMismatch) << byte;
    }
  // A second subrecord that says it is a first one, and a record that goes on behind the end.
  Bytes damaged = file, positive;
  appendNumber(positive, 16, ByteOrder::kLittle);
  std::copy(positive.begin(), positive.end(), damaged.begin() + 44);
  EXPECT_THROW(openPayload(folder.write("records", damaged), layout).nextRecord(), RecordMismatch);
  damaged = file;
  damaged.resize(48);
  EXPECT_THROW(openPayload(folder.write("records", damaged), layout).nextRecord(), RecordMismatch);
}

// 512 M nodes in single precision: a record of 6 GB, in the subrecords of gfortran, which cut through a
// value.
TEST(PayloadFile, RecordsOfSixGigabytesAreRead) {
  constexpr uint64_t kPart = 2147483639;
  constexpr uint64_t kNi = 1024, kNj = 1024, kNk = 512, kNodes = kNi * kNj * kNk;
  constexpr uint64_t kRecord = 12 * kNodes;
  const TestFolder folder("six-gigabytes");
  const Plot3dLayout layout = withRecords(RecordMarkers::kBytes4, ByteOrder::kBig);
  Bytes header, dimensions;
  for (const uint64_t n : {kNi, kNj, kNk})
    appendNumber(dimensions, static_cast<int32_t>(n), layout.byte_order);
  appendRecord(header, dimensions, layout);

  OutputFile file(folder.path() / "grid");  // sparse: it takes a few blocks of the disk
  file.append(std::span<const std::byte>(header));
  std::vector<uint64_t> part_begins;
  const auto writeNumber = [&](uint64_t offset, auto value) {
    Bytes bytes;
    appendNumber(bytes, value, layout.byte_order);
    file.writeAt(offset, bytes);
  };
  uint64_t at = header.size();
  for (uint64_t begin = 0; begin < kRecord; begin += kPart) {
    const uint64_t bytes = std::min(kPart, kRecord - begin);
    const auto size = static_cast<int32_t>(bytes);
    part_begins.push_back(at + 4);
    writeNumber(at, begin + bytes < kRecord ? -size : size);
    writeNumber(at + 4 + bytes, begin > 0 ? -size : size);
    at += 8 + bytes;
  }
  const auto writeValue = [&](uint64_t index, float value) {
    Bytes bytes;
    appendNumber(bytes, value, layout.byte_order);
    for (uint64_t b = 0; b < 4; ++b) {
      const uint64_t offset = 4 * index + b;
      file.writeAt(part_begins[offset / kPart] + offset % kPart, std::span(bytes).subspan(b, 1));
    }
  };
  const uint64_t across = kPart / 4;  // the value that the first part's end cuts
  writeValue(across, 0.625f);
  writeValue(2 * kNodes + kNodes - 1, -1.5f);  // the last z
  writeValue(kNodes + kNodes - kNi, 2.25f);    // y of the last row's first node
  file.close();

  OpenGridOptions options;
  options.grid = folder.path() / "grid";
  const auto source = openGrid(options);
  ASSERT_EQ(source->description().blocks[0].nodes(), kNodes);
  NodeArrays nodes;
  source->read(0, {kNj - 1, kNj, kNk - 1, kNk}, {}, nodes);
  EXPECT_EQ(nodes.z.back(), -1.5);
  EXPECT_EQ(nodes.y.front(), 2.25);
  const uint64_t row = across % kNodes / kNi;
  const uint64_t axis = across / kNodes;
  source->read(0, {row % kNj, row % kNj + 1, row / kNj, row / kNj + 1}, {}, nodes);
  const std::vector<double>* const axes[] = {&nodes.x, &nodes.y, &nodes.z};
  EXPECT_EQ((*axes[axis])[across % kNi], 0.625);
}

std::vector<double> spooled(const TestFolder& folder, const std::string& text) {
  const AsciiSpool spool = spoolAscii(InputFile(folder.write("text", text)), folder.path());
  std::vector<double> values(spool.count);
  spool.doubles->readAt(0, std::span(values));
  return values;
}

std::string spoolError(const TestFolder& folder, const std::string& text) {
  return curvisplat::errorOf([&] { spooled(folder, text); });
}

size_t files(const TestFolder& folder) {
  return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(folder.path()), {}));
}

TEST(AsciiSpool, ReadsNumbersAsFortranWritesThem) {
  const TestFolder folder("spool");
  EXPECT_EQ(spooled(folder, " 1\t-2.5, +3 ,4E2\r\n0.E+0 1.5D+01 2d-1 .5 -.25 1.5-101 7.25+3 6."),
            (std::vector<double>{1, -2.5, 3, 400, 0, 15, 0.2, 0.5, -0.25, 1.5e-101, 7250, 6}));
  EXPECT_EQ(spooled(folder, "3*1.5, 1*2 2*-4E-1"), (std::vector<double>{1.5, 1.5, 1.5, 2, -0.4, -0.4}));
  EXPECT_EQ(spooled(folder, ""), std::vector<double>{});
  EXPECT_EQ(spooled(folder, "\n \n"), std::vector<double>{});
}

TEST(AsciiSpool, ReadsNonFiniteNumbers) {
  const TestFolder folder("spool-nan");
  const std::vector<double> values = spooled(folder, "NaN -Infinity inf 1E400 1E-400");
  ASSERT_EQ(values.size(), 5u);
  EXPECT_TRUE(std::isnan(values[0]));
  EXPECT_EQ(values[1], -INFINITY);
  EXPECT_EQ(values[2], INFINITY);
  EXPECT_EQ(values[3], INFINITY);
  EXPECT_EQ(values[4], 0);
}

TEST(AsciiSpool, NamesTheLineThatIsNotANumber) {
  const TestFolder folder("spool-errors");
  for (const char* bad :
       {"x", "1.5x", "0x10", "*5", "2*", "0*3", "-1*3", "1.5*2", "2*3*4", "1e", "--1", "1..2", "**"}) {
    const std::string error = spoolError(folder, std::string("1 2\n3 4\n 5 ") + bad + " 6\n");
    EXPECT_NE(error.find(std::string("line 3 has \"") + bad + "\""), std::string::npos)
        << bad << ": " << error;
  }
  expectSays(spoolError(folder, "1,\n,2"), "line 2 has no value between two commas");
  expectSays(spoolError(folder, "1 999999999999999*2"), "repeats a number 999999999999999 times");
  EXPECT_EQ(files(folder), 1u);
}

TEST(AsciiSpool, NumbersAcrossChunksAreWhole) {
  const TestFolder folder("spool-long");
  std::mt19937_64 random(4);
  std::string text;
  std::vector<double> expected;
  while (text.size() < (3u << 20)) {
    const double value =
        std::ldexp(static_cast<double>(random() >> 11), static_cast<int>(random() % 60) - 60);
    const size_t repeats = random() % 4 == 0 ? 1 + random() % 5 : 1;
    if (repeats > 1) text += fmt::format("{}*", repeats);
    text += fmt::format("{}{}", value, random() % 6 == 0 ? "\n" : "   ");
    expected.insert(expected.end(), repeats, value);
  }
  EXPECT_EQ(spooled(folder, text), expected);
  EXPECT_EQ(files(folder), 1u);  // the text alone
  expectSays(spoolError(folder, text + " what?"),
             fmt::format("line {} has", std::count(text.begin(), text.end(), '\n') + 1));
  expectSays(spoolError(folder, std::string(3 << 20, '1')), "without a space");
}

TEST(AsciiSpool, CountsTheDigitsThatWereWritten) {
  const TestFolder folder("spool-digits");
  const auto digits = [&](const std::string& text) {
    return spoolAscii(InputFile(folder.write("text", text)), folder.path()).significant_digits;
  };
  EXPECT_EQ(digits("0.001234567 1.5E+10"), 7);
  EXPECT_EQ(digits("12 -0.12345678901234567D-100"), 17);
}

/// A disk that is full after some bytes.
class FullDisk : public SystemCalls {
 public:
  explicit FullDisk(ssize_t bytes) : left_(bytes) {}
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override {
    if (left_ == 0) {
      errno = ENOSPC;
      return -1;
    }
    const ssize_t put = SystemCalls::pwrite(fd, from, std::min(count, static_cast<size_t>(left_)), offset);
    left_ -= put;
    return put;
  }

 private:
  ssize_t left_;
};

TEST(AsciiSpool, AFullDiskIsAnErrorAndLeavesNothing) {
  const TestFolder folder("spool-full");
  const auto path = folder.write("text", std::string("400000*1.5"));
  FullDisk disk(1'000'000);
  const ScopedSystemCalls scope(disk);
  try {
    spoolAscii(InputFile(path), folder.path());
    ADD_FAILURE() << "it had room";
  } catch (const DiskFull& full) {
    const std::string message = full.what();
    EXPECT_TRUE(message.starts_with(folder.path().string() + ": no room for ")) << message;
    EXPECT_FALSE(faults::namesTemporaryFile(message)) << message;
  }
  EXPECT_EQ(files(folder), 1u);
}

}  // namespace
}  // namespace curvisplat
