#include "preprocess/formats/common/spooled_mesh.h"

#include <vector>

namespace curvisplat {

void SpooledMesh::readPoints(uint64_t first, uint64_t count, MeshPoints& out) const {
  std::vector<double> values(3 * count);
  positions.read(3 * first, std::span(values));
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(count);
  for (size_t n = 0; n < count; ++n) {
    out.x[n] = values[3 * n];
    out.y[n] = values[3 * n + 1];
    out.z[n] = values[3 * n + 2];
  }
  out.hidden.assign(count, 0);
}

void SpooledMesh::readCells(uint64_t first, uint64_t count, MeshCells& out) const {
  out.clear();
  std::vector<uint64_t> from(count + 1);
  begins.read(first, std::span(from));
  std::vector<uint64_t> of_cells(from.back() - from.front());
  words.read(from.front(), std::span(of_cells));
  for (size_t n = 0; n < count; ++n) {
    const auto cell = std::span<const uint64_t>(of_cells).subspan(from[n] - from[0], from[n + 1] - from[n]);
    const auto kind = static_cast<CellKind>(cell[0]);
    if (kind == CellKind::kPolyhedron)
      out.appendPolyhedron(cell[1], cell.subspan(2));
    else
      out.append(kind, cell.subspan(1));
  }
}

void SpooledMeshWriter::addPoint(double x, double y, double z) {
  for (const double value : {x, y, z}) positions_.add(value);
}

void SpooledMeshWriter::addCell(CellKind kind, std::span<const uint64_t> corners) {
  begins_.add(words_.size());
  words_.add(static_cast<uint64_t>(kind));
  for (const uint64_t corner : corners) words_.add(corner);
}

void SpooledMeshWriter::addPolyhedron(uint64_t faces, std::span<const uint64_t> stream) {
  begins_.add(words_.size());
  words_.add(static_cast<uint64_t>(CellKind::kPolyhedron));
  words_.add(faces);
  for (const uint64_t word : stream) words_.add(word);
}

SpooledMesh SpooledMeshWriter::finish() {
  begins_.add(words_.size());
  return {positions_.finish(), begins_.finish(), words_.finish()};
}

}  // namespace curvisplat
