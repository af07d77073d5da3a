#include "preprocess/formats/plot3d/payload_file.h"

#include <gtest/gtest.h>

#include <random>

#include "preprocess/formats/open/open_grid.h"
#include "tests/preprocess/plot3d_bytes.h"

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

}  // namespace
}  // namespace curvisplat
