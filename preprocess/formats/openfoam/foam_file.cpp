#include "preprocess/formats/openfoam/foam_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/openfoam/foam_parser.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr size_t kNumbersAtOnce = 32768;  // numbers

/// A list goes to its sink in chunks.
template <typename Number>
class Chunks {
 public:
  explicit Chunks(const SpoolFile::Sink& sink) : sink_(&sink) { numbers_.reserve(kNumbersAtOnce); }
  void add(Number number) {
    numbers_.push_back(number);
    if (numbers_.size() == kNumbersAtOnce) flush();
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

/// The lists of the file, of numbers of the sizes and in the byte order that its header states.
struct FoamFile::Parser final : FoamParser {
  using FoamParser::FoamParser;

  size_t label_bytes = 4, scalar_bytes = 8;
  bool swap = false, has_arch = false;

  /// Whether the closing parenthesis of a binary list is where it would be with numbers of this size.
  bool closesAfter(uint64_t begin, uint64_t count, size_t bytes) const {
    char last = 0;
    if (begin >= end() || count > (end() - begin - 1) / bytes) return false;
    file().readAt(begin + count * bytes, std::span(&last, 1));
    return last == ')';
  }

  /// Calls use(bytes, width) for the numbers of a binary list, some at a time. OpenFOAM ends the line after the
  /// count. Versions before 2.2 do not state the width of numbers (`arch`), which the closing parenthesis then shows.
  void binary(uint64_t count, size_t width,
              const std::function<void(std::span<const std::byte>, size_t)>& use) {
    skipSpace();
    if (count == 0 && peek() != '(') return;
    if (get() != '(') fail("has no opening parenthesis before its numbers; the file is damaged");
    const uint64_t begin = offset();
    if (!has_arch && !closesAfter(begin, count, width) && closesAfter(begin, count, 12 - width))
      width = 12 - width;
    if (count > (end() - begin) / width)
      fail(fmt::format("needs {} bytes, but {} are left; the file is truncated", count * width,
                       end() - begin));
    std::vector<std::byte> some;
    for (uint64_t done = 0; done < count;) {
      const uint64_t numbers = std::min<uint64_t>(kNumbersAtOnce, count - done);
      some.resize(numbers * width);
      file().readAt(begin + done * width, std::span(some));
      use(some, width);
      done += numbers;
    }
    seek(begin + count * width);
    expect(")");
  }

  /// The opening of a list in text: true for `3{7}`, which has one element that counts three times.
  bool opensRepeated() {
    const std::string opening = token();
    if (opening.starts_with('$') || opening.starts_with('#')) failValue(opening, "a list");
    if (opening != "(" && opening != "{")
      fail(fmt::format("found \"{}\"; expected \"(\"; the file is truncated or damaged",
                       opening.substr(0, 30)));
    return opening == "{";
  }

  std::vector<double> tuple(size_t components) {
    std::vector<double> values;
    skipSpace();
    const bool enclosed = components > 1 || peek() == '(';  // a spherical tensor: (1)
    if (enclosed) expect("(");
    for (size_t c = 0; c < components; ++c) values.push_back(number());
    if (enclosed) expect(")");
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
};

bool FoamFile::exists(const std::filesystem::path& path) {
  return isFileThere(path) || isFileThere(path.string() + ".gz");
}

std::filesystem::path FoamFile::pathOf(const std::filesystem::path& path) {
  const std::filesystem::path packed = path.string() + ".gz";
  return !isRegularFile(path) && isRegularFile(packed) ? packed : path;
}

FoamFile::FoamFile(const std::filesystem::path& path, ListSpools spools,
                   const std::filesystem::path& temporary_folder, uint32_t processor)
    : original_(pathOf(path)), spools_(std::move(spools)) {
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
      in.setEnd(end);
      in.seek(in.offset());  // the buffer then holds nothing of the next part
    } else {
      in.seek(end);
      in.expect(")");
    }
  }
}

uint32_t FoamFile::processorsIn(const std::filesystem::path& path) {
  FoamFile file(path, ListSpools({}), {});
  Parser& in = *file.parser_;
  if (in.end() == in.file().size()) return 1;
  uint32_t count = 0;
  in.seek(in.end());
  for (in.setEnd(in.file().size());; in.seek(in.enterPart())) {
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
  FoamList list{spools_.items, 0, in.label()};
  list.count *= components;
  list.offset = spools_.items->append([&](const SpoolFile::Sink& sink) {
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
  FoamList list{spools_.items, 0, in.label()};
  list.offset = spools_.items->append([&](const SpoolFile::Sink& sink) {
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
  faces.begins.spool = spools_.begins;
  faces.labels.spool = spools_.items;
  faces.begins.offset = spools_.begins->append([&](const SpoolFile::Sink& to_begins) {
    faces.labels.offset =
        spools_.items->append([&](const SpoolFile::Sink& to_labels) { write(to_begins, to_labels); });
  });
  in.expect(")");
  faces.begins.count = count + 1;
  faces.labels.count = total;
  return faces;
}

std::vector<double> FoamFile::beginField(size_t components) {
  Parser& in = *parser_;
  const char* const key = type_.find("::") != std::string::npos ? "value" : "internalField";
  if (!in.findEntry(key)) in.fail(fmt::format("has no {}; the file is truncated or not a field", key));
  const std::string word = in.token();
  if (word == "uniform") return in.tuple(components);
  if (word != "nonuniform") in.failValue(word, "uniform or nonuniform");
  // List<scalar>, which the lists of processors without cells lack: nonuniform 0()
  in.skipSpace();
  if (in.peek() == 'L') in.token();
  return {};
}

uint64_t FoamFile::readCount() {
  return parser_->label();
}

}  // namespace curvisplat
