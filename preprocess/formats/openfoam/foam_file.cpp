#include "preprocess/formats/openfoam/foam_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <deque>
#include <functional>
#include <map>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;
constexpr size_t kFirstRead = 4096;
constexpr size_t kChunk = 32768;  // numbers
constexpr uint64_t kMaxNumbers = 100'000'000'000'000;
constexpr int kMaxExpansions = 100;
constexpr size_t kMaxEntryTokens = 100;  // longer ones are lists of values, which no field uses
constexpr int kMaxIncludes = 8;          // in one another

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
      : file(path), name(std::move(shown)), end(file.size()), buffer(kBufferBytes) {}

  InputFile file;
  std::string name;
  uint64_t end = 0;  // of the text: of the file, or of a processor's part of it
  std::vector<char> buffer;
  uint64_t buffer_offset = 0;
  size_t at = 0, filled = 0;
  size_t refill = kFirstRead;  // bytes to read next: few, in case it goes on elsewhere
  size_t label_bytes = 4, scalar_bytes = 8;
  bool swap = false, has_arch = false;
  std::map<std::string, std::vector<std::string>> entries;  // what "$name" stands for
  std::deque<std::string> expanded;                         // tokens of such entries, which come next
  int expansions = 0;

  uint64_t offset() const { return buffer_offset + at; }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: byte {}: {}", name, offset(), printable(what));
  }
  int peek() {
    if (at == filled) {
      buffer_offset += filled;
      at = 0;
      filled = static_cast<size_t>(std::min<uint64_t>(refill, end - buffer_offset));
      refill = std::min(2 * refill, buffer.size());
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
  void seek(uint64_t offset) {
    buffer_offset = offset;
    at = filled = 0;
    refill = kFirstRead;
  }
  /// Goes to the next part of a collated file, `// Processor3 NEWLINE bytes NEWLINE ( ... )`. Returns its end.
  uint64_t enterPart() {
    const uint64_t bytes = label();
    expect("(");
    if (bytes >= end - offset())
      fail(fmt::format("needs {} bytes, but {} are left; the file is truncated", bytes, end - offset()));
    return offset() + bytes;
  }
  void skipSpace() {
    while (isSpace(peek())) take();
  }
  /// The next token, with the entry's tokens in the place of "$name" and "${name}".
  std::string token() {
    for (;;) {
      std::string word = nextToken();
      if (word.empty() || word[0] != '$') return word;
      if (word == "$" && peek() == '{')
        for (int next = 0; next != '}' && peek() >= 0; add(word, next)) next = take();
      std::string key = word.substr(1);
      if (key.size() > 2 && key.front() == '{') key = key.substr(1, key.size() - 2);
      const auto entry = entries.find(key);
      // Entries may name one another in a circle.
      if (entry == entries.end() || ++expansions > kMaxExpansions) return word;
      expanded.insert(expanded.begin(), entry->second.begin(), entry->second.end());
    }
  }
  std::string nextToken() {
    if (!expanded.empty()) {
      std::string word = std::move(expanded.front());
      expanded.pop_front();
      return word;
    }
    for (;;) {
      skipSpace();
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
  [[noreturn]] void failValue(const std::string& word, const char* wanted) const {
    if (!word.empty() && (word[0] == '$' || word[0] == '#'))
      fail(fmt::format(
          "has \"{}\" in the place of {}, which only OpenFOAM can evaluate: write the values with "
          "foamDictionary -expand FILE",
          word.substr(0, 30), wanted));
    fail(fmt::format("found \"{}\"; expected {}; the file is truncated or damaged", word.substr(0, 30),
                     wanted));
  }
  double number() {
    double value = 0;
    const std::string word = token();
    if (!parseNumber(word, value)) failValue(word, "a number");
    return value;
  }
  uint64_t label() {
    const std::string word = token();
    uint64_t value = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || stop != word.data() + word.size() || value > kMaxNumbers)
      failValue(word, "a number of 0 or more");
    return value;
  }

  /// Whether the closing parenthesis of a binary list is where it would be with numbers of this size.
  bool closesAfter(uint64_t begin, uint64_t count, size_t bytes) const {
    char last = 0;
    if (begin >= end || count > (end - begin - 1) / bytes) return false;
    file.readAt(begin + count * bytes, std::span(&last, 1));
    return last == ')';
  }

  /// Calls use(bytes, width) for the numbers of a binary list, some at a time. OpenFOAM ends the line after the
  /// count. Versions before 2.2 do not state the width of numbers (`arch`), which the closing parenthesis then shows.
  void binary(uint64_t count, size_t width,
              const std::function<void(std::span<const std::byte>, size_t)>& use) {
    skipSpace();
    if (count == 0 && peek() != '(') return;
    if (take() != '(') fail("has no opening parenthesis before its numbers; the file is damaged");
    const uint64_t begin = offset();
    if (!has_arch && !closesAfter(begin, count, width) && closesAfter(begin, count, 12 - width))
      width = 12 - width;
    if (count > (end - begin) / width)
      fail(fmt::format("needs {} bytes, but {} are left; the file is truncated", count * width, end - begin));
    std::vector<std::byte> some;
    for (uint64_t done = 0; done < count;) {
      const uint64_t numbers = std::min<uint64_t>(kChunk, count - done);
      some.resize(numbers * width);
      file.readAt(begin + done * width, std::span(some));
      use(some, width);
      done += numbers;
    }
    seek(begin + count * width);
    expect(")");
  }

  /// The opening of a list in text: true for `3{7}`, which has one element that counts three times.
  bool opensRepeated() {
    const std::string opening = token();
    if (opening != "(" && opening != "{")
      fail(fmt::format("found \"{}\"; expected \"(\"; the file is truncated or damaged",
                       opening.substr(0, 30)));
    return opening == "{";
  }

  bool atEnd() {
    const uint64_t begin = offset();
    const bool ended = token().empty();
    seek(begin);
    return ended;
  }
  std::vector<double> tuple(size_t components) {
    std::vector<double> values;
    if (components > 1) expect("(");
    for (size_t c = 0; c < components; ++c) values.push_back(number());
    if (components > 1) expect(")");
    return values;
  }
  void addTuples(uint64_t count, size_t components, Chunks<double>& to) {
    skipSpace();
    if (count == 0 && peek() != '(') return;
    const bool repeated = opensRepeated();
    std::vector<double> last;
    for (uint64_t n = 0; n < count; ++n) {
      if (!repeated || n == 0) last = tuple(components);
      for (const double value : last) to.add(value);
    }
    expect(repeated ? "}" : ")");
  }
  void addLabels(uint64_t count, bool is_binary, Chunks<uint64_t>& to) {
    if (is_binary)
      return binary(count, label_bytes, [&](std::span<const std::byte> bytes, size_t width) {
        for (size_t n = 0; n < bytes.size(); n += width)
          to.add(width == 8 ? loadStored<uint64_t>(bytes.data() + n, swap)
                            : loadStored<uint32_t>(bytes.data() + n, swap));
      });
    skipSpace();
    if (count == 0 && peek() != '(') return;
    const bool repeated = opensRepeated();
    uint64_t last = 0;
    for (uint64_t n = 0; n < count; ++n) to.add(last = repeated && n > 0 ? last : label());
    expect(repeated ? "}" : ")");
  }

  /// Reads entries of a dictionary up to the one called `wanted`, or to the end of the text. Returns whether it was
  /// found. Those before it are kept, since values may refer to them; so are those of files that are included.
  bool findEntry(const std::string& wanted, int depth = 0);
  void include(const std::filesystem::path& path, int depth);
  /// The tokens of an entry, up to its semicolon or the end of its dictionary.
  std::vector<std::string> entryTokens();
};

std::vector<std::string> FoamFile::Parser::entryTokens() {
  std::vector<std::string> tokens;
  int braces = 0;
  for (std::string word = token(); !word.empty(); word = token()) {
    if (word == ";" && braces == 0) break;
    braces += word == "{" ? 1 : word == "}" ? -1 : 0;
    if (tokens.size() <= kMaxEntryTokens) tokens.push_back(word);
    if (word == "}" && braces <= 0) break;
  }
  return tokens;
}

void FoamFile::Parser::include(const std::filesystem::path& path, int depth) {
  const std::filesystem::path included = std::filesystem::path(name).parent_path() / path;
  if (depth >= kMaxIncludes || !isRegularFile(included))
    return;  // what it defines is missed where it is used
  Parser other(included, included.string());
  other.findEntry("", depth + 1);
  entries.merge(other.entries);
}

bool FoamFile::Parser::findEntry(const std::string& wanted, int depth) {
  for (std::string key = token(); !key.empty(); key = token()) {
    if (key == wanted) return true;
    if (key.starts_with("#include")) {
      const std::string path = token();
      if (path.starts_with('"')) include(path.substr(1), depth);
    } else if (key == "#inputMode" || key == "#remove") {
      token();
    } else if (key != ";" && key != "}") {
      std::vector<std::string> tokens = entryTokens();
      if (tokens.size() <= kMaxEntryTokens) entries[key] = std::move(tokens);
    }
  }
  return false;
}

bool FoamFile::exists(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path packed = path;
  packed += ".gz";
  return std::filesystem::is_regular_file(path, error) || std::filesystem::is_regular_file(packed, error);
}

FoamFile::FoamFile(const std::filesystem::path& path, std::shared_ptr<SpoolFile> spool,
                   const std::filesystem::path& temporary_folder, uint32_t processor)
    : original_(path), spool_(std::move(spool)), temporary_folder_(temporary_folder) {
  if (!isRegularFile(path) && isRegularFile(path.string() + ".gz")) original_ += ".gz";
  std::filesystem::path plain = original_;
  if (UnpackedFile::recognises(InputFile(original_))) {
    unpacked_ = std::make_unique<UnpackedFile>(original_, temporary_folder);
    plain = unpacked_->path();
  }
  parser_ = std::make_unique<Parser>(plain, original_.string());
  if (unpacked_) unpacked_->removeName();
  readHeader();
  if (type_ == "decomposedBlockData") enterProcessor(processor);
}

/// The first processor's part has the header of all; others may have one of their own.
void FoamFile::enterProcessor(uint32_t processor) {
  Parser& in = *parser_;
  for (uint32_t part = 0; part <= processor; ++part) {
    const uint64_t end = in.enterPart(), begin = in.offset();
    const bool has_header = (part == 0 || part == processor) && in.token() == "FoamFile";
    in.seek(begin);
    if (has_header) readHeader();
    if (part == processor) {
      in.end = end;
      in.seek(in.offset());  // the buffer then holds nothing of the next part
    } else {
      in.seek(end);
      in.expect(")");
    }
  }
}

uint32_t FoamFile::processorsIn(const std::filesystem::path& path) {
  FoamFile file(path, nullptr, {});
  Parser& in = *file.parser_;
  if (in.end == in.file.size()) return 1;
  uint32_t count = 0;
  for (in.seek(in.end), in.end = in.file.size();; in.seek(in.enterPart())) {
    in.expect(")");
    ++count;
    if (in.atEnd()) return count;
  }
}

void FoamFile::readHeader() {
  Parser& in = *parser_;
  if (in.token() != "FoamFile") in.fail("does not begin with FoamFile; expected a file of OpenFOAM");
  in.expect("{");
  for (std::string key = in.token(); key != "}"; key = in.token()) {
    if (key.empty()) in.fail("ends in its header; the file is truncated");
    const std::vector<std::string> tokens = in.entryTokens();
    const std::string value = tokens.empty() ? "" : tokens.front();
    if (key == "format") binary_ = value == "binary";
    if (key == "class") type_ = value;
    if (key == "arch") {
      in.has_arch = true;
      in.swap = (value.find("MSB") != std::string::npos) != (kMachineByteOrder == ByteOrder::kBig);
      if (value.find("label=64") != std::string::npos) in.label_bytes = 8;
      if (value.find("scalar=32") != std::string::npos) in.scalar_bytes = 4;
    }
  }
}

FoamFile::FoamFile(FoamFile&&) noexcept = default;
FoamFile::~FoamFile() = default;

FoamList FoamFile::numbers(size_t components) {
  Parser& in = *parser_;
  FoamList list{spool_, 0, in.label()};
  list.count *= components;
  list.offset = spool_->append([&](const SpoolFile::Sink& sink) {
    Chunks<double> chunks(sink);
    if (binary_)
      in.binary(list.count, in.scalar_bytes, [&](std::span<const std::byte> bytes, size_t width) {
        for (size_t at = 0; at < bytes.size(); at += width)
          chunks.add(width == 8 ? loadStored<double>(bytes.data() + at, in.swap)
                                : static_cast<double>(loadStored<float>(bytes.data() + at, in.swap)));
      });
    else
      in.addTuples(list.count / components, components, chunks);
    chunks.flush();
  });
  return list;
}

FoamList FoamFile::labels() {
  Parser& in = *parser_;
  FoamList list{spool_, 0, in.label()};
  list.offset = spool_->append([&](const SpoolFile::Sink& sink) {
    Chunks<uint64_t> chunks(sink);
    in.addLabels(list.count, binary_, chunks);
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
      in.addLabels(points, binary_, labels);
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
  const char* const key = type_.ends_with("::Internal") ? "value" : "internalField";
  if (!in.findEntry(key)) in.fail(fmt::format("has no {}; the file is truncated or not a field", key));
  const std::string word = in.token();
  if (word == "uniform") return in.tuple(components);
  if (word != "nonuniform") in.failValue(word, "uniform or nonuniform");
  // List<scalar>, which the lists of processors without cells lack: nonuniform 0()
  in.skipSpace();
  if (in.peek() == 'L') in.token();
  return {};
}

}  // namespace curvisplat
