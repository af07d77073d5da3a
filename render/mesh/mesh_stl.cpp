#include <cstring>

#include "render/mesh/mesh_formats.h"

namespace curvisplat {
namespace {

//   80 bytes of text | number of triangles u32 | each: normal, 3 corners (12 floats), u16
constexpr size_t kHeader = 84, kRecord = 50, kCorners = 12;

uint32_t countOf(std::string_view bytes) {
  uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  return count;
}

}  // namespace

// The text may begin with "solid" as well: the size decides.
bool isBinaryStl(std::string_view bytes) {
  return bytes.size() >= kHeader && bytes.size() == kHeader + kRecord * uint64_t{countOf(bytes)};
}

RawMesh parseBinaryStl(std::string_view bytes, const std::filesystem::path& path) {
  if (bytes.size() < kHeader)
    throw Error("{}: is truncated: a binary STL file has {} bytes before its triangles (found {})",
                path.string(), kHeader, bytes.size());
  const uint64_t expected = kHeader + kRecord * uint64_t{countOf(bytes)};
  if (bytes.size() < expected)
    throw Error("{}: is truncated: {} triangles take {} bytes (found {})", path.string(), countOf(bytes),
                expected, bytes.size());
  RawMesh mesh;
  const size_t count = countOf(bytes);
  mesh.positions.reserve(3 * count);
  mesh.triangles.reserve(count);
  for (size_t n = 0; n < count; ++n) {
    float corners[9];
    std::memcpy(corners, bytes.data() + kHeader + kRecord * n + kCorners, sizeof corners);
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (int corner = 0; corner < 3; ++corner)
      mesh.positions.emplace_back(corners[3 * corner], corners[3 * corner + 1], corners[3 * corner + 2]);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

RawMesh parseAsciiStl(std::string_view bytes, const std::filesystem::path& path) {
  MeshText text(bytes, path);
  text.nextLine();  // solid NAME
  RawMesh mesh;
  size_t corners = 0;
  bool ended = false;
  for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
    if (word == "vertex") {
      if (++corners > 3)
        throw Error("{}: line {}: a facet has more than 3 vertices; STL files have triangles", path.string(),
                    text.line());
      const double x = text.number(), y = text.number(), z = text.number();
      mesh.positions.emplace_back(x, y, z);
    } else if (word == "endfacet") {
      if (corners != 3)
        throw Error("{}: line {}: a facet has {} vertices (expected 3)", path.string(), text.line(), corners);
      corners = 0;
      const auto end = static_cast<uint32_t>(mesh.positions.size());
      mesh.triangles.push_back({end - 3, end - 2, end - 1});
    } else if (word == "facet") {
      text.word();  // normal
      for (int axis = 0; axis < 3; ++axis) text.word();
    } else if (word == "endsolid") {
      ended = true;
      text.nextLine();
    } else if (word == "solid") {
      ended = false;
      text.nextLine();
    } else if (word != "outer" && word != "loop" && word != "endloop") {
      throw Error("{}: line {} is not STL (found '{}'; expected facet, vertex or endsolid)", path.string(),
                  text.line(), word.substr(0, 32));
    }
  }
  if (corners != 0 || !ended)
    throw Error("{}: is truncated: it ends in line {} without endsolid", path.string(), text.line());
  return mesh;
}

}  // namespace curvisplat
