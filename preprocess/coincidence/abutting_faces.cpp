#include "preprocess/coincidence/abutting_faces.h"

#include <tbb/task_arena.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "preprocess/coincidence/coincidence_sweep.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/error.h"
#include "stream/base/mutex.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

std::array<uint64_t, 3> cellsOf(const GridBlock& block) {
  const auto along = [](uint64_t nodes) { return std::max<uint64_t>(nodes, 1) - 1; };
  return {along(block.ni), along(block.nj), along(block.nk)};
}

/// The axes along a side.
constexpr std::array<std::array<size_t, 2>, 3> kAlong{{{1, 2}, {0, 2}, {0, 1}}};

uint64_t facesOfSide(const std::array<uint64_t, 3>& cells, size_t axis) {
  return cells[kAlong[axis][0]] * cells[kAlong[axis][1]];
}

// A centre's record in the sorter: along, across, the face's number, three coordinates, spacing.
constexpr size_t kCentreSize = 7;

SweptNode sweptCentre(const double* record) {
  return {{RecordSorter::alongOf(record), RecordSorter::acrossOf(record)},
          {record[3], record[4], record[5]},
          record[6]};
}

/// The mean of the corners whose bits under `mask` are those of `bits`.
template <size_t mask, size_t bits>
glm::dvec3 middle(const std::array<glm::dvec3, 8>& corners) {
  constexpr double kCount = 8 >> std::popcount(mask);
  glm::dvec3 sum(0.0);
  for (size_t n = 0; n < 8; ++n)
    if (((n ^ bits) & mask) == 0) sum += corners[n];
  return sum / kCount;
}

/// The centre of the face whose corners' bits under `bit` are `side`, and along each axis how far apart the
/// middles of the face's opposite edges are, or, across the face, the centres of the cell's two ends.
/// Templates, so that the sums are unrolled.
template <size_t bit, size_t side>
void measureFace(const std::array<glm::dvec3, 8>& corners, glm::dvec3& centre,
                 std::array<double, 3>& widths) {
  centre = middle<bit, side>(corners);
  const auto width = [&]<size_t other>() {
    return glm::distance(middle<bit | other, side>(corners), middle<bit | other, side ^ other>(corners));
  };
  widths = {width.template operator()<1>(), width.template operator()<2>(), width.template operator()<4>()};
}

}  // namespace

AbuttingFaces::Needs AbuttingFaces::needsOf(std::span<const GridBlock> blocks) {
  uint64_t faces = 0;
  for (const GridBlock& block : blocks)
    for (const size_t axis : {0u, 1u, 2u}) faces += 2 * facesOfSide(cellsOf(block), axis);
  return {faces / 8, faces * kCentreSize * sizeof(double)};
}

AbuttingFaces::AbuttingFaces(std::span<const GridBlock> blocks, int coordinate_bytes, uint64_t memory_bytes,
                             std::filesystem::path temporary_folder)
    : coordinate_bytes_(coordinate_bytes), centres_(kCentreSize, memory_bytes, std::move(temporary_folder)) {
  uint64_t faces = 0;
  for (const GridBlock& block : blocks) {
    Block& added = blocks_.emplace_back(Block{cellsOf(block), {}});
    for (const size_t axis : {0u, 1u, 2u}) {
      added.first_face[axis] = faces;
      const uint64_t of_side = facesOfSide(added.cells, axis);
      sides_.insert(sides_.end(), {faces, faces + of_side});
      faces += 2 * of_side;
    }
  }
  abutting_.resize(faces);
}

bool AbuttingFaces::isAtEnd(const CellFace& face) const {
  const auto axis = static_cast<size_t>(face.axis);
  return face.cell[axis] == (face.upper ? blocks_[face.block].cells[axis] - 1 : 0);
}

uint64_t AbuttingFaces::numberOf(const CellFace& face) const {
  const auto& [cells, first_face] = blocks_[face.block];
  const auto axis = static_cast<size_t>(face.axis);
  const auto [a, b] = kAlong[axis];
  return first_face[axis] + (face.upper ? facesOfSide(cells, axis) : 0) + face.cell[b] * cells[a] +
         face.cell[a];
}

AbuttingFaces::Centre AbuttingFaces::centreOf(const CellFace& face,
                                              const std::array<glm::dvec3, 8>& corners) const {
  CURVISPLAT_CHECK(isAtEnd(face));
  Centre centre;
  centre.face = numberOf(face);
  std::array<double, 3> widths{};
  constexpr decltype(&measureFace<1, 0>) kMeasureSide[] = {measureFace<1, 0>, measureFace<1, 1>,
                                                           measureFace<2, 0>, measureFace<2, 2>,
                                                           measureFace<4, 0>, measureFace<4, 4>};
  kMeasureSide[2 * face.axis + face.upper](corners, centre.at, widths);
  const double rounding = coordinateRounding(centre.at, coordinate_bytes_);
  // It is as far to the centre of another face as across this one, or through the cell.
  centre.spacing = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double width = widths[static_cast<size_t>(axis)];
    if (axis != face.axis && !(width > rounding)) centre.collapsed = true;
    if (width > 0) centre.spacing = std::min(centre.spacing, width);
  }
  if (!std::isfinite(centre.spacing)) centre.spacing = 0;
  return centre;
}

void AbuttingFaces::add(std::span<const Centre> centres) {
  std::vector<double> records;
  records.reserve(centres.size() * kCentreSize);
  for (const Centre& centre : centres) {
    if (centre.collapsed) {
      abutting_[centre.face] = true;
      continue;
    }
    reach_.add(centre.at, centre.spacing);
    const auto [along, across] = seamPosition(centre.at);
    std::array<double, kCentreSize> record{0, 0, 0, centre.at.x, centre.at.y, centre.at.z, centre.spacing};
    RecordSorter::setKey(record.data(), along, across, centre.face);
    records.insert(records.end(), record.begin(), record.end());
  }
  centres_.add(records);
}

void AbuttingFaces::match(const Progress& progress) {
  constexpr unsigned kRangesOfThread = 4;  // they do not take equally long
  const auto threads = static_cast<unsigned>(tbb::this_task_arena::max_concurrency());
  centres_.sort(threads);
  const std::vector<SweepRange> ranges =
      coincidenceRanges(centres_, threads * kRangesOfThread, sweptCentre, reach_, coordinate_bytes_);
  Mutex noting;
  parallelFor(size_t{0}, ranges.size(), [&](size_t n) {
    const TraceScope trace("match faces");
    std::vector<std::vector<uint64_t>> sets;
    CoincidenceSweep sweep(coordinate_bytes_, [&](size_t set) {
      if (sets[set].size() > 1) {
        progress.throwIfStopped();
        const MutexLock lock(noting);
        noteSet(sets[set]);
      }
      sets[set].clear();
    });
    centres_.visit(ranges[n].from, ranges[n].to, [&](const double* record) {
      const size_t set = sweep.add(sweptCentre(record));
      if (set == sets.size()) sets.emplace_back();
      sets[set].push_back(RecordSorter::numberOf(record));
      return true;
    });
    sweep.finish();
  });
  centres_.forget();
}

void AbuttingFaces::noteSet(std::span<const uint64_t> faces) {
  for (const uint64_t face : faces) abutting_[face] = true;
  if (folded_.empty()) return;
  // Thousands of faces coincide where a set names one file thousands of times: not each with each.
  std::vector<std::pair<ptrdiff_t, uint64_t>> by_side;
  by_side.reserve(faces.size());
  for (const uint64_t face : faces)
    by_side.emplace_back(std::upper_bound(sides_.begin(), sides_.end(), face) - sides_.begin(), face);
  std::sort(by_side.begin(), by_side.end());
  for (size_t n = 1; n < by_side.size(); ++n)
    if (by_side[n].first == by_side[n - 1].first)
      folded_[by_side[n].second] = folded_[by_side[n - 1].second] = true;
}

}  // namespace curvisplat
