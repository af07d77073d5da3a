#include "render/mesh/mesh_file.h"

#include <limits>
#include <string>

#include "render/mesh/mesh_formats.h"
#include "stream/base/file.h"
#include "stream/base/paths.h"

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

}  // namespace curvisplat
