#include "preprocess/formats/vtk/vtk_legacy_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr std::pair<const char*, VtkType> kLegacyTypes[] = {
    {"char", VtkType::kInt8},
    {"signed_char", VtkType::kInt8},
    {"unsigned_char", VtkType::kUint8},
    {"short", VtkType::kInt16},
    {"unsigned_short", VtkType::kUint16},
    {"int", VtkType::kInt32},
    {"vtkidtype", VtkType::kInt32},
    {"unsigned_int", VtkType::kUint32},
    {"long", VtkType::kInt64},
    {"vtktypeint8", VtkType::kInt8},  // these are meshio's words
    {"vtktypeint16", VtkType::kInt16},
    {"vtktypeint32", VtkType::kInt32},
    {"vtktypeint64", VtkType::kInt64},
    {"unsigned_long", VtkType::kUint64},
    {"vtktypeuint8", VtkType::kUint8},
    {"vtktypeuint16", VtkType::kUint16},
    {"vtktypeuint32", VtkType::kUint32},
    {"vtktypeuint64", VtkType::kUint64},
    {"float", VtkType::kFloat32},
    {"double", VtkType::kFloat64},
};

/// Decodes %20 and the like; legacy files encode special characters in names.
std::string decodedName(std::string_view text) {
  std::string name;
  for (size_t n = 0; n < text.size(); ++n) {
    unsigned code = 0;
    const bool coded = text[n] == '%' && n + 2 < text.size() &&
                       std::from_chars(&text[n + 1], &text[n + 1] + 2, code, 16).ptr == &text[n + 1] + 2;
    name += coded ? static_cast<char>(code) : text[n];
    if (coded) n += 2;
  }
  return name;
}

}  // namespace

VtkLegacyFile::VtkLegacyFile(const VtkFiles& files, const std::filesystem::path& path)
    : files_(files),
      file_(std::make_shared<const PooledFile>(files_.pool, path)),
      text_(file_, 0, file_->size()) {}

std::string VtkLegacyFile::nextName() {
  const std::string_view word = text_.word();
  if (word.empty()) fail("ends where a name was expected; the file is truncated");
  return decodedName(word);
}

std::vector<std::string> VtkLegacyFile::restOfLine() {
  std::istringstream line{std::string(text_.line().value_or(""))};
  std::vector<std::string> words;
  for (std::string word; line >> word;) words.push_back(word);
  return words;
}

std::string VtkLegacyFile::lineOfType() {
  const std::vector<std::string> words = restOfLine();
  if (words.size() != 1) fail("found a line of {} words; expected one word, a type", words.size());
  return words[0];
}

bool VtkLegacyFile::wordFollows(std::string_view word) {
  if (ascii_) return lowerCase(text_.peekWord()) == word;
  std::string next(word.size(), '\0');
  if (file_->size() - text_.offset() < next.size()) return false;
  file_->readAt(text_.offset(), std::as_writable_bytes(std::span(next)));
  return lowerCase(next) == word;
}

uint64_t VtkLegacyFile::count(std::string_view word) const {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || value > kMaxCount)
    fail("found \"{}\"; expected a count", word.substr(0, 30));
  return value;
}

VtkArray VtkLegacyFile::readNumbers(const std::string& name, const std::string& type, uint64_t components,
                                    uint64_t tuples) {
  VtkArray array;
  array.name = name;
  const std::string type_word = lowerCase(type);
  const auto* const known = std::find_if(std::begin(kLegacyTypes), std::end(kLegacyTypes),
                                         [&](const auto& entry) { return type_word == entry.first; });
  if (known == std::end(kLegacyTypes))
    fail("array {} has type {}; expected float, double or an integer", name, type);
  if (components == 0 || components > kMaxComponents)
    fail("array {} has {} components; expected 1 to {}", name, components, kMaxComponents);
  array.type = known->second;
  array.components = static_cast<uint32_t>(components);
  array.tuples = tuples;
  const uint64_t numbers = tuples * components, bytes = tuples * array.tupleBytes();
  const uint64_t left = file_->size() - text_.offset();
  // In text, a number needs a digit and a space.
  const uint64_t needed = ascii_ ? 2 * numbers - std::min<uint64_t>(numbers, 1) : bytes;
  if (needed > left)
    fail("array {} needs {} numbers, {} {}, but only {} are left; the file is truncated or damaged", name,
         numbers, needed, ascii_ ? "characters at least" : "bytes", left);
  if (ascii_) {
    array.order = kMachineByteOrder;
    const auto spooled = std::make_shared<SpooledBytes>(
        files_.spool, bytes,
        [&](const SpoolFile::Sink& sink) { packNumbers(text_, name, numbers, array.type, sink); });
    spooled->fill();
    array.bytes = spooled;
  } else {
    array.order = ByteOrder::kBig;
    array.bytes = std::make_shared<FileBytes>(file_, text_.offset(), text_.offset() + bytes);
    text_.seek(text_.offset() + bytes);
  }
  return array;
}

/// Binary files have eight bits in a byte, and padding at the end of the array.
void VtkLegacyFile::skipBits(const std::string& name, uint64_t components, uint64_t tuples) {
  const uint64_t left = file_->size() - text_.offset();
  if (components > kMaxComponents || (components > 0 && tuples > 8 * left / components))
    fail("array {} needs {} x {} bits, but only {} bytes are left; the file is truncated or damaged", name,
         tuples, components, left);
  const uint64_t bits = tuples * components;
  if (!ascii_) return text_.seek(text_.offset() + (bits + 7) / 8);
  for (uint64_t n = 0; n < bits; ++n) text_.number();
}

void VtkLegacyFile::skipStrings(uint64_t components, uint64_t tuples) {
  const uint64_t strings = tuples > 0 && components > kMaxCount / tuples ? kMaxCount : tuples * components;
  for (uint64_t n = 0; n < strings; ++n) {
    if (ascii_) {
      if (!text_.line()) fail("ends inside an array of strings; the file is truncated");
      continue;
    }
    // The first two bits of a length give its size: 8, 4, 2 or 1 bytes.
    std::byte first;
    file_->readAt(text_.offset(), std::span(&first, 1));
    const auto bytes = size_t{8} >> std::to_integer<unsigned>(first >> 6);
    std::array<std::byte, 8> length{};
    file_->readAt(text_.offset(), std::span(length).last(bytes));
    length[8 - bytes] &= std::byte{0x3f};
    const auto skipped = loadStored<uint64_t>(length.data(), kMachineByteOrder != ByteOrder::kBig);
    if (skipped > file_->size() - text_.offset() - bytes)
      fail("declares a string of {} bytes; the file is truncated or damaged", skipped);
    text_.seek(text_.offset() + bytes + skipped);
  }
}

void VtkLegacyFile::skipMetadata() {
  text_.line();
  for (;;) {
    const auto line = text_.line();
    if (!line || line->find_first_not_of(" \t") == std::string_view::npos) return;
  }
}

}  // namespace curvisplat
