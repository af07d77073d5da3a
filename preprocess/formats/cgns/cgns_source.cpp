#include "preprocess/formats/cgns/cgns_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "preprocess/formats/cgns/adf_trial.h"
#include "preprocess/formats/cgns/cgns_mesh_source.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

// A vector is read in groups of rows of about this many nodes.
constexpr uint64_t kRowsOfNodes = 1 << 16;

/// The part of `box` that has samples of the given centring, as a box of the array, with its destination.
CgnsBox boxOf(const CgnsZone& zone, const NodeBox& box, const CgnsArray& array, Centring centring) {
  const uint64_t last = centring == Centring::kCell ? 1 : 0;
  const uint64_t j1 = std::min(box.j1, zone.nodes[1] - last), k1 = std::min(box.k1, zone.nodes[2] - last);
  CgnsBox part;
  const uint64_t i1 = std::min(box.i1, zone.nodes[0] - last);
  part.first = {array.rind[0] + box.i0, array.rind[1] + box.j0, array.rind[2] + box.k0};
  part.count = {i1 - std::min(box.i0, i1), j1 - std::min(box.j0, j1), k1 - std::min(box.k0, k1)};
  part.memory = {box.rowNodes(zone.nodes[0]), box.j1 - box.j0};
  return part;
}

bool empty(const CgnsBox& box) {
  return box.count[0] == 0 || box.count[1] == 0 || box.count[2] == 0;
}

}  // namespace

CgnsSource::CgnsSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step)
    : file_(std::move(file)), tree_(std::move(tree)) {
  describeCgns(*file_, tree_, time_step, description_);
  for (const CgnsZone& zone : tree_.zones) {
    const std::string name = tree_.bases > 1 ? zone.base + "/" + zone.name : zone.name;
    for (GridBoundary boundary : zone.boundaries) {
      boundary.block = static_cast<uint32_t>(description_.blocks.size());
      description_.boundaries.push_back(std::move(boundary));
    }
    description_.blocks.push_back({name, zone.nodes[0], zone.nodes[1], zone.nodes[2], !zone.holes.empty()});
    if (!zone.holes.empty()) description_.blanking = "in overset holes of the zones";
  }
  arrays_ = describeCgnsScalars(tree_, description_);
}

void CgnsSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, <, tree_.zones.size());
  const CgnsZone& zone = tree_.zones[block];
  const size_t nodes = box.rowNodes(zone.nodes[0]) * (box.j1 - box.j0) * (box.k1 - box.k0);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(nodes);
    const CgnsArray& array = zone.coordinates[axis];
    const CgnsBox part = boxOf(zone, box, array, Centring::kNode);
    if (!empty(part)) file_->read(array.node, array.shape, part, axes[axis]->data());
  }
  out.blank.assign(nodes, 0);
  if (!zone.holes.empty()) zone.holes.blankNodes(zone.nodes, box, out.blank);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, arrays_.size());
    out.scalars[n].assign(nodes, std::numeric_limits<float>::quiet_NaN());
    readScalar(zone, box, arrays_[scalars[n]][block], description_.scalars[scalars[n]].centring,
               out.scalars[n]);
    if (description_.scalars[scalars[n]].centring == Centring::kCell)
      zone.holes.blankCells(zone.nodes, box, out.scalars[n]);
  }
}

void CgnsSource::readScalar(const CgnsZone& zone, const NodeBox& box, const CgnsArrays& arrays,
                            Centring centring, std::vector<float>& to) const {
  if (arrays.empty()) return;
  const CgnsBox part = boxOf(zone, box, *arrays[0], centring);
  if (empty(part)) return;
  if (arrays.size() == 1) return file_->read(arrays[0]->node, arrays[0]->shape, part, to.data());
  // A few rows at a time, so that the buffers of the components stay small.
  const uint64_t ni = part.memory[0];
  const uint64_t rows = std::clamp<uint64_t>(kRowsOfNodes / ni, 1, part.count[1]);
  std::vector<double> squares;
  std::vector<float> component;
  for (uint64_t k = 0; k < part.count[2]; ++k)
    for (uint64_t j = 0; j < part.count[1]; j += rows) {
      const uint64_t count = std::min(rows, part.count[1] - j);
      squares.assign(ni * count, 0.0);
      component.assign(ni * count, std::numeric_limits<float>::quiet_NaN());
      for (const CgnsArray* array : arrays) {
        CgnsBox piece = boxOf(zone, box, *array, centring);
        piece.first = {piece.first[0], piece.first[1] + j, piece.first[2] + k};
        piece.count = {piece.count[0], count, 1};
        piece.memory = {ni, count};
        file_->read(array->node, array->shape, piece, component.data());
        for (size_t n = 0; n < component.size(); ++n) squares[n] += double{component[n]} * component[n];
      }
      float* const first = to.data() + ni * (j + part.memory[1] * k);
      std::transform(squares.begin(), squares.end(), first,
                     [](double square) { return static_cast<float>(std::sqrt(square)); });
    }
}

std::unique_ptr<DataSource> openCgns(const OpenGridOptions& options) {
  tryAdf(options.grid);
  auto file = std::make_shared<const CgnsFile>(options.grid);
  const uint32_t step = options.time_step.value_or(0);
  CgnsTree tree = readCgnsTree(*file, step);
  if (tree.unstructured)
    return std::make_unique<CgnsMeshSource>(std::move(file), std::move(tree), step, options.temporary_folder);
  return std::make_unique<CgnsSource>(std::move(file), std::move(tree), step);
}

}  // namespace curvisplat
