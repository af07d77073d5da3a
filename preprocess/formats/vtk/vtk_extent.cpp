#include "preprocess/formats/vtk/vtk_extent.h"

#include <fmt/format.h>

#include <algorithm>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// A box in a regular partition has six neighbours; more parts than this are not a sane partition.
constexpr size_t kMaxPartsOfAPiece = 64;

bool shareCells(const VtkExtent& a, const VtkExtent& b) {
  for (size_t axis = 0; axis < 3; ++axis)
    if (std::max(a.lower[axis], b.lower[axis]) >= std::min(a.upper[axis], b.upper[axis])) return false;
  return true;
}

/// Appends to `left` the cells of `part` outside `other`, which overlaps it: up to six boxes. Cuts along k
/// first, since whole planes are read together.
void subtract(VtkExtent part, const VtkExtent& other, std::vector<VtkExtent>& left) {
  for (const size_t axis : {2, 1, 0}) {
    if (part.lower[axis] < other.lower[axis]) {
      left.push_back(part);
      left.back().upper[axis] = part.lower[axis] = other.lower[axis];
    }
    if (part.upper[axis] > other.upper[axis]) {
      left.push_back(part);
      left.back().lower[axis] = part.upper[axis] = other.upper[axis];
    }
  }
}

}  // namespace

uint64_t VtkExtent::cells() const {
  uint64_t cells = 1;
  for (size_t axis = 0; axis < 3; ++axis) cells *= std::max<uint64_t>(1, nodesAlong(axis) - 1);
  return cells;
}

bool VtkExtent::isFlat() const {
  return nodesAlong(0) < 2 || nodesAlong(1) < 2 || nodesAlong(2) < 2;
}

std::string VtkExtent::describe() const {
  return fmt::format("{}x{}x{}", nodesAlong(0), nodesAlong(1), nodesAlong(2));
}

std::vector<std::vector<VtkExtent>> ownedParts(const std::vector<VtkExtent>& pieces) {
  std::vector<std::vector<VtkExtent>> owned;
  for (size_t n = 0; n < pieces.size(); ++n) {
    std::vector<VtkExtent> parts = {pieces[n]};
    for (size_t before = 0; before < n && !parts.empty(); ++before) {
      if (!shareCells(pieces[n], pieces[before])) continue;
      std::vector<VtkExtent> left;
      for (const VtkExtent& part : parts) {
        if (shareCells(part, pieces[before]))
          subtract(part, pieces[before], left);
        else
          left.push_back(part);
      }
      parts = std::move(left);
      if (parts.size() > kMaxPartsOfAPiece)
        throw Error(
            "piece {} of the grid overlaps the previous pieces in {} parts; expected pieces that abut or "
            "overlap by ghost levels",
            n + 1, parts.size());
    }
    owned.push_back(std::move(parts));
  }
  return owned;
}

}  // namespace curvisplat
