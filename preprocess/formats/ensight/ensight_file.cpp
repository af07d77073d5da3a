#include "preprocess/formats/ensight/ensight_file.h"

#include <algorithm>
#include <array>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kTextBytes = 80;
constexpr uint64_t kChunk = 65536;
constexpr double kMaxCount = 0x1p40;

/// A line, or what it has before a 0.
std::string textOf(std::string_view line) {
  return std::string(trimmed(line.substr(0, line.find('\0'))));
}

template <typename Value>
void readList(const EnsightList& list, uint64_t first, std::span<Value> to) {
  std::array<std::byte, 4 * 4096> bytes;
  for (uint64_t done = 0; done < to.size(); done += 4096) {
    const size_t count = std::min<size_t>(4096, to.size() - done);
    const auto part = std::span(bytes).first(4 * count);
    list.file->readAt(list.begin + 4 * (first + done), part);
    if (list.integers)
      convertStored<int32_t>(part.data(), count, list.swap, to.data() + done);
    else
      convertStored<float>(part.data(), count, list.swap, to.data() + done);
  }
}

}  // namespace

void EnsightList::read(uint64_t first, std::span<double> to) const {
  file ? readList(*this, first, to) : spooled->read(begin + first, to);
}

void EnsightList::read(uint64_t first, std::span<float> to) const {
  if (file) return readList(*this, first, to);
  std::vector<double> values(std::min<uint64_t>(kChunk, to.size()));
  for (uint64_t done = 0; done < to.size(); done += kChunk) {
    const auto part = std::span(values).first(std::min<uint64_t>(kChunk, to.size() - done));
    spooled->read(begin + first + done, part);
    std::transform(part.begin(), part.end(), to.begin() + static_cast<ptrdiff_t>(done),
                   [](double value) { return convertedTo<float>(value); });
  }
}

std::vector<double> EnsightList::all() const {
  std::vector<double> values(count);
  read(0, std::span(values));
  return values;
}

EnsightFile::EnsightFile(std::shared_ptr<const PooledFile> file, std::optional<bool> binary,
                         const EnsightScratch& scratch)
    : file_(std::move(file)), spool_(scratch.spools.items) {
  std::array<char, kTextBytes> begin{};
  const size_t shown = std::min<uint64_t>(begin.size(), file_->size());
  file_->readAt(0, std::as_writable_bytes(std::span(begin).first(shown)));
  const std::string first = textOf(std::string_view(begin.data(), shown));
  if (first.find("ortran") != std::string::npos || begin[4] == 'F')
    throw Error("{}: is Fortran Binary, which is not read; write C Binary or ASCII", name());
  binary_ = binary.value_or(first.starts_with("C Binary") || first.starts_with("C binary"));
  if (!binary_) text_.emplace(file_, 0, file_->size());
  if (!binary && binary_) at_ = kTextBytes;
}

uint64_t EnsightFile::left() const {
  return file_->size() - std::min(binary_ ? at_ : text_->offset(), file_->size());
}

std::string EnsightFile::text() {
  if (!binary_) {
    const auto line = text_->line();
    return line ? textOf(*line) : "";
  }
  std::array<char, kTextBytes> text{};
  if (left() < text.size()) {
    at_ = file_->size();
    return "";
  }
  file_->readAt(at_, std::as_writable_bytes(std::span(text)));
  at_ += text.size();
  return textOf(std::string_view(text.data(), text.size()));
}

std::string EnsightFile::keyword() {
  while (left() > 0)
    if (const std::string found = text(); !found.empty()) return lowerCase(found);
  return "";
}

EnsightList EnsightFile::list(uint64_t count, bool integers) {
  EnsightList list;
  list.count = count;
  list.integers = integers;
  list.swap = swap_;
  // A number of a text has a character and a space.
  if (count > left() / (binary_ ? 4 : 2) + 1 || (binary_ && count > left() / 4))
    throw Error("{}: ends before {} numbers at byte {}; it is truncated", name(), count,
                binary_ ? at_ : text_->offset());
  if (binary_) {
    list.file = file_;
    list.begin = at_;
    at_ += 4 * count;
    return list;
  }
  list.spooled = spooled_;
  list.begin = spool_.size();
  for (uint64_t n = 0; n < count; ++n) spool_.add(text_->number());
  if (count > 0) text_->line();  // the rest of it
  return list;
}

uint64_t EnsightFile::integer(bool decides_order) {
  double value = 0;
  if (binary_) {
    EnsightList one = integers(1);
    if (decides_order) {
      std::array<std::byte, 4> bytes{};
      file_->readAt(one.begin, bytes);
      swap_ = loadStored<uint32_t>(bytes.data(), true) < loadStored<uint32_t>(bytes.data(), false);
      one.swap = swap_;
    }
    one.read(0, std::span(&value, 1));
  } else {
    value = text_->number();
    text_->line();
  }
  if (!(value >= 0 && value <= kMaxCount))
    throw Error("{}: has the count {} at byte {}; expected 0 or more; the file is damaged", name(), value,
                binary_ ? at_ - 4 : text_->offset());
  return static_cast<uint64_t>(value);
}

std::vector<double> EnsightFile::valuesOf(const EnsightList& list) {
  if (!binary_) *spooled_ = spool_.soFar();
  return list.all();
}

void EnsightFile::finish() {
  *spooled_ = spool_.soFar();
}

}  // namespace curvisplat
