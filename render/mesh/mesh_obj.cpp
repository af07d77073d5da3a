#include <vector>

#include "render/mesh/mesh_formats.h"

namespace curvisplat {

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
