#include "preprocess/formats/plot3d/payload_file.h"

#include <algorithm>
#include <array>

#include "preprocess/formats/common/stored_values.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

// Genuine subrecords have 2 GiB each: a file of 2 TiB has about a thousand. The limit rejects nonsense and
// keeps the table below 16 MiB.
constexpr size_t kMaxSegments = size_t{1} << 20;

}  // namespace

PayloadFile::PayloadFile(std::shared_ptr<const InputFile> file, uint64_t size, RecordMarkers records,
                         ByteOrder order)
    : file_(std::move(file)), file_size_(size), records_(records), order_(order) {
  if (records_ == RecordMarkers::kNone) {
    segments_.push_back({0, 0});
    size_ = end_in_file_ = file_size_;
  }
}

int64_t PayloadFile::markerAt(uint64_t offset) const {
  const bool swap = order_ != kMachineByteOrder;
  std::array<std::byte, 8> bytes{};
  if (records_ == RecordMarkers::kBytes8) {
    file_->readAt(offset, std::span(bytes));
    return loadStored<int64_t>(bytes.data(), swap);
  }
  file_->readAt(offset, std::span(bytes).first(4));
  return loadStored<int32_t>(bytes.data(), swap);
}

uint64_t PayloadFile::nextRecord() {
  CURVISPLAT_CHECK(records_ != RecordMarkers::kNone);
  const uint64_t marker_bytes = records_ == RecordMarkers::kBytes8 ? 8 : 4;
  uint64_t record_bytes = 0;
  for (bool first = true, more = true; more; first = false) {
    const uint64_t begin = end_in_file_;
    if (file_size_ - begin < 2 * marker_bytes)
      throw RecordMismatch("the file ends at byte {}, inside the record at byte {}", file_size_, begin);
    const int64_t leading = markerAt(begin);
    more = leading < 0;
    if (more && records_ == RecordMarkers::kBytes8)
      throw RecordMismatch("the record marker at byte {} is {}", begin, leading);
    const uint64_t bytes =
        more ? uint64_t{0} - static_cast<uint64_t>(leading) : static_cast<uint64_t>(leading);
    if (bytes > file_size_ - begin - 2 * marker_bytes)
      throw RecordMismatch("the record at byte {} declares {} bytes, but only {} are left in the file", begin,
                           bytes, file_size_ - begin - 2 * marker_bytes);
    const uint64_t end = begin + marker_bytes + bytes;
    const int64_t trailing = markerAt(end);
    const int64_t expected = first ? static_cast<int64_t>(bytes) : -static_cast<int64_t>(bytes);
    if (trailing != expected)
      throw RecordMismatch("the markers of the record at byte {} differ: {} before, {} after it at byte {}",
                           begin, leading, trailing, end);
    if (segments_.size() == kMaxSegments)
      throw RecordMismatch("there are more than {} records before byte {}", kMaxSegments, begin);
    segments_.push_back({size_, begin + marker_bytes});
    size_ += bytes;
    record_bytes += bytes;
    end_in_file_ = end + marker_bytes;
  }
  return record_bytes;
}

uint64_t PayloadFile::offsetInFile(uint64_t offset) const {
  if (offset >= size_) return end_in_file_;
  const auto next = std::upper_bound(segments_.begin(), segments_.end(), offset,
                                     [](uint64_t at, const Segment& segment) { return at < segment.offset; });
  const Segment& segment = *std::prev(next);
  return segment.offset_in_file + (offset - segment.offset);
}

void PayloadFile::readAt(uint64_t offset, std::span<std::byte> to) const {
  if (offset > size_ || to.size() > size_ - offset)
    throw Error("{}: expected {} bytes at offset {} of its records, which have {} bytes",
                file_->path().string(), to.size(), offset, size_);
  if (to.empty()) return;
  auto segment = std::prev(
      std::upper_bound(segments_.begin(), segments_.end(), offset,
                       [](uint64_t at, const Segment& candidate) { return at < candidate.offset; }));
  while (!to.empty()) {
    const auto next = std::next(segment);
    const uint64_t end = next == segments_.end() ? size_ : next->offset;
    const size_t count = static_cast<size_t>(std::min<uint64_t>(to.size(), end - offset));
    file_->readAt(segment->offset_in_file + (offset - segment->offset), to.first(count));
    to = to.subspan(count);
    offset += count;
    segment = next;
  }
}

}  // namespace curvisplat
