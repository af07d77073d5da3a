#include "preprocess/formats/common/element_source.h"

#include <limits>

namespace curvisplat {

void ElementSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                               std::span<const uint32_t> scalars, MeshPoints& out) const {
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(count);
  readPlaces(piece, first, count, {{out.x.data(), out.y.data(), out.z.data()}});
  out.hidden.assign(count, 0);
  readAll(piece, first, count, scalars, out.scalars);
}

void ElementSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                              std::span<const uint32_t> scalars, MeshCells& out) const {
  out.clear();
  appendCells(piece, first, count, out);
  readAll(piece, first, count, scalars, out.scalars);
}

void ElementSource::readAll(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                            std::vector<std::vector<float>>& out) const {
  out.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    out[n].assign(count, std::numeric_limits<float>::quiet_NaN());
    readValues(piece, scalars[n], first, out[n]);
  }
}

}  // namespace curvisplat
