#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "render/mesh/mesh_formats.h"

namespace curvisplat {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct Property {
  std::string name;
  Type type{};
  std::optional<Type> counted_by;  // of a list
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false, big_endian = false;
  std::vector<Element> elements;
  size_t size = 0;
};

size_t bytesOf(Type type) {
  switch (type) {
    case Type::kInt8:
    case Type::kUint8:
      return 1;
    case Type::kInt16:
    case Type::kUint16:
      return 2;
    case Type::kDouble:
      return 8;
    default:
      return 4;
  }
}

Type typeOf(std::string_view name, const std::filesystem::path& path) {
  constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::kInt8},     {"int8", Type::kInt8},     {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},   {"short", Type::kInt16},   {"int16", Type::kInt16},
      {"ushort", Type::kUint16}, {"uint16", Type::kUint16}, {"int", Type::kInt32},
      {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
      {"float", Type::kFloat},   {"float32", Type::kFloat}, {"double", Type::kDouble},
      {"float64", Type::kDouble}};
  for (const auto& [word, type] : kTypes)
    if (word == name) return type;
  throw Error("{}: a property has the type '{}', which PLY files do not have", path.string(),
              name.substr(0, 32));
}

Header parseHeader(std::string_view bytes, const std::filesystem::path& path) {
  constexpr size_t kMaxHeader = 1 << 16;
  MeshText text(bytes.substr(0, kMaxHeader), path);
  Header header;
  bool format = false;
  while (text.nextLine()) {
    const std::string_view word = text.wordOfLine();
    if (word == "end_header") {
      if (!format) throw Error("{}: the header has no format", path.string());
      text.nextLine();
      header.size = std::min(bytes.size(), kMaxHeader) - text.left();
      return header;
    }
    if (word == "format") {
      const std::string_view name = text.wordOfLine();
      header.ascii = name == "ascii";
      header.big_endian = name == "binary_big_endian";
      if (!header.ascii && !header.big_endian && name != "binary_little_endian")
        throw Error("{}: the format is '{}' (expected ascii, binary_little_endian or binary_big_endian)",
                    path.string(), name.substr(0, 32));
      format = true;
    } else if (word == "element") {
      Element& element = header.elements.emplace_back();
      element.name = text.wordOfLine();
      const std::string_view count = text.wordOfLine();
      const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (error != std::errc{} || end != count.data() + count.size())
        throw Error("{}: element {} has no number (found '{}')", path.string(), element.name.substr(0, 32),
                    count.substr(0, 32));
    } else if (word == "property") {
      if (header.elements.empty()) throw Error("{}: a property comes before any element", path.string());
      Property& property = header.elements.back().properties.emplace_back();
      std::string_view type = text.wordOfLine();
      if (type == "list") {
        property.counted_by = typeOf(text.wordOfLine(), path);
        type = text.wordOfLine();
      }
      property.type = typeOf(type, path);
      property.name = text.wordOfLine();
    }
  }
  throw Error("{}: is truncated: the header has no end_header in its first {} bytes", path.string(),
              kMaxHeader);
}

/// Values one after the other, from text or bytes.
class Values {
 public:
  Values(std::string_view bytes, const Header& header, const std::filesystem::path& path)
      : bytes_(bytes), text_(bytes, path), header_(header), path_(path) {}

  double next(Type type) {
    if (header_.ascii) return text_.number();
    const size_t size = bytesOf(type);
    if (bytes_.size() - at_ < size)
      throw Error("{}: is truncated: it ends within its {}", path_.string(), element_);
    unsigned char raw[8];
    std::memcpy(raw, bytes_.data() + at_, size);
    at_ += size;
    if (header_.big_endian) std::reverse(raw, raw + size);
    return valueOf(raw, type);
  }
  /// `count` of an element are to come, each of at least `bytes` bytes.
  void expect(const Element& element) {
    element_ = element.name;
    uint64_t least = 0;
    for (const Property& property : element.properties)
      least += header_.ascii ? 2 : bytesOf(property.counted_by.value_or(property.type));
    const uint64_t left = header_.ascii ? text_.left() + 1 : bytes_.size() - at_;
    if (least == 0 || element.count > left / least)
      throw Error("{}: is truncated: {} {} need {} bytes or more (found {})", path_.string(), element.count,
                  element.name.substr(0, 32), element.count * std::max<uint64_t>(least, 1), left);
  }
  uint64_t left() const { return header_.ascii ? text_.left() : bytes_.size() - at_; }

 private:
  static double valueOf(const unsigned char* raw, Type type) {
    const auto as = [&](auto value) {
      std::memcpy(&value, raw, sizeof value);
      return static_cast<double>(value);
    };
    switch (type) {
      case Type::kInt8:
        return as(int8_t{});
      case Type::kUint8:
        return as(uint8_t{});
      case Type::kInt16:
        return as(int16_t{});
      case Type::kUint16:
        return as(uint16_t{});
      case Type::kInt32:
        return as(int32_t{});
      case Type::kUint32:
        return as(uint32_t{});
      case Type::kFloat:
        return as(float{});
      default:
        return as(double{});
    }
  }

  const std::string_view bytes_;
  MeshText text_;
  const Header& header_;
  const std::filesystem::path& path_;
  size_t at_ = 0;
  std::string element_;
};

void readVertices(const Element& element, Values& values, const std::filesystem::path& path, RawMesh& mesh) {
  int places[3] = {-1, -1, -1};
  for (size_t n = 0; n < element.properties.size(); ++n)
    for (int axis = 0; axis < 3; ++axis)
      if (element.properties[n].name == std::string_view("xyz").substr(static_cast<size_t>(axis), 1))
        places[axis] = static_cast<int>(n);
  for (int axis = 0; axis < 3; ++axis)
    if (places[axis] < 0) throw Error("{}: its vertices have no {}", path.string(), "xyz"[axis]);
  mesh.positions.reserve(element.count);
  for (uint64_t v = 0; v < element.count; ++v) {
    glm::dvec3 position(0.0);
    for (size_t n = 0; n < element.properties.size(); ++n) {
      const Property& property = element.properties[n];
      if (property.counted_by)
        throw Error("{}: its vertices have the list property '{}', which is not supported", path.string(),
                    property.name);
      const double value = values.next(property.type);
      for (int axis = 0; axis < 3; ++axis)
        if (places[axis] == static_cast<int>(n)) position[axis] = value;
    }
    mesh.positions.push_back(position);
  }
}

/// The elements of a list. Each takes a byte at least.
void readList(const Property& property, Values& values, const std::filesystem::path& path,
              std::vector<double>& list) {
  const double count = values.next(*property.counted_by);
  if (!(count >= 0 && count <= static_cast<double>(values.left())))
    throw Error("{}: is truncated: a list of {} elements goes beyond its end", path.string(), count);
  list.resize(static_cast<size_t>(count));
  for (double& value : list) value = values.next(property.type);
}

void readFaces(const Element& element, Values& values, const std::filesystem::path& path, RawMesh& mesh) {
  std::vector<double> list;
  for (uint64_t face = 0; face < element.count; ++face)
    for (const Property& property : element.properties) {
      if (!property.counted_by) {
        values.next(property.type);
        continue;
      }
      readList(property, values, path, list);
      if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
      for (const double corner : list)
        if (!(corner >= 0 && corner < static_cast<double>(mesh.positions.size())))
          throw Error("{}: face {} refers to vertex {}, but there are {}", path.string(), face, corner,
                      mesh.positions.size());
      addPolygon(mesh, list);
    }
}

}  // namespace

RawMesh parsePly(std::string_view bytes, const std::filesystem::path& path) {
  const Header header = parseHeader(bytes, path);
  Values values(bytes.substr(header.size), header, path);
  RawMesh mesh;
  std::vector<double> list;
  for (const Element& element : header.elements) {
    if (element.count == 0) continue;
    values.expect(element);
    if (element.name == "vertex") {
      readVertices(element, values, path, mesh);
    } else if (element.name == "face") {
      readFaces(element, values, path, mesh);
    } else {
      for (uint64_t n = 0; n < element.count; ++n)
        for (const Property& property : element.properties) {
          if (property.counted_by)
            readList(property, values, path, list);
          else
            values.next(property.type);
        }
    }
  }
  return mesh;
}

}  // namespace curvisplat
