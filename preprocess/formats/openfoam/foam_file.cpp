#include "preprocess/formats/openfoam/foam_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <functional>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;
constexpr size_t kChunk = 32768;  // numbers
constexpr uint64_t kMaxNumbers = 100'000'000'000'000;

/// A list goes to its sink in chunks.
template <typename Number>
class Chunks {
 public:
  explicit Chunks(const SpoolFile::Sink& sink) : sink_(&sink) { numbers_.reserve(kChunk); }
  void add(Number number) {
    numbers_.push_back(number);
    if (numbers_.size() == kChunk) flush();
  }
  void flush() {
    if (!numbers_.empty()) (*sink_)(std::as_bytes(std::span(numbers_)));
    numbers_.clear();
  }

 private:
  const SpoolFile::Sink* sink_;
  std::vector<Number> numbers_;
};

}  // namespace

/// Tokens of the file: words, numbers, quoted text, and punctuation, one character each. Comments are left out.
struct FoamFile::Parser {
  Parser(const std::filesystem::path& path, std::string shown)
      : file(path), name(std::move(shown)), buffer(kBufferBytes) {}

  InputFile file;
  std::string name;
  std::vector<char> buffer;
  uint64_t buffer_offset = 0;
  size_t at = 0, filled = 0;
  size_t label_bytes = 4, scalar_bytes = 8;
  bool swap = false;

  uint64_t offset() const { return buffer_offset + at; }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: byte {}: {}", name, offset(), printable(what));
  }
  int peek() {
    if (at == filled) {
      buffer_offset += filled;
      at = 0;
      filled = static_cast<size_t>(std::min<uint64_t>(buffer.size(), file.size() - buffer_offset));
      file.readAt(buffer_offset, std::span(buffer.data(), filled));
      if (filled == 0) return -1;
    }
    return static_cast<unsigned char>(buffer[at]);
  }
  int take() {
    const int c = peek();
    if (c >= 0) ++at;
    return c;
  }
  static bool isSpace(int c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
  static bool isPunctuation(int c) {
    return c == '(' || c == ')' || c == '{' || c == '}' || c == '[' || c == ']' || c == ';';
  }

  void add(std::string& word, int c) const {
    word += static_cast<char>(c);
    if (word.size() > 1000) fail("has a word of more than 1000 characters; the file is damaged");
  }
  std::string token() {
    for (;;) {
      while (isSpace(peek())) take();
      const int c = take();
      if (c < 0) return "";
      if (c == '/' && peek() == '/') {
        while (peek() >= 0 && peek() != '\n') take();
        continue;
      }
      if (c == '/' && peek() == '*') {
        for (int before = 0; peek() >= 0;) {
          const int next = take();
          if (before == '*' && next == '/') break;
          before = next;
        }
        continue;
      }
      std::string word(1, static_cast<char>(c));
      if (isPunctuation(c)) return word;
      if (c == '"') {
        for (int next = take(); next >= 0 && next != '"'; next = take()) add(word, next);
        return word;
      }
      while (peek() >= 0 && !isSpace(peek()) && !isPunctuation(peek())) add(word, take());
      return word;
    }
  }

  void expect(const char* wanted) {
    const std::string found = token();
    if (found != wanted)
      fail(fmt::format("found \"{}\"; expected \"{}\"; the file is truncated or damaged", found.substr(0, 30),
                       wanted));
  }
  double number() {
    double value = 0;
    const std::string word = token();
    if (!parseNumber(word, value))
      fail(fmt::format("found \"{}\"; expected a number; the file is truncated or damaged",
                       word.substr(0, 30)));
    return value;
  }
  uint64_t label() {
    const std::string word = token();
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size() || value > kMaxNumbers)
      fail(fmt::format("found \"{}\"; expected a number of 0 or more; the file is truncated or damaged",
                       word.substr(0, 30)));
    return value;
  }

  /// Calls use(bytes) for the numbers of a binary list, some at a time.
  void binary(uint64_t count, size_t bytes, const std::function<void(std::span<const std::byte>)>& use) {
    if (count == 0) return;
    if (take() != '(') fail("has no opening parenthesis before its numbers; the file is damaged");
    const uint64_t begin = offset();
    if (count > (file.size() - begin) / bytes)
      fail(fmt::format("needs {} bytes, but {} are left; the file is truncated", count * bytes,
                       file.size() - begin));
    std::vector<std::byte> some;
    for (uint64_t done = 0; done < count;) {
      const uint64_t numbers = std::min<uint64_t>(kChunk, count - done);
      some.resize(numbers * bytes);
      file.readAt(begin + done * bytes, std::span(some));
      use(some);
      done += numbers;
    }
    buffer_offset = begin + count * bytes;
    at = filled = 0;
    expect(")");
  }
};

bool FoamFile::exists(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path packed = path;
  packed += ".gz";
  return std::filesystem::is_regular_file(path, error) || std::filesystem::is_regular_file(packed, error);
}

FoamFile::FoamFile(const std::filesystem::path& path, std::shared_ptr<SpoolFile> spool,
                   const std::filesystem::path& temporary_folder)
    : original_(path), spool_(std::move(spool)), temporary_folder_(temporary_folder) {
  if (!isRegularFile(path) && isRegularFile(path.string() + ".gz")) original_ += ".gz";
  std::filesystem::path plain = original_;
  if (UnpackedFile::recognises(InputFile(original_))) {
    unpacked_ = std::make_unique<UnpackedFile>(original_, temporary_folder);
    plain = unpacked_->path();
  }
  parser_ = std::make_unique<Parser>(plain, original_.string());
  if (unpacked_) unpacked_->removeName();
  Parser& in = *parser_;
  if (in.token() != "FoamFile") in.fail("does not begin with FoamFile; expected a file of OpenFOAM");
  in.expect("{");
  for (std::string key = in.token(); key != "}"; key = in.token()) {
    if (key.empty()) in.fail("ends in its header; the file is truncated");
    const std::string value = in.token();
    if (key == "format") binary_ = value == "binary";
    if (key == "class") type_ = value;
    if (key == "arch") {
      in.swap = (value.find("MSB") != std::string::npos) != (kMachineByteOrder == ByteOrder::kBig);
      if (value.find("label=64") != std::string::npos) in.label_bytes = 8;
      if (value.find("scalar=32") != std::string::npos) in.scalar_bytes = 4;
    }
    for (std::string rest = value; rest != ";" && !rest.empty();) rest = in.token();
  }
}

FoamFile::~FoamFile() = default;

FoamList FoamFile::numbers(size_t components) {
  Parser& in = *parser_;
  FoamList list{spool_, 0, in.label()};
  list.count *= components;
  list.offset = spool_->append([&](const SpoolFile::Sink& sink) {
    Chunks<double> chunks(sink);
    if (binary_) {
      in.binary(list.count, in.scalar_bytes, [&](std::span<const std::byte> bytes) {
        for (size_t at = 0; at < bytes.size(); at += in.scalar_bytes)
          chunks.add(in.scalar_bytes == 8
                         ? loadStored<double>(bytes.data() + at, in.swap)
                         : static_cast<double>(loadStored<float>(bytes.data() + at, in.swap)));
      });
    } else {
      in.expect("(");
      for (uint64_t n = 0; n < list.count; n += components) {
        if (components > 1) in.expect("(");
        for (size_t c = 0; c < components; ++c) chunks.add(in.number());
        if (components > 1) in.expect(")");
      }
      in.expect(")");
    }
    chunks.flush();
  });
  return list;
}

FoamList FoamFile::labels() {
  Parser& in = *parser_;
  FoamList list{spool_, 0, in.label()};
  list.offset = spool_->append([&](const SpoolFile::Sink& sink) {
    Chunks<uint64_t> chunks(sink);
    if (binary_) {
      in.binary(list.count, in.label_bytes, [&](std::span<const std::byte> bytes) {
        for (size_t at = 0; at < bytes.size(); at += in.label_bytes)
          chunks.add(in.label_bytes == 8 ? loadStored<uint64_t>(bytes.data() + at, in.swap)
                                         : loadStored<uint32_t>(bytes.data() + at, in.swap));
      });
    } else if (list.count > 0 || in.peek() == '(') {
      in.expect("(");
      for (uint64_t n = 0; n < list.count; ++n) chunks.add(in.label());
      in.expect(")");
    }
    chunks.flush();
  });
  return list;
}

FoamFile::Faces FoamFile::faces() {
  Faces faces;
  if (type_ == "faceCompactList") {
    faces.begins = labels();
    faces.labels = labels();
    return faces;
  }
  Parser& in = *parser_;
  const uint64_t count = in.label();
  in.expect("(");
  uint64_t total = 0;
  const auto write = [&](const SpoolFile::Sink& to_begins, const SpoolFile::Sink& to_labels) {
    Chunks<uint64_t> begins(to_begins), labels(to_labels);
    begins.add(0);
    for (uint64_t face = 0; face < count; ++face) {
      const uint64_t points = in.label();
      in.expect("(");
      for (uint64_t n = 0; n < points; ++n) labels.add(in.label());
      in.expect(")");
      total += points;
      begins.add(total);
    }
    begins.flush();
    labels.flush();
  };
  // One file has one writer at a time.
  faces.begins.spool = std::make_shared<SpoolFile>(temporary_folder_);
  faces.labels.spool = spool_;
  faces.begins.offset = faces.begins.spool->append([&](const SpoolFile::Sink& to_begins) {
    faces.labels.offset =
        spool_->append([&](const SpoolFile::Sink& to_labels) { write(to_begins, to_labels); });
  });
  in.expect(")");
  faces.begins.count = count + 1;
  faces.labels.count = total;
  return faces;
}

std::vector<double> FoamFile::beginField(size_t components) {
  Parser& in = *parser_;
  std::string word = in.token();
  while (word != "internalField" && !word.empty()) word = in.token();
  if (word.empty()) in.fail("has no internalField; the file is truncated or not a field");
  word = in.token();
  if (word == "uniform") {
    std::vector<double> values;
    if (components > 1) in.expect("(");
    for (size_t c = 0; c < components; ++c) values.push_back(in.number());
    return values;
  }
  if (word != "nonuniform") in.fail(fmt::format("found \"{}\"; expected uniform or nonuniform", word));
  in.token();  // List<scalar>
  return {};
}

}  // namespace curvisplat
