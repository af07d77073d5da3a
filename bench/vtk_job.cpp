#include "bench/vtk_job.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "stream/base/file.h"

namespace curvisplat {
namespace {

// Corners, u fastest. Neighbouring cells take different halves, so that their faces are cut alike.
constexpr int kEven[5][4] = {{0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}, {1, 2, 4, 7}};
constexpr int kOdd[5][4] = {{1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}, {0, 3, 5, 6}};

/// Legacy VTK files are big-endian.
template <typename Word, typename Value>
void append(std::string& out, Value value) {
  const auto word = std::bit_cast<Word>(value);
  for (int shift = 8 * static_cast<int>(sizeof(Word)) - 8; shift >= 0; shift -= 8)
    out.push_back(static_cast<char>(word >> shift & 255));
}

}  // namespace

void writeTetrahedra(const GridField& field, const std::filesystem::path& path) {
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::string points, values, cells;
  uint32_t point_count = 0, cell_count = 0;
  for (uint32_t number = 0; number < field.blocks().size(); ++number) {
    const GridField::Block& block = field.blocks()[number];
    std::vector<uint32_t> index(block.nodes.x.size(), kUnused);
    const auto indexOf = [&](size_t n) {
      if (index[n] == kUnused) {
        index[n] = point_count++;
        for (const double x : {block.nodes.x[n], block.nodes.y[n], block.nodes.z[n]})
          append<uint64_t>(points, x);
        append<uint32_t>(values, field.ofCells() ? 0.0f : block.nodes.scalars[0][n]);
      }
      return index[n];
    };
    for (uint64_t k = 0; k + 1 < block.nk; ++k)
      for (uint64_t j = 0; j + 1 < block.nj; ++j)
        for (uint64_t i = 0; i + 1 < block.ni; ++i) {
          const GridField::CellAddress cell{number, {i, j, k}};
          if (!field.isThere(cell)) continue;
          const std::array<size_t, 8> corners = field.cornersOf(cell);
          for (const auto& tetrahedron : (i + j + k) % 2 ? kOdd : kEven) {
            glm::dvec3 p[4];
            for (int n = 0; n < 4; ++n) {
              const size_t node = corners[tetrahedron[n]];
              p[n] = {block.nodes.x[node], block.nodes.y[node], block.nodes.z[node]};
            }
            if (glm::dot(p[1] - p[0], glm::cross(p[2] - p[0], p[3] - p[0])) == 0) continue;
            append<uint32_t>(cells, uint32_t{4});
            for (const int corner : tetrahedron) append<uint32_t>(cells, indexOf(corners[corner]));
            ++cell_count;
          }
        }
  }
  std::string text = fmt::format(
      "# vtk DataFile Version 3.0\ntetrahedra\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
      point_count);
  text += points + fmt::format("\nCELLS {} {}\n", cell_count, 5 * uint64_t{cell_count}) + cells +
          fmt::format("\nCELL_TYPES {}\n", cell_count);
  for (uint32_t n = 0; n < cell_count; ++n) append<uint32_t>(text, uint32_t{10});
  text +=
      fmt::format("\nPOINT_DATA {}\nSCALARS scalar float 1\nLOOKUP_TABLE default\n", point_count) + values;
  writeFileAtomically(path, text + "\n");
}

nlohmann::json asJson(const Camera& camera) {
  const auto vector = [](const glm::dvec3& v) { return nlohmann::json{v.x, v.y, v.z}; };
  return {{"position", vector(camera.position)},
          {"focal_point", vector(camera.focal_point)},
          {"view_up", vector(camera.view_up)},
          {"parallel_scale", camera.parallel_scale}};
}

}  // namespace curvisplat
