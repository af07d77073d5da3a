// Reads surfaces from files, and the formats that are a loop over records or lines: STL and OBJ.
// mesh_ply.cpp has PLY.
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "render/mesh/mesh_formats.h"
#include "render/mesh/triangle_mesh.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr const char* kFormats = "STL, PLY and OBJ files can be read";
// A vertex or a triangle takes at least two bytes of a file.
constexpr uint64_t kMaxBytes = uint64_t{1} << 36;

RawMesh parse(std::string_view bytes, const std::filesystem::path& path) {
  const std::string extension = extensionOf(path);
  if (bytes.empty()) throw Error("{}: is empty; {}", path.string(), kFormats);
  if (bytes.starts_with("ply\n") || bytes.starts_with("ply\r")) return parsePly(bytes, path);
  if (isBinaryStl(bytes)) return parseBinaryStl(bytes, path);
  if (bytes.starts_with("solid")) return parseAsciiStl(bytes, path);
  if (extension == ".stl") return parseBinaryStl(bytes, path);
  if (extension == ".obj") return parseObj(bytes, path);
  throw Error("{}: unknown surface format (extension '{}'); {}", path.string(), extension, kFormats);
}

}  // namespace

RawMesh parseMesh(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  RawMesh mesh = parse(text, path);
  if (mesh.positions.size() >= std::numeric_limits<uint32_t>::max() / 4 ||
      mesh.triangles.size() >= std::numeric_limits<uint32_t>::max() / 4)
    throw Error("{}: has {} triangles; at most 10^9 can be drawn", path.string(), mesh.triangles.size());
  if (mesh.triangles.empty()) throw Error("{}: has no triangles, so there is nothing to draw", path.string());
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t corner : triangle)
      if (corner >= mesh.positions.size())
        throw Error("{}: a face refers to vertex {}, but there are {}", path.string(), uint64_t{corner} + 1,
                    mesh.positions.size());
  constexpr double kLargest = 1e18;  // products of two lengths fit in a float
  for (size_t n = 0; n < mesh.positions.size(); ++n)
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(mesh.positions[n][axis]) <= kLargest))
        throw Error("{}: {} of vertex {} is {}; expected a finite number", path.string(), "xyz"[axis], n + 1,
                    mesh.positions[n][axis]);
  return mesh;
}

TriangleMesh readMeshFile(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > kMaxBytes)
    throw Error("{}: is too large for a surface ({} bytes, expected at most {})", path.string(), file.size(),
                kMaxBytes);
  std::vector<std::byte> bytes(file.size());
  file.readAt(0, std::span(bytes));
  RawMesh raw = parseMesh(bytes, path);
  bytes = {};
  return meshOf(std::move(raw));
}

namespace {

// Binary STL:
//   80 bytes of text | number of triangles u32 | each: normal, 3 corners (12 floats), u16
constexpr size_t kStlHeader = 84, kRecord = 50, kCorners = 12;

uint32_t countOf(std::string_view bytes) {
  uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  return count;
}

}  // namespace

// The text may begin with "solid" as well: the size decides.
bool isBinaryStl(std::string_view bytes) {
  return bytes.size() >= kStlHeader && bytes.size() == kStlHeader + kRecord * uint64_t{countOf(bytes)};
}

RawMesh parseBinaryStl(std::string_view bytes, const std::filesystem::path& path) {
  if (bytes.size() < kStlHeader)
    throw Error("{}: is truncated: a binary STL file has {} bytes before its triangles (found {})",
                path.string(), kStlHeader, bytes.size());
  const uint64_t expected = kStlHeader + kRecord * uint64_t{countOf(bytes)};
  if (bytes.size() < expected)
    throw Error("{}: is truncated: {} triangles take {} bytes (found {})", path.string(), countOf(bytes),
                expected, bytes.size());
  RawMesh mesh;
  const size_t count = countOf(bytes);
  mesh.positions.reserve(3 * count);
  mesh.triangles.reserve(count);
  for (size_t n = 0; n < count; ++n) {
    float corners[9];
    std::memcpy(corners, bytes.data() + kStlHeader + kRecord * n + kCorners, sizeof corners);
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

// v x y z, and f a b c ... with a, a/t, a//n or a/t/n; negative numbers count from the last vertex. All else
// (texture, groups, materials) does not matter for the surface.
RawMesh parseObj(std::string_view bytes, const std::filesystem::path& path) {
  MeshText text(bytes, path);
  RawMesh mesh;
  std::vector<int64_t> corners;
  bool more = true;
  for (; more; more = text.nextLine()) {
    const std::string_view word = text.wordOfLine();
    if (word == "v") {
      const double x = text.number(), y = text.number(), z = text.number();
      mesh.positions.emplace_back(x, y, z);
    } else if (word == "f") {
      corners.clear();
      for (std::string_view corner = text.wordOfLine(); !corner.empty(); corner = text.wordOfLine()) {
        int64_t number = 0;
        const auto [end, error] = std::from_chars(corner.data(), corner.data() + corner.size(), number);
        if (error != std::errc{} || (end != corner.data() + corner.size() && *end != '/'))
          throw Error("{}: line {}: '{}' is not a vertex of a face", path.string(), text.line(),
                      corner.substr(0, 32));
        const auto count = static_cast<int64_t>(mesh.positions.size());
        const int64_t at = number < 0 ? count + number : number - 1;
        if (at < 0 || at >= count)
          throw Error("{}: line {}: a face refers to vertex {}, but there are {}", path.string(), text.line(),
                      number, count);
        corners.push_back(at);
      }
      if (corners.size() < 3)
        throw Error("{}: line {}: a face has {} vertices (expected 3 or more)", path.string(), text.line(),
                    corners.size());
      addPolygon(mesh, corners);
    }
  }
  return mesh;
}

}  // namespace curvisplat
