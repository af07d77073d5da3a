#include "preprocess/formats/cgns/cgns_mesh_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Samples [first, first + count) of a list, without those of the rind.
template <typename Value>
void readRange(const CgnsFile& file, const CgnsArray& array, uint64_t first, std::vector<Value>& to) {
  if (to.empty()) return;
  const uint64_t count = to.size();
  file.read(array.node, array.shape, {{array.rind[0] + first, 0, 0}, {count, 1, 1}, {count, 1}}, to.data());
}

}  // namespace

CgnsMeshSource::CgnsMeshSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step,
                               const std::filesystem::path& folder)
    : file_(std::move(file)), tree_(std::move(tree)) {
  cells_.reserve(tree_.zones.size());  // cells hold pointers to their own sections
  for (const CgnsZone& zone : tree_.zones) cells_.emplace_back(*file_, zone, folder);
  for (size_t n = 0; n < tree_.zones.size(); ++n) dropFieldsOfCells(n);
  describeCgns(*file_, tree_, time_step, description_);
  for (size_t n = 0; n < tree_.zones.size(); ++n)
    description_.pieces.push_back(
        {cgnsZoneName(tree_, n), file_->path().string(), tree_.zones[n].nodes[0], cells_[n].cells()});
  warnOfKinds();
  arrays_ = describeCgnsScalars(tree_, description_);
}

/// Where the zone's fields do not have a value for each of its cells.
void CgnsMeshSource::dropFieldsOfCells(size_t zone_number) {
  CgnsZone& zone = tree_.zones[zone_number];
  const uint64_t cells = cells_[zone_number].cells();
  if (cells == zone.cells) return;
  const size_t dropped =
      std::erase_if(zone.fields, [](const CgnsField& field) { return field.centring == Centring::kCell; });
  if (dropped > 0)
    tree_.warnings.push_back(
        fmt::format("the {} cell-centred fields of {}/{} are left out: they have {} values, but its sections "
                    "have {} elements that may be solid",
                    dropped, zone.base, zone.name, zone.cells, cells));
}

void CgnsMeshSource::warnOfKinds() {
  CgnsCells::Counts all;
  for (const CgnsCells& cells : cells_) {
    all.solid += cells.counts().solid;
    all.curved += cells.counts().curved;
    all.others += cells.counts().others;
  }
  if (all.solid == 0)
    throw Error(
        "{}: its unstructured zones have no solid element; expected TETRA, PYRA, PENTA, HEXA or NFACE",
        file_->path().string());
  if (all.curved > 0)
    description_.warnings.push_back(
        fmt::format("{} of {} solid elements are of higher order; they are drawn by their corners",
                    all.curved, all.solid));
  if (all.others > 0)
    description_.warnings.push_back(
        fmt::format("{} elements are nodes, lines or faces and are left out", all.others));
}

void CgnsMeshSource::readScalars(uint32_t piece, uint64_t first, uint64_t count,
                                 std::span<const uint32_t> scalars,
                                 std::vector<std::vector<float>>& out) const {
  out.resize(scalars.size());
  std::vector<float> component(count);
  for (size_t n = 0; n < scalars.size(); ++n) {
    const CgnsArrays& arrays = arrays_.at(scalars[n])[piece];
    out[n].assign(count, arrays.empty() ? std::numeric_limits<float>::quiet_NaN() : 0.0f);
    if (arrays.size() == 1) readRange(*file_, *arrays[0], first, out[n]);
    if (arrays.size() < 2) continue;
    std::vector<double> squares(count, 0.0);
    for (const CgnsArray* const array : arrays) {
      readRange(*file_, *array, first, component);
      for (size_t m = 0; m < count; ++m) squares[m] += double{component[m]} * component[m];
    }
    for (size_t m = 0; m < count; ++m) out[n][m] = static_cast<float>(std::sqrt(squares[m]));
  }
}

void CgnsMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                std::span<const uint32_t> scalars, MeshPoints& out) const {
  const CgnsZone& zone = tree_.zones.at(piece);
  const std::array<std::vector<double>*, 3> axes{&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(count);
    readRange(*file_, zone.coordinates[axis], first, *axes[axis]);
  }
  out.hidden.assign(count, 0);
  readScalars(piece, first, count, scalars, out.scalars);
}

void CgnsMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                               std::span<const uint32_t> scalars, MeshCells& out) const {
  cells_.at(piece).read(first, count, out);
  readScalars(piece, first, count, scalars, out.scalars);
}

}  // namespace curvisplat
