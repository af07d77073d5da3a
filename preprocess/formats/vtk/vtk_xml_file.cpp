#include "preprocess/formats/vtk/vtk_xml_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/vtk/encoded_bytes.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// The markup of an XML file without the text between the tags, which in VTK files is data of any size. The
/// skeleton is small enough to be parsed as a whole. It contains the position of each text instead.
struct XmlSkeleton {
  /// The markup. Each text is replaced by the positions in the file of its first byte and after its last
  /// one, as "120 4711", not counting white space around it. White space between tags and comments are
  /// dropped.
  std::string text;
  /// Position of the first byte after the underscore of <AppendedData>; 0: there is none. The file is not
  /// scanned beyond it, since the data need not be XML.
  uint64_t appended_begin = 0;
};

constexpr size_t kBufferBytes = size_t{256} << 10;
constexpr size_t kMaxMarkupBytes = size_t{16} << 20;
constexpr size_t kMaxTagBytes = size_t{64} << 10;
constexpr size_t kMaxDepth = 64;

bool isSpace(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

/// Makes the skeleton of a file.
class Scanner {
 public:
  explicit Scanner(const PooledFile& file) : file_(file), buffer_(kBufferBytes) {}

  /// Scans the file up to its end, or to its <AppendedData>, through a buffer. Throws Error if the tags are
  /// not properly nested, or if they have more than 16 MiB.
  XmlSkeleton run() {
    for (std::string tag; skipText(); tag.clear()) {
      readTag(tag);
      if (tag.starts_with("<!--") || tag.starts_with("<?")) continue;
      if (tag.starts_with("<!"))
        throw Error("{}: byte {}: found {}, which is not allowed in a VTK file", file_.name(), at_,
                    tag.substr(0, std::min<size_t>(30, tag.find_first_of(" [>"))));
      if (!nest(tag)) break;
      if (skeleton_.text.size() > kMaxMarkupBytes)
        throw Error("{}: has more than {} bytes of XML tags; expected fewer pieces or arrays in one file",
                    file_.name(), kMaxMarkupBytes);
    }
    if (skeleton_.text.empty()) throw Error("{}: has no XML element", file_.name());
    return std::move(skeleton_);
  }

 private:
  /// Ensures that the byte at `at_` is in the buffer. False at the end of the file.
  bool fill() {
    if (at_ < buffer_begin_ + filled_ && at_ >= buffer_begin_) return true;
    if (at_ >= file_.size()) return false;
    buffer_begin_ = at_;
    filled_ = static_cast<size_t>(std::min<uint64_t>(buffer_.size(), file_.size() - at_));
    file_.readAt(at_, std::as_writable_bytes(std::span(buffer_).first(filled_)));
    return true;
  }
  std::string_view available() const {
    const auto used = static_cast<size_t>(at_ - buffer_begin_);
    return {&buffer_[used], filled_ - used};
  }

  /// A name in a message: in a damaged file, it may be any bytes.
  static std::string shown(std::string_view name) {
    constexpr size_t kLongest = 40;
    return printable(name.substr(0, kLongest)) + (name.size() > kLongest ? "..." : "");
  }
  [[noreturn]] void failTruncated() const {
    throw Error("{}: ends at byte {}, inside {}; the file is truncated", file_.name(), file_.size(),
                open_.empty() ? "its first tag" : "<" + shown(open_.back()) + ">");
  }

  /// Skips to the next tag and appends the range of the skipped text to the skeleton. False at the end of
  /// the file.
  bool skipText() {
    uint64_t begin = 0, end = 0;
    while (fill()) {
      const std::string_view piece = available();
      const std::string_view text = piece.substr(0, piece.find('<'));
      const auto first = std::find_if_not(text.begin(), text.end(), isSpace);
      if (first != text.end()) {
        if (end == 0) begin = at_ + static_cast<uint64_t>(first - text.begin());
        const auto last = std::find_if_not(text.rbegin(), text.rend(), isSpace);
        end = at_ + static_cast<uint64_t>(last.base() - text.begin());
      }
      at_ += text.size();
      if (text.size() < piece.size()) {
        if (end > 0 && !open_.empty()) skeleton_.text += fmt::format("{} {}", begin, end);
        return true;
      }
    }
    if (!open_.empty()) failTruncated();
    return false;
  }

  /// Reads a tag from '<' to the matching '>'.
  void readTag(std::string& tag) {
    char quote = 0;
    while (fill()) {
      const char c = available().front();
      ++at_;
      tag += c;
      if (tag.size() > kMaxTagBytes)
        throw Error("{}: byte {}: found a tag of more than {} characters", file_.name(), at_, kMaxTagBytes);
      const bool comment = tag.starts_with("<!--");
      if (c == '>' && quote == 0 && (!comment || (tag.size() >= 7 && tag.ends_with("-->")))) return;
      if (comment) continue;
      if (quote == 0 && (c == '"' || c == '\''))
        quote = c;
      else if (c == quote)
        quote = 0;
    }
    failTruncated();
  }

  /// Appends a tag to the skeleton. False if the skeleton is complete.
  bool nest(const std::string& tag) {
    const bool closes = tag[1] == '/';
    const size_t name_begin = closes ? 2 : 1;
    const std::string name = tag.substr(name_begin, tag.find_first_of(" \t\r\n/>", name_begin) - name_begin);
    if (closes) {
      if (open_.empty() || open_.back() != name)
        throw Error("{}: byte {}: </{}> without <{}>; the file is damaged", file_.name(), at_, shown(name),
                    shown(name));
      open_.pop_back();
      skeleton_.text += tag;
      return !open_.empty();
    }
    skeleton_.text += tag;
    if (tag[tag.size() - 2] == '/') return !open_.empty();
    open_.push_back(name);
    if (open_.size() > kMaxDepth)
      throw Error("{}: byte {}: elements are nested more than {} deep", file_.name(), at_, kMaxDepth);
    if (name != "AppendedData") return true;
    findAppendedData();
    for (; !open_.empty(); open_.pop_back()) skeleton_.text += "</" + open_.back() + ">";
    return false;
  }

  void findAppendedData() {
    while (fill() && isSpace(available().front())) ++at_;
    if (!fill()) failTruncated();
    if (available().front() != '_')
      throw Error("{}: byte {}: expected the underscore before the appended data", file_.name(), at_);
    skeleton_.appended_begin = at_ + 1;
  }

  const PooledFile& file_;
  XmlSkeleton skeleton_;
  std::vector<std::string> open_;  // names of the open elements
  std::vector<char> buffer_;
  uint64_t buffer_begin_ = 0, at_ = 0;  // in the file
  size_t filled_ = 0;
};

constexpr std::pair<const char*, VtkType> kTypes[] = {
    {"Int8", VtkType::kInt8},       {"UInt8", VtkType::kUint8},   {"Int16", VtkType::kInt16},
    {"UInt16", VtkType::kUint16},   {"Int32", VtkType::kInt32},   {"UInt32", VtkType::kUint32},
    {"Int64", VtkType::kInt64},     {"UInt64", VtkType::kUint64}, {"Float32", VtkType::kFloat32},
    {"Float64", VtkType::kFloat64},
};

std::optional<VtkType> typeNamed(const std::string& name) {
  for (const auto& [word, type] : kTypes)
    if (name == word) return type;
  return std::nullopt;
}

/// Removes the next word from `text` and returns it.
std::string_view takeWord(std::string_view& text) {
  constexpr const char* kSpace = " \t\r\n";
  text.remove_prefix(std::min(text.find_first_not_of(kSpace), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kSpace));
  text.remove_prefix(word.size());
  return word;
}

/// Programs in Fortran pad words to the length of their variables: NumberOfPoints="      120".
void trimAttributes(const pugi::xml_node& node) {
  for (pugi::xml_attribute attribute : node.attributes()) {
    const std::string_view text = attribute.value(), word = trimmed(text);
    if (word.size() < text.size()) attribute.set_value(std::string(word).c_str());
  }
  for (const pugi::xml_node child : node.children()) trimAttributes(child);
}

template <typename Integer>
bool parseInteger(std::string_view text, Integer& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace

bool isVtkXml(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), 4096)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  const size_t first = begin.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return first != std::string::npos && begin[first] == '<' && begin.find("<VTKFile") != std::string::npos;
}

VtkXmlFile::VtkXmlFile(const VtkFiles& files, const std::filesystem::path& path)
    : file_(std::make_shared<const PooledFile>(files.pool, path)), spool_(files.spool) {
  if (!isVtkXml(*files.pool->at(path))) fail("is not a VTK XML file");
  XmlSkeleton skeleton = Scanner(*file_).run();
  markup_ = std::move(skeleton.text);
  appended_begin_ = skeleton.appended_begin;
  const pugi::xml_parse_result parsed =
      document_.load_buffer_inplace(markup_.data(), markup_.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!parsed) fail(fmt::format("is not valid XML: {}", parsed.description()));
  trimAttributes(document_);
  root_ = document_.child("VTKFile");
  type_ = root_.attribute("type").value();
  if (!root_ || type_.empty()) fail("has no <VTKFile type=...>");

  const std::string order = root_.attribute("byte_order").as_string("LittleEndian");
  if (order != "LittleEndian" && order != "BigEndian")
    fail(fmt::format("has byte_order {}; expected LittleEndian or BigEndian", order));
  header_.order = order == "BigEndian" ? ByteOrder::kBig : ByteOrder::kLittle;
  const std::string integers = root_.attribute("header_type").as_string("UInt32");
  if (integers != "UInt32" && integers != "UInt64")
    fail(fmt::format("has header_type {}; expected UInt32 or UInt64", integers));
  header_.bytes = integers == "UInt64" ? 8 : 4;
  const std::string compressor = root_.attribute("compressor").value();
  if (compressor == "vtkZLibDataCompressor")
    compressor_ = BlockCompressor::kZlib;
  else if (compressor == "vtkLZ4DataCompressor")
    compressor_ = BlockCompressor::kLz4;
  else if (compressor == "vtkLZMADataCompressor")
    compressor_ = BlockCompressor::kLzma;
  else if (!compressor.empty())
    fail(fmt::format("is compressed by {}; expected zlib, LZ4 or LZMA; write it with one of these",
                     compressor));

  const std::string encoding = root_.child("AppendedData").attribute("encoding").as_string("base64");
  if (encoding != "base64" && encoding != "raw")
    fail(fmt::format("has appended data in {}; expected raw or base64", encoding));
  appended_base64_ = encoding == "base64";
}

void VtkXmlFile::fail(const std::string& what) const {
  throw Error("{}: {}", name(), what);
}

pugi::xml_node VtkXmlFile::content() const {
  const pugi::xml_node node = root_.child(type_.c_str());
  if (!node) fail(fmt::format("has no <{}>", type_));
  return node;
}

std::string VtkXmlFile::encoding(const pugi::xml_node& node) const {
  const std::string format = node.attribute("format").as_string("ascii");
  if (format == "ascii") return "ASCII";
  std::string words = header_.order == ByteOrder::kBig ? "big-endian" : "little-endian";
  words += format == "binary" ? ", inline base64" : appended_base64_ ? ", appended base64" : ", appended raw";
  if (compressor_)
    words += *compressor_ == BlockCompressor::kZlib  ? ", zlib"
             : *compressor_ == BlockCompressor::kLz4 ? ", LZ4"
                                                     : ", LZMA";
  return words;
}

std::vector<double> VtkXmlFile::numbers(const pugi::xml_node& node, const char* attribute,
                                        size_t count) const {
  std::string_view text = node.attribute(attribute).value();
  std::vector<double> values(count);
  bool good = true;
  for (double& value : values) good = good && parseNumber(takeWord(text), value) && std::isfinite(value);
  if (!good || !takeWord(text).empty())
    fail(fmt::format("<{}> has {}=\"{}\"; expected {} numbers", node.name(), attribute,
                     node.attribute(attribute).value(), count));
  return values;
}

std::optional<VtkExtent> VtkXmlFile::extent(const pugi::xml_node& node, const char* attribute) const {
  // Sums and products of a few of them stay below 2^63.
  constexpr int64_t kMaxIndex = int64_t{1} << 30;
  constexpr double kMaxNodes = 1e14;
  std::string_view text = node.attribute(attribute).value();
  std::array<int64_t, 6> ends{};
  bool good = true;
  for (int64_t& end : ends)
    good = good && parseInteger(takeWord(text), end) && -kMaxIndex < end && end < kMaxIndex;
  if (good && takeWord(text).empty() && ends == std::array<int64_t, 6>{0, -1, 0, -1, 0, -1})
    return std::nullopt;
  VtkExtent extent{{ends[0], ends[2], ends[4]}, {ends[1], ends[3], ends[5]}};
  double nodes = 1;
  for (size_t axis = 0; axis < 3; ++axis) {
    good = good && extent.lower[axis] <= extent.upper[axis];
    nodes *= static_cast<double>(extent.upper[axis] - extent.lower[axis] + 1);
  }
  if (!good || nodes > kMaxNodes || !takeWord(text).empty())
    fail(fmt::format("<{}> has {}=\"{}\"; expected the first and last node along i, j and k", node.name(),
                     attribute, node.attribute(attribute).value()));
  return extent;
}

VtkXmlFile::Part VtkXmlFile::textOf(const pugi::xml_node& node) const {
  std::string_view text = node.child_value();
  Part part;
  if (!parseInteger(takeWord(text), part.begin) || !parseInteger(takeWord(text), part.end))
    fail(fmt::format("array {} is empty", node.attribute("Name").value()));
  return part;
}

std::optional<VtkArray> VtkXmlFile::numericArray(const pugi::xml_node& node, uint64_t tuples) const {
  const std::string type = node.attribute("type").value();
  if (!typeNamed(type)) return std::nullopt;
  return array(node, tuples);
}

VtkArray VtkXmlFile::array(const pugi::xml_node& node, uint64_t tuples) const {
  VtkArray array;
  array.name = node.attribute("Name").value();
  const std::string type = node.attribute("type").value();
  const std::optional<VtkType> known = typeNamed(type);
  if (!known)
    fail(fmt::format("array {} has type {}; expected Float32 or another numeric type", array.name, type));
  array.type = *known;
  const std::string components = node.attribute("NumberOfComponents").as_string("1");
  if (!parseInteger(std::string_view(components), array.components) || array.components == 0 ||
      array.components > kMaxComponents)
    fail(fmt::format("array {} has NumberOfComponents {}; expected 1 to {}", array.name, components,
                     kMaxComponents));
  array.tuples = tuples;
  for (uint32_t c = 0; c < array.components; ++c) {
    const auto component = node.attribute(fmt::format("ComponentName{}", c).c_str());
    if (!component) break;
    array.component_names.push_back(component.value());
  }

  const std::string format = node.attribute("format").as_string("ascii");
  if (format == "ascii") {
    array.order = kMachineByteOrder;
    array.bytes = text(array, textOf(node));
  } else if (format == "binary") {
    array.order = header_.order;
    array.bytes = stored(node, array, textOf(node), true);
  } else if (format == "appended") {
    const std::string offset = node.attribute("offset").value();
    Part part{0, file_->size()};
    if (appended_begin_ == 0 || !parseInteger(std::string_view(offset), part.begin) ||
        part.begin > file_->size() - appended_begin_)
      fail(fmt::format("array {} is at offset \"{}\" of the appended data, which {}", array.name, offset,
                       appended_begin_ == 0 ? "is missing" : "is shorter; the file is truncated"));
    part.begin += appended_begin_;
    array.order = header_.order;
    array.bytes = stored(node, array, part, appended_base64_);
  } else {
    fail(fmt::format("array {} has format {}; expected ascii, binary or appended", array.name, format));
  }
  return array;
}

std::shared_ptr<const ByteSource> VtkXmlFile::text(const VtkArray& array, Part part) const {
  const uint64_t numbers = array.tuples * array.components;
  // A number needs a digit and a space.
  if (numbers > (part.end - part.begin + 1) / 2)
    fail(fmt::format("array {} needs {} numbers, but its text has only {} characters", array.name, numbers,
                     part.end - part.begin));
  const auto make = [file = file_, part, numbers, type = array.type,
                     name = array.name](const SpoolFile::Sink& sink) {
    TextReader reader(file, part.begin, part.end);
    packNumbers(reader, name, numbers, type, sink);
    if (!reader.peekWord().empty())
      throw Error("{}: byte {}: array {} has more than {} numbers", file->name(), reader.offset(), name,
                  numbers);
  };
  return std::make_shared<SpooledBytes>(spool_, numbers * bytesOf(array.type), make);
}

std::shared_ptr<const ByteSource> VtkXmlFile::stored(const pugi::xml_node& node, const VtkArray& array,
                                                     Part part, bool base64) const {
  const std::string place =
      fmt::format("{}: array {}", name(), node.attribute("Name").as_string("(no name)"));
  const uint64_t bytes = array.tuples * array.tupleBytes();
  const auto encoded = base64 ? std::make_shared<const Base64Bytes>(file_, part.begin, part.end) : nullptr;
  std::shared_ptr<const ByteSource> all = encoded;
  if (!all) all = std::make_shared<const FileBytes>(file_, part.begin, part.end);
  const uint64_t first = header_.at(*all, 0);

  std::shared_ptr<const ByteSource> behind;  // the bytes after the header
  uint64_t head_bytes = header_.bytes;
  if (compressor_) {
    if (first >= all->size() / header_.bytes)
      fail(fmt::format(
          "array {} should have {} compressed blocks, more than its bytes have room for; the file is damaged",
          array.name, first));
    head_bytes = (3 + first) * header_.bytes;
  }
  if (encoded && (compressor_ || encoded->endsWith(head_bytes)))
    behind = encoded->behind(head_bytes);
  else if (head_bytes <= all->size())
    behind = std::make_shared<const BytesBehind>(all, head_bytes);
  else
    throw Error("{}: its header of {} bytes is incomplete; the file is truncated", place, head_bytes);

  if (compressor_) return compressedBytes({all, behind, header_, *compressor_, place}, bytes, spool_);
  if (first != bytes)
    throw Error("{}: should have {} bytes ({} tuples of {}), but its header declares {}", place, bytes,
                array.tuples, array.tupleBytes(), first);
  if (behind->size() < bytes)
    throw Error("{}: should have {} bytes, but {} are left in the file; it is truncated", place, bytes,
                behind->size());
  std::byte last;
  behind->readAt(bytes - 1, std::span(&last, 1));
  return behind;
}

}  // namespace curvisplat
