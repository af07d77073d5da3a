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
  const uint64_t offset = list.begin + 4 * first;
  if (list.integers)
    readStored<int32_t>(*list.file, offset, to.size(), list.swap, to.data());
  else
    readStored<float>(*list.file, offset, to.size(), list.swap, to.data());
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

EnsightFile::EnsightFile(const EnsightPlace& place, std::optional<bool> binary, const EnsightScratch& scratch)
    : file_(std::make_shared<const PooledFile>(scratch.pool, place.file)),
      end_(file_->size()),
      spool_(scratch.spools.items) {
  std::array<char, kTextBytes> begin{};
  const size_t shown = std::min<uint64_t>(begin.size(), file_->size());
  file_->readAt(0, std::as_writable_bytes(std::span(begin).first(shown)));
  const std::string first = textOf(std::string_view(begin.data(), shown));
  if (first.find("ortran") != std::string::npos || begin[4] == 'F')
    throw Error("{}: is Fortran Binary, which is not read; write C Binary or ASCII", name());
  binary_ = binary.value_or(first.starts_with("C Binary") || first.starts_with("C binary"));
  if (!binary && binary_) at_ = kTextBytes;
  if (place.step) findStep(place, scratch.index);
  if (!binary_) text_.emplace(file_, at_, end_);
}

/// The place of the first byte of the words, from `from` on; nullopt if they do not come.
std::optional<uint64_t> EnsightFile::find(std::string_view words, uint64_t from) const {
  std::string chunk;
  for (uint64_t at = from; at < file_->size(); at += kChunk) {
    chunk.resize(static_cast<size_t>(std::min(kChunk + words.size(), file_->size() - at)));
    file_->readAt(at, std::as_writable_bytes(std::span(chunk)));
    if (const size_t found = chunk.find(words); found != std::string::npos) return at + found;
  }
  return std::nullopt;
}

namespace {

constexpr std::string_view kBeginStep = "BEGIN TIME STEP", kEndStep = "END TIME STEP";

}  // namespace

void EnsightFile::lacksStep(const EnsightPlace& place) const {
  throw Error("{}: has no step {} of {}; the file is truncated", name(), *place.step + 1, place.steps);
}

uint64_t EnsightFile::endOfStep(const EnsightPlace& place, uint64_t begin) const {
  const std::optional<uint64_t> end = find(kEndStep, begin);
  if (!end) lacksStep(place);
  return *end;
}

/// A step of a binary file whose steps are of the same size, as they mostly are.
std::optional<FilePart> EnsightFile::guessedStep(const EnsightPlace& place) const {
  const std::optional<uint64_t> first = find(kBeginStep, 0);
  if (!binary_ || *place.step == 0 || !first) return std::nullopt;
  const uint64_t bytes = endOfStep(place, *first) + kTextBytes - *first;
  const uint64_t begin = *first + *place.step * bytes;
  if (bytes * place.steps != file_->size() - *first || find(kBeginStep, begin) != begin) return std::nullopt;
  return FilePart{begin, endOfStep(place, begin), 0, 0};
}

/// Sets where the step begins and ends. `index`: has the places of the steps that were passed before.
void EnsightFile::findStep(const EnsightPlace& place, FileIndex* index) {
  std::optional<FilePart> step = guessedStep(place);
  if (!step) {
    const FileVersion version = FileVersion::of(file_->path());
    const auto known = index ? index->find(version) : nullptr;
    FileParts steps = known ? *known : FileParts();
    const size_t before = steps.size();
    while (steps.size() <= *place.step) {
      const std::optional<uint64_t> begin = find(kBeginStep, steps.empty() ? 0 : steps.back().end);
      if (!begin) lacksStep(place);
      steps.push_back({*begin, endOfStep(place, *begin), 0, 0});
    }
    step = steps[*place.step];
    if (index && steps.size() > before) index->keep(version, std::move(steps));
  }
  end_ = step->end;
  at_ = step->begin + kTextBytes;
  if (!binary_) {
    TextReader line(file_, step->begin, end_);
    line.line();
    at_ = line.offset();
  }
}

uint64_t EnsightFile::left() const {
  return end_ - std::min(binary_ ? at_ : text_->offset(), end_);
}

std::string EnsightFile::text() {
  if (!binary_) {
    const auto line = text_->line();
    return line ? textOf(*line) : "";
  }
  std::array<char, kTextBytes> text{};
  if (left() < text.size()) {
    at_ = end_;
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
