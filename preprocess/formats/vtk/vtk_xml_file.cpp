#include "preprocess/formats/vtk/vtk_xml_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "preprocess/formats/common/ascii_spool.h"
#include "preprocess/formats/common/stored_values.h"
#include "preprocess/formats/vtk/base64_bytes.h"
#include "preprocess/formats/vtk/xml_skeleton.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

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
  XmlSkeleton skeleton = xmlSkeleton(*file_);
  markup_ = std::move(skeleton.text);
  appended_begin_ = skeleton.appended_begin;
  const pugi::xml_parse_result parsed =
      document_.load_buffer_inplace(markup_.data(), markup_.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!parsed) fail(fmt::format("is not valid XML: {}", parsed.description()));
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
