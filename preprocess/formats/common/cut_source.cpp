#include "preprocess/formats/common/cut_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/mesh/curved_cells.h"
#include "preprocess/mesh/curved_volumes.h"
#include "preprocess/mesh/forwarding_mesh.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Cells that are read together when the file is opened: as many as have some ten thousand nodes.
constexpr uint64_t kFewCells = 256, kManyCells = 16384;
constexpr size_t kManyNodes = size_t{1} << 16;

/// The positions of the nodes of curved cells that were read together.
class NodePlaces {
 public:
  NodePlaces(const MeshSource& source, uint32_t piece, const MeshCells& cells, bool wanted) {
    if (!wanted) return;
    for (const auto& [cell, curve] : cells.curved) {
      const std::span<const uint64_t> nodes = cells.cornersOfCell(cell);
      if (curve.order > 0) numbers_.insert(numbers_.end(), nodes.begin(), nodes.end());
    }
    std::sort(numbers_.begin(), numbers_.end());
    numbers_.erase(std::unique(numbers_.begin(), numbers_.end()), numbers_.end());
    MeshPoints points;
    for (size_t from = 0; from < numbers_.size();) {
      size_t to = from + 1;
      while (to < numbers_.size() && numbers_[to] - numbers_[to - 1] < kMaxGap &&
             numbers_[to] - numbers_[from] < kMaxRun)
        ++to;
      const uint64_t first = numbers_[from];
      source.readPoints(piece, first, numbers_[to - 1] - first + 1, {}, points);
      for (; from < to; ++from) {
        const size_t n = numbers_[from] - first;
        places_.emplace_back(points.x[n], points.y[n], points.z[n]);
      }
    }
  }

  std::vector<glm::dvec3> of(std::span<const uint64_t> nodes) const {
    std::vector<glm::dvec3> places;
    for (const uint64_t node : nodes)
      places.push_back(places_[static_cast<size_t>(std::lower_bound(numbers_.begin(), numbers_.end(), node) -
                                                   numbers_.begin())]);
    return places;
  }

 private:
  static constexpr uint64_t kMaxGap = 512, kMaxRun = 65536;

  std::vector<uint64_t> numbers_;  // sorted
  std::vector<glm::dvec3> places_;
};

class CutSource final : public ForwardingMesh {
 public:
  CutSource(std::unique_ptr<MeshSource> whole, bool cut, const std::filesystem::path& temporary_folder)
      : ForwardingMesh(std::move(whole)), cut_(cut) {
    Counts counts;
    const auto of_begins = std::make_shared<SpoolFile>(temporary_folder),
               of_volumes = std::make_shared<SpoolFile>(temporary_folder);
    for (uint32_t piece = 0; piece < description_.pieces.size(); ++piece) {
      NumberSpool<uint64_t> begins(of_begins);
      NumberSpool<double> volumes(of_volumes);
      description_.pieces[piece].cells = measureParts(piece, begins, volumes, counts);
      begins_.push_back(begins.finish());
      volumes_.push_back(volumes.finish());
    }
    if (counts.cut > 0)
      description_.notes.push_back(
          fmt::format("{} of {} solid cells are of higher order; they are cut into {} linear ones",
                      counts.cut, counts.solid, counts.parts));
    if (counts.corners > 0)
      description_.warnings.push_back(fmt::format(
          "{} of {} solid cells are quadratic or of higher order; they are drawn by their corners",
          counts.corners, counts.solid));
  }

  bool hasCurvedCells() const override { return false; }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  struct Counts {
    uint64_t solid = 0, cut = 0, parts = 0, corners = 0;
  };

  /// Null: the cell stays whole.
  const CellParts* partsOfCell(CellKind shape, CellCurve curve) const {
    return cut_ && curve.order > 0 ? &partsOf(shape, curve) : nullptr;
  }

  uint64_t measureParts(uint32_t piece, NumberSpool<uint64_t>& begins, NumberSpool<double>& volumes,
                        Counts& counts) const {
    const uint64_t all = source().description().pieces[piece].cells;
    uint64_t parts = 0, at_once = kFewCells;
    MeshCells cells;
    std::vector<double> of_parts;
    for (uint64_t first = 0; first < all;) {
      const uint64_t count = std::min(at_once, all - first);
      source().readCells(piece, first, count, {}, cells);
      checkCells(cells, source().description().pieces[piece], first);
      const NodePlaces places(source(), piece, cells, cut_);
      auto curved = cells.curved.begin();
      for (size_t n = 0; n < count; ++n) {
        begins.add(parts);
        counts.solid += cells.shapes[n] != CellKind::kNone;
        const bool is_curved = curved != cells.curved.end() && curved->first == n;
        const CellParts* const of_cell = is_curved ? partsOfCell(cells.shapes[n], curved->second) : nullptr;
        of_parts.assign(of_cell ? of_cell->size() : 1, 0.0);
        if (of_cell)
          if (const CurvedVolumes* const rule = volumesOf(cells.shapes[n], curved->second))
            rule->measure(places.of(cells.cornersOfCell(n)), of_parts);
        for (const double volume : of_parts) volumes.add(volume);
        if (is_curved) ++curved;
        parts += of_cell ? of_cell->size() : 1;
        if (is_curved) ++(of_cell ? counts.cut : counts.corners);
        if (of_cell) counts.parts += of_cell->size();
      }
      at_once = cells.corners.size() < kManyNodes ? std::min(2 * at_once, kManyCells) : kFewCells;
      first += count;
    }
    begins.add(parts);
    return parts;
  }

  /// The cell that has this part.
  uint64_t cellOf(uint32_t piece, uint64_t part) const {
    uint64_t low = 0, high = begins_[piece].count - 1;  // begins[low] <= part < begins[high]
    while (high - low > 1) {
      const uint64_t middle = low + (high - low) / 2;
      uint64_t begin = 0;
      begins_[piece].read(middle, std::span(&begin, 1));
      (begin <= part ? low : high) = middle;
    }
    return low;
  }

  std::vector<SpooledNumbers> begins_;   // [piece]: of each cell among the parts, and the end of the last
  std::vector<SpooledNumbers> volumes_;  // [piece]: of each part; 0: that of the flat cell
  const bool cut_;
};

void CutSource::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshCells& out) const {
  out.clear();
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.clear();
  if (count == 0) return;
  const uint64_t cell = cellOf(piece, first), end = cellOf(piece, first + count - 1) + 1;
  std::vector<uint64_t> begins(end - cell + 1);
  begins_[piece].read(cell, std::span(begins));
  MeshCells whole;
  source().readCells(piece, cell, end - cell, scalars, whole);
  std::vector<double> volumes(count);
  volumes_[piece].read(first, std::span(volumes));
  out.volumes.assign(volumes.begin(), volumes.end());
  auto curved = whole.curved.begin();
  for (size_t n = 0; n < whole.size(); ++n) {
    const uint64_t from = std::max(first, begins[n]) - begins[n],
                   to = std::min(first + count, begins[n + 1]) - begins[n];
    const std::span<const uint64_t> nodes = whole.cornersOfCell(n);
    const bool is_curved = curved != whole.curved.end() && curved->first == n;
    const CellParts* const parts = is_curved ? partsOfCell(whole.shapes[n], curved->second) : nullptr;
    if (is_curved) ++curved;
    if ((parts ? parts->size() : 1) != begins[n + 1] - begins[n])
      throw Error("{}: cell {} is another one than before; the file has been replaced",
                  description_.pieces[piece].file, cell + n);
    for (uint64_t part = from; part < to; ++part) {
      if (parts)
        parts->append(part, nodes, out);
      else
        out.appendOf(whole, n);
      out.hidden.back() = whole.hidden[n];
      for (size_t scalar = 0; scalar < scalars.size(); ++scalar)
        out.scalars[scalar].push_back(whole.scalars[scalar][n]);
    }
  }
}

}  // namespace

std::unique_ptr<DataSource> cutCurved(std::unique_ptr<DataSource> source, bool cut,
                                      const std::filesystem::path& temporary_folder) {
  auto* const mesh = dynamic_cast<MeshSource*>(source.get());
  if (!mesh || !mesh->hasCurvedCells()) return source;
  source.release();
  return std::make_unique<CutSource>(std::unique_ptr<MeshSource>(mesh), cut, temporary_folder);
}

}  // namespace curvisplat
