#include "preprocess/formats/netcdf/zarr_array.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/netcdf/netcdf_library.h"
#include "stream/base/error.h"
#include "stream/base/json_document.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;
using Attributes = std::map<std::string, NetcdfAttribute>;

constexpr uint64_t kMaxChunkBytes = uint64_t{500} << 20;
constexpr uint64_t kMaxLength = uint64_t{1} << 48;
constexpr size_t kMaxRank = 32;
constexpr const char* kRewrite = "write it with zlib, zstd or Blosc (xarray's to_zarr)";

// ---- JSON ----

/// Python writes NaN and Infinity, which JSON does not have, without quotes: they get some.
std::string withQuotedNumbers(std::string_view text) {
  constexpr std::string_view kNumbers[] = {"NaN", "-Infinity", "Infinity"};
  std::string quoted;
  bool in_string = false;
  for (size_t n = 0; n < text.size(); ++n) {
    if (text[n] == '"') in_string = !in_string;
    if (in_string && text[n] == '\\' && n + 1 < text.size()) quoted += text[n++];
    const auto* const number =
        std::find_if(std::begin(kNumbers), std::end(kNumbers),
                     [&](std::string_view one) { return !in_string && text.substr(n).starts_with(one); });
    if (number == std::end(kNumbers)) {
      quoted += text[n];
      continue;
    }
    quoted += fmt::format("\"{}\"", *number);
    n += number->size() - 1;
  }
  return quoted;
}

/// A number, or one of the strings that stand for numbers that JSON does not have.
std::optional<double> numberIn(const Json& value) {
  if (value.is_number()) return value.get<double>();
  if (value.is_boolean()) return value.get<bool>() ? 1 : 0;
  if (!value.is_string()) return std::nullopt;
  const auto& text = value.get_ref<const std::string&>();
  if (text == "NaN") return std::numeric_limits<double>::quiet_NaN();
  if (text == "Infinity" || text == "-Infinity")
    return (text[0] == '-' ? -1 : 1) * std::numeric_limits<double>::infinity();
  return std::nullopt;
}

NetcdfAttribute attributeOf(const Json& value) {
  NetcdfAttribute attribute;
  const Json list = value.is_array() ? value : Json::array({value});
  for (const Json& one : list) {
    if (const auto number = one.is_boolean() ? std::nullopt : numberIn(one)) {
      attribute.numbers.push_back(*number);
      if (attribute.type != NC_DOUBLE) attribute.type = one.is_number_integer() ? NC_INT : NC_DOUBLE;
    } else if (one.is_string() || one.is_boolean()) {
      attribute.text += attribute.text.empty() ? "" : " ";
      attribute.text += one.is_boolean() ? (one.get<bool>() ? "true" : "false") : one.get<std::string>();
    }
  }
  if (!attribute.text.empty()) {
    attribute.numbers.clear();
    attribute.type = NC_CHAR;
  }
  return attribute;
}

Attributes attributesIn(const JsonField& object) {
  Attributes attributes;
  for (const std::string& name : object.names())
    if (const auto field = object.find(name)) attributes[name] = attributeOf(field->json());
  return attributes;
}

std::vector<uint64_t> lengthsIn(const JsonField& field, uint64_t least) {
  std::vector<uint64_t> lengths;
  for (const JsonField& length : field.elements(kMaxRank)) lengths.push_back(length.count(least, kMaxLength));
  return lengths;
}

/// The text between the numbers in a chunk's key. Any other could lead out of the store's folder.
std::string separatorIn(const JsonField& field) {
  std::string text = field.text();
  if (text != "." && text != "/") field.fail("\".\" or \"/\"");
  return text;
}

// ---- types ----

struct NamedNumber {
  std::string_view version2, version3;  // "f4", "float32"
  ZarrNumber number;
  size_t bytes;
  int type;
};

constexpr NamedNumber kNumbers[] = {
    {"b1", "bool", ZarrNumber::kUint8, 1, NC_UBYTE},     {"i1", "int8", ZarrNumber::kInt8, 1, NC_BYTE},
    {"u1", "uint8", ZarrNumber::kUint8, 1, NC_UBYTE},    {"i2", "int16", ZarrNumber::kInt16, 2, NC_SHORT},
    {"u2", "uint16", ZarrNumber::kUint16, 2, NC_USHORT}, {"i4", "int32", ZarrNumber::kInt32, 4, NC_INT},
    {"u4", "uint32", ZarrNumber::kUint32, 4, NC_UINT},   {"i8", "int64", ZarrNumber::kInt64, 8, NC_INT64},
    {"u8", "uint64", ZarrNumber::kUint64, 8, NC_UINT64}, {"f2", "float16", ZarrNumber::kHalf, 2, NC_FLOAT},
    {"f4", "float32", ZarrNumber::kFloat, 4, NC_FLOAT},  {"f8", "float64", ZarrNumber::kDouble, 8, NC_DOUBLE},
};

void setNumber(ZarrArray& array, std::string_view name, std::string_view NamedNumber::*names) {
  for (const NamedNumber& one : kNumbers)
    if (one.*names == name) {
      array.number = array.declared = one.number;
      array.value_bytes = one.bytes;
    }
}

void setText(ZarrArray& array, ZarrArray::Text text, uint64_t bytes) {
  array.text = text;
  array.value_bytes = bytes;
}

/// NumPy's name of a type: "<f4", "|S19", "<U5", "|O".
void setType2(ZarrArray& array, const Json& type) {
  constexpr uint64_t kMaxCharacters = 1 << 16;
  if (!type.is_string()) return;  // a structure
  const auto name = type.get<std::string>();
  if (name.size() < 2) return;
  array.big_endian = name[0] == '>';
  setNumber(array, std::string_view(name).substr(1), &NamedNumber::version2);
  double characters = 0;
  if (name.size() < 3 || !parseNumber(std::string_view(name).substr(2), characters) || !(characters >= 1) ||
      !(characters <= kMaxCharacters))
    return;
  if (name[1] == 'S') setText(array, ZarrArray::Text::kBytes, static_cast<uint64_t>(characters));
  if (name[1] == 'U') setText(array, ZarrArray::Text::kUtf32, 4 * static_cast<uint64_t>(characters));
}

void setType3(ZarrArray& array, const JsonField& type) {
  constexpr uint64_t kMaxTextBytes = 1 << 18;
  const std::string name = type.isObject() ? type.at("name").text() : type.text();
  setNumber(array, name, &NamedNumber::version3);
  if (name == "string" || name == "variable_length_utf8") setText(array, ZarrArray::Text::kVariable, 0);
  if (!type.isObject() || !type.has("configuration") || !type.at("configuration").has("length_bytes")) return;
  const uint64_t bytes = type.at("configuration").at("length_bytes").count(1, kMaxTextBytes);
  if (name == "null_terminated_bytes") setText(array, ZarrArray::Text::kBytes, bytes);
  if (name == "fixed_length_utf32" && bytes % 4 == 0) setText(array, ZarrArray::Text::kUtf32, bytes);
}

/// "0x7fc00000": the bits of a number.
std::optional<double> numberOfBits(std::string_view text, size_t bytes) {
  if (!text.starts_with("0x") || text.size() != 2 + 2 * bytes) return std::nullopt;
  uint64_t bits = 0;
  for (const char c : text.substr(2)) {
    const auto digit = std::string_view("0123456789abcdef").find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    bits = bits << 4 | digit;
  }
  if (bytes == 4) return std::bit_cast<float>(static_cast<uint32_t>(bits));
  if (bytes == 8) return std::bit_cast<double>(bits);
  return std::nullopt;
}

std::optional<double> fillOf(const ZarrArray& array, const JsonField& metadata) {
  const auto field = metadata.find("fill_value");
  if (!field) return std::nullopt;
  auto number = numberIn(field->json());
  if (!number && field->isText()) number = numberOfBits(field->text(), array.value_bytes);
  // libnetcdf writes its own in six digits.
  constexpr double kNetcdf = NC_FILL_DOUBLE;
  if (number && std::abs(*number - kNetcdf) < 1e-6 * kNetcdf) number = kNetcdf;
  return number;
}

// ---- codecs ----

/// The number that NumPy calls `name` ("<i2"), in little-endian; null if it is another.
const NamedNumber* littleEndian(const std::string& name) {
  const auto* const found =
      std::find_if(std::begin(kNumbers), std::end(kNumbers), [&](const NamedNumber& one) {
        return name == one.version2 || name == fmt::format("<{}", one.version2) ||
               (one.bytes == 1 && name == fmt::format("|{}", one.version2));
      });
  return found == std::end(kNumbers) || found->number == ZarrNumber::kHalf ? nullptr : found;
}

/// Adds a filter of numbers; false if it is not read. Rounded numbers are stored as they are.
bool addFilter(ZarrArray& array, std::string_view name, const JsonField& filter) {
  if (name == "bitround") return true;
  if (!filter.has("dtype") || array.big_endian) return false;
  const NamedNumber* const values = littleEndian(filter.at("dtype").text());
  const NamedNumber* const stored = filter.has("astype") ? littleEndian(filter.at("astype").text()) : values;
  if (!values || !stored || values->number != array.number) return false;
  if (name == "quantize") return stored == values;
  if (name == "delta" && stored == values) {
    array.codecs.push_back({ZarrCodec::Kind::kDelta, stored->bytes, stored->number});
    return true;
  }
  if (name != "fixedscaleoffset" || !array.codecs.empty()) return false;
  array.scale = filter.at("scale").number();
  array.offset = filter.at("offset").number();
  array.number = stored->number;
  array.value_bytes = stored->bytes;
  return array.scale != 0;
}

/// Adds a codec by its name in either version; false if it is not read.
bool addCodec(ZarrArray& array, std::string_view name, const std::optional<JsonField>& configuration) {
  using Kind = ZarrCodec::Kind;
  if (name.starts_with("numcodecs.")) name.remove_prefix(std::string_view("numcodecs.").size());
  constexpr std::pair<std::string_view, Kind> kKinds[] = {
      {"gzip", Kind::kZlib},       {"zlib", Kind::kZlib},   {"zstd", Kind::kZstd},
      {"blosc", Kind::kBlosc},     {"lz4", Kind::kLz4},     {"shuffle", Kind::kShuffle},
      {"crc32c", Kind::kChecksum}, {"crc32", Kind::kCrc32}, {"adler32", Kind::kAdler32}};
  for (const auto& [known, kind] : kKinds) {
    if (known != name) continue;
    const bool at_end = kind == Kind::kChecksum;
    if (configuration && configuration->has("location") &&
        (configuration->at("location").text() == "end") != at_end)
      return false;
    size_t bytes = 0;
    if (kind == Kind::kShuffle) {
      const char* const key =
          configuration && configuration->has("elementsize") ? "elementsize" : "element_size";
      bytes = configuration && configuration->has(key) ? configuration->at(key).count(1, 256) : 4;
    }
    array.codecs.push_back({kind, bytes, ZarrNumber::kNone});
    return true;
  }
  return configuration && addFilter(array, name, *configuration);
}

void refuse(ZarrArray& array, std::string reason) {
  if (array.refused.empty()) array.refused = std::move(reason);
}

void refuseCodec(ZarrArray& array, const std::string& name) {
  refuse(array, fmt::format("is stored with the codec '{}', which is not read; {}", name, kRewrite));
}

/// Adds the codecs of version 3: those that change arrays (transpose, sharding), one that makes bytes of
/// values, those that change bytes.
void addCodecs3(ZarrArray& array, const JsonField& codecs, bool in_shard) {
  for (const JsonField& codec : codecs.elements(kMaxRank)) {
    const std::string name = codec.isText() ? codec.text() : codec.at("name").text();
    const auto configuration = codec.isObject() ? codec.find("configuration") : std::nullopt;
    if (name == "bytes" || name == "endian") {
      const auto order = configuration ? configuration->find("endian") : std::nullopt;
      array.big_endian = order && order->text() == "big";
    } else if (name == "vlen-utf8") {
      if (array.text != ZarrArray::Text::kVariable) refuseCodec(array, name);
    } else if (name == "transpose" && configuration && configuration->at("order").isArray() &&
               !array.sharded == !in_shard) {
      const std::vector<uint64_t> order = lengthsIn(configuration->at("order"), 0);
      std::vector<uint64_t> sorted = order;
      std::sort(sorted.begin(), sorted.end());
      if (!std::equal(sorted.begin(), sorted.end(), array.stored_axes.begin(), array.stored_axes.end()))
        configuration->at("order").fail("each axis once");
      array.stored_axes.assign(order.begin(), order.end());
    } else if (name == "sharding_indexed" && configuration && !in_shard && codecs.size() == 1) {
      const std::vector<uint64_t> inner = lengthsIn(configuration->at("chunk_shape"), 1);
      bool divides = inner.size() == array.chunks.size();
      for (size_t axis = 0; divides && axis < inner.size(); ++axis) {
        divides = array.chunks[axis] % inner[axis] == 0;
        array.shards[axis] = array.chunks[axis] / inner[axis];
      }
      if (!divides) configuration->at("chunk_shape").fail("a divisor of each axis of the shard");
      array.chunks = inner;
      array.sharded = true;
      const auto place = configuration->find("index_location");
      array.index_first = place && place->text() == "start";
      for (const JsonField& of_index : configuration->at("index_codecs").elements(kMaxRank)) {
        const std::string index_codec = of_index.at("name").text();
        const bool big = of_index.has("configuration") && of_index.at("configuration").has("endian") &&
                         of_index.at("configuration").at("endian").text() == "big";
        array.index_checked |= index_codec == "crc32c";
        if ((index_codec != "bytes" && index_codec != "crc32c") || big)
          refuse(array, fmt::format("has shards whose index is stored with '{}', which is not read; {}",
                                    index_codec, kRewrite));
      }
      addCodecs3(array, configuration->at("codecs"), true);
    } else if (!addCodec(array, name, configuration)) {
      refuseCodec(array, name);
    }
  }
}

/// Sets what both versions share, once the types are known.
void complete(ZarrArray& array, const JsonField& metadata, const std::string& file) {
  const size_t rank = array.shape.size();
  if (array.chunks.size() != rank)
    throw Error("{}: has {} axes, but chunks of {}; the store is damaged: copy or write it again", file, rank,
                array.chunks.size());
  double bytes = static_cast<double>(std::max<size_t>(1, array.value_bytes));
  for (const uint64_t length : array.chunks) bytes *= static_cast<double>(length);
  if (bytes > static_cast<double>(kMaxChunkBytes))
    refuse(array,
           fmt::format("has chunks of {:.0f} MiB (expected at most {}, since a chunk is decompressed as a "
                       "whole); write it with smaller chunks (xarray's chunk() before to_zarr())",
                       bytes / (1 << 20), kMaxChunkBytes >> 20));
  array.dimensions.resize(rank);
  if (const auto fill = fillOf(array, metadata)) array.fill = *fill;
}

/// Sets the names of the dimensions: xarray's, or those of libnetcdf's arrays ("/lat").
void nameDimensions2(ZarrArray& array, const JsonField& metadata,
                     const std::optional<JsonField>& attributes) {
  std::vector<std::string> names;
  if (const auto of_xarray = attributes ? attributes->find("_ARRAY_DIMENSIONS") : std::nullopt)
    names = of_xarray->texts();
  else if (const auto of_netcdf = metadata.find("_NCZARR_ARRAY"); of_netcdf && of_netcdf->has("dimrefs"))
    for (const std::string& name : of_netcdf->at("dimrefs").texts())
      names.push_back(name.substr(name.rfind('/') + 1));
  if (names.size() == array.shape.size()) array.dimensions = std::move(names);
}

/// Adds _FillValue: xarray takes the fill value of version 2 for that of missing values. A coordinate has none.
void addFillOfVersion2(ZarrArray& array, const JsonField& metadata) {
  const bool coordinate = array.dimensions.size() == 1 && array.dimensions[0] == array.name;
  if (array.number == ZarrNumber::kNone || coordinate || array.attributes.contains("_FillValue")) return;
  if (const auto fill = fillOf(array, metadata)) {
    NetcdfAttribute attribute;
    attribute.numbers = {*fill};
    attribute.type = array.type();
    array.attributes["_FillValue"] = std::move(attribute);
  }
}

/// Decodes _FillValue of version 3, which xarray writes as the eight bytes of a double in base64.
void decodeFillOfVersion3(ZarrArray& array) {
  const auto found = array.attributes.find("_FillValue");
  if (found == array.attributes.end() || found->second.text.size() != 12 ||
      !found->second.text.ends_with('='))
    return;
  uint64_t bits = 0;
  const std::string_view text = std::string_view(found->second.text).substr(0, 11);
  std::array<std::byte, 9> bytes{};
  for (size_t n = 0; n < 12; ++n) {
    const size_t digit =
        n < text.size() ? std::string_view("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/")
                              .find(text[n])
                        : 0;
    if (digit == std::string_view::npos) return;
    bits = bits << 6 | digit;
    if (n % 4 == 3)
      for (size_t k = 0; k < 3; ++k) bytes[n / 4 * 3 + k] = static_cast<std::byte>(bits >> (16 - 8 * k));
  }
  double value = 0;
  std::memcpy(&value, bytes.data(), sizeof value);
  found->second.text.clear();
  found->second.numbers = {value};
  found->second.type = NC_DOUBLE;
}

}  // namespace

uint64_t ZarrArray::chunkValues() const {
  return std::accumulate(chunks.begin(), chunks.end(), uint64_t{1}, std::multiplies<>());
}

uint64_t ZarrArray::chunksInShard() const {
  return std::accumulate(shards.begin(), shards.end(), uint64_t{1}, std::multiplies<>());
}

int ZarrArray::type() const {
  if (text == Text::kBytes) return NC_CHAR;
  if (text != Text::kNone) return NC_STRING;
  for (const NamedNumber& one : kNumbers)
    if (one.number == declared) return one.type;
  return NC_NAT;
}

Attributes zarrAttributes(std::string_view text, const std::string& file) {
  const JsonDocument document(withQuotedNumbers(text), file, "the attributes of a Zarr store");
  return attributesIn(document.root());
}

ZarrArray zarrArray2(const std::string& name, std::string_view array_text, std::string_view attributes_text,
                     const std::string& file) {
  const JsonDocument document(withQuotedNumbers(array_text), file, "the metadata of a Zarr array");
  const JsonField metadata = document.root();
  ZarrArray array;
  array.name = name;
  array.shape = lengthsIn(metadata.at("shape"), 0);
  array.chunks = lengthsIn(metadata.at("chunks"), 1);
  array.shards.assign(array.chunks.size(), 1);
  array.stored_axes.resize(array.chunks.size());
  std::iota(array.stored_axes.begin(), array.stored_axes.end(), size_t{0});
  if (const auto order = metadata.find("order"); order && order->text() == "F")
    std::reverse(array.stored_axes.begin(), array.stored_axes.end());
  setType2(array, metadata.at("dtype").json());
  array.separator = ".";
  if (const auto separator = metadata.find("dimension_separator")) array.separator = separatorIn(*separator);
  if (const auto filters = metadata.find("filters"))
    for (const JsonField& filter : filters->elements(kMaxRank)) {
      const std::string id = filter.at("id").text();
      if (id == "vlen-utf8")
        setText(array, ZarrArray::Text::kVariable, 0);
      else if (!addCodec(array, id, filter))
        refuseCodec(array, id);
    }
  if (const auto compressor = metadata.find("compressor"))
    if (const std::string id = compressor->at("id").text(); !addCodec(array, id, compressor))
      refuseCodec(array, id);
  complete(array, metadata, file);
  const JsonDocument attributes(attributes_text.empty() ? "{}" : withQuotedNumbers(attributes_text), file,
                                "the attributes of a Zarr array");
  array.attributes = attributesIn(attributes.root());
  nameDimensions2(array, metadata, attributes.root());
  addFillOfVersion2(array, metadata);
  return array;
}

ZarrNode zarrNode3(const std::string& name, std::string_view text, const std::string& file) {
  const JsonDocument document(withQuotedNumbers(text), file, "the metadata of a Zarr store");
  const JsonField metadata = document.root();
  ZarrNode node;
  if (const auto attributes = metadata.find("attributes")) node.attributes = attributesIn(*attributes);
  if (metadata.at("node_type").text() != "array") return node;
  ZarrArray& array = node.array.emplace();
  array.name = name;
  array.version = 3;
  array.shape = lengthsIn(metadata.at("shape"), 0);
  const JsonField grid = metadata.at("chunk_grid");
  if (grid.at("name").text() != "regular") grid.at("name").fail("\"regular\"");
  array.chunks = lengthsIn(grid.at("configuration").at("chunk_shape"), 1);
  array.shards.assign(array.chunks.size(), 1);
  array.stored_axes.resize(array.chunks.size());
  std::iota(array.stored_axes.begin(), array.stored_axes.end(), size_t{0});
  setType3(array, metadata.at("data_type"));
  const JsonField keys = metadata.at("chunk_key_encoding");
  const bool as_version2 = keys.at("name").text() == "v2";
  array.prefix = as_version2 ? "" : "c";
  array.separator = as_version2 ? "." : "/";
  if (const auto configuration = keys.find("configuration"); configuration && configuration->has("separator"))
    array.separator = separatorIn(configuration->at("separator"));
  addCodecs3(array, metadata.at("codecs"), false);
  if (const auto names = metadata.find("dimension_names"); names && names->size() == array.shape.size())
    for (const JsonField& dimension : names->elements())
      array.dimensions.push_back(dimension.isText() ? dimension.text() : "");
  complete(array, metadata, file);
  array.attributes = node.attributes;
  decodeFillOfVersion3(array);
  return node;
}

}  // namespace curvisplat
