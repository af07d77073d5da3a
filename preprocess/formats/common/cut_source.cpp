#include "preprocess/formats/common/cut_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/mesh/cell_nodes.h"
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

/// The scalar with the weights of rational cells, as VTK names it.
std::optional<uint32_t> rationalWeights(const GridDescription& description) {
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    if (description.scalars[n].name == "RationalWeights" &&
        description.scalars[n].centring == Centring::kNode)
      return n;
  return std::nullopt;
}

class CutSource final : public ForwardingMesh {
 public:
  CutSource(std::unique_ptr<MeshSource> whole, bool cut, const std::filesystem::path& temporary_folder)
      : ForwardingMesh(std::move(whole)), cut_(cut), rational_(rationalWeights(description_)) {
    Counts counts;
    const auto of_begins = std::make_shared<SpoolFile>(temporary_folder),
               of_points = std::make_shared<SpoolFile>(temporary_folder),
               of_volumes = std::make_shared<SpoolFile>(temporary_folder);
    for (uint32_t piece = 0; piece < description_.pieces.size(); ++piece) {
      Spools spools{NumberSpool<uint64_t>(of_begins), NumberSpool<uint64_t>(of_points),
                    NumberSpool<double>(of_volumes)};
      measureParts(piece, spools, counts);
      begins_.push_back(spools.begins.finish());
      own_points_.push_back(spools.own_points.finish());
      volumes_.push_back(spools.volumes.finish());
    }
    if (counts.cut > 0)
      description_.notes.push_back(
          fmt::format("{} of {} solid cells are of higher order; they are cut into {} linear ones",
                      counts.cut, counts.solid, counts.parts));
    if (std::any_of(own_points_.begin(), own_points_.end(), [](const auto& of) { return of.count > 0; }))
      description_.notes.push_back("points on Bezier's cells take the place of their control points");
    if (counts.corners > 0)
      description_.warnings.push_back(fmt::format(
          "{} of {} solid cells are quadratic or of higher order; they are drawn by their corners",
          counts.corners, counts.solid));
  }

  bool hasCurvedCells() const override { return false; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
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

  struct Spools {
    NumberSpool<uint64_t> begins, own_points;
    NumberSpool<double> volumes;
  };

  void measureParts(uint32_t piece, Spools& spools, Counts& counts) {
    const MeshPiece& whole = source().description().pieces[piece];
    uint64_t parts = 0, own_points = 0, at_once = kFewCells;
    const MeshCells none;
    MeshCells cells;
    std::vector<double> of_parts;
    for (uint64_t first = 0; first < whole.cells;) {
      const uint64_t count = std::min(at_once, whole.cells - first);
      source().readCells(piece, first, count, {}, cells);
      checkCells(cells, whole, first);
      const CellNodes nodes(source(), piece, cut_ ? cells : none, {}, rational_);
      auto curved = cells.curved.begin();
      for (size_t n = 0; n < count; ++n) {
        spools.begins.add(parts);
        counts.solid += cells.shapes[n] != CellKind::kNone;
        const bool is_curved = curved != cells.curved.end() && curved->first == n;
        const CellParts* const of_cell = is_curved ? partsOfCell(cells.shapes[n], curved->second) : nullptr;
        of_parts.assign(of_cell ? of_cell->size() : 1, 0.0);
        if (own_points > 0) spools.own_points.add(own_points);
        if (of_cell) {
          const NodesOfCell of_nodes = nodes.of(cells.shapes[n], curved->second, cells.cornersOfCell(n));
          if (const CurvedVolumes* const rule =
                  volumesOf(cells.shapes[n], curved->second, !of_nodes.weights.empty()))
            rule->measure(of_nodes.places, of_nodes.weights, of_parts);
          if (curved->second.bezier) {
            while (spools.own_points.size() <= first + n) spools.own_points.add(0);
            own_points += of_nodes.places.size();
          }
        }
        for (const double volume : of_parts) spools.volumes.add(volume);
        if (is_curved) ++curved;
        parts += of_cell ? of_cell->size() : 1;
        if (is_curved) ++(of_cell ? counts.cut : counts.corners);
        if (of_cell) counts.parts += of_cell->size();
      }
      at_once = cells.corners.size() < kManyNodes ? std::min(2 * at_once, kManyCells) : kFewCells;
      first += count;
    }
    spools.begins.add(parts);
    if (own_points > 0) spools.own_points.add(own_points);
    description_.pieces[piece].cells = parts;
    description_.pieces[piece].points += own_points;
  }

  /// The cell that has the part, or the point of its own, with this number. `begins`: of each cell, and the end of the last.
  static uint64_t cellOf(const SpooledNumbers& begins, uint64_t number) {
    uint64_t low = 0, high = begins.count - 1;  // begins[low] <= number < begins[high]
    while (high - low > 1) {
      const uint64_t middle = low + (high - low) / 2;
      uint64_t begin = 0;
      begins.read(middle, std::span(&begin, 1));
      (begin <= number ? low : high) = middle;
    }
    return low;
  }

  void readOwnPoints(uint32_t piece, uint64_t first, uint64_t end, std::span<const uint32_t> scalars,
                     MeshPoints& out) const;

  std::vector<SpooledNumbers> begins_;  // [piece]: of each cell among the parts, and the end of the last
  std::vector<SpooledNumbers>
      own_points_;  // [piece]: as well, of the points of Bezier's cells; empty without any
  std::vector<SpooledNumbers> volumes_;  // [piece]: of each part; 0: that of the flat cell
  const bool cut_;
  const std::optional<uint32_t> rational_;
};

/// Bezier's cells have their points behind those of the file.
void CutSource::readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshPoints& out) const {
  const uint64_t of_file = source().description().pieces[piece].points;
  const uint64_t begin = std::min(first, of_file), end = std::min(first + count, of_file);
  source().readPoints(piece, begin, end - begin, scalars, out);
  if (first + count > of_file)
    readOwnPoints(piece, std::max(first, of_file) - of_file, first + count - of_file, scalars, out);
}

/// Appends points [first, end) of Bezier's cells.
void CutSource::readOwnPoints(uint32_t piece, uint64_t first, uint64_t end, std::span<const uint32_t> scalars,
                              MeshPoints& out) const {
  const MeshPiece& whole = source().description().pieces[piece];
  const uint64_t cells_end = cellOf(own_points_[piece], end - 1) + 1;
  uint64_t next = first;
  MeshCells cells;
  for (uint64_t cell = cellOf(own_points_[piece], first); cell < cells_end;) {
    const uint64_t count = std::min(kFewCells, cells_end - cell);
    source().readCells(piece, cell, count, {}, cells);
    checkCells(cells, whole, cell);
    const CellNodes nodes(source(), piece, cells, scalars, rational_);
    for (const auto& [n, curve] : cells.curved) {
      if (!curve.bezier) continue;
      uint64_t begin = 0;
      own_points_[piece].read(cell + n, std::span(&begin, 1));
      const NodesOfCell of_cell = nodes.of(cells.shapes[n], curve, cells.cornersOfCell(n));
      for (; next < end && next - begin < of_cell.places.size(); ++next) {
        const size_t node = next - begin;
        out.x.push_back(of_cell.places[node].x);
        out.y.push_back(of_cell.places[node].y);
        out.z.push_back(of_cell.places[node].z);
        out.hidden.push_back(of_cell.hidden);
        for (size_t scalar = 0; scalar < scalars.size(); ++scalar)
          out.scalars[scalar].push_back(static_cast<float>(of_cell.values[node * scalars.size() + scalar]));
      }
    }
    cell += count;
  }
  if (next != end)
    throw Error("{}: cells are other ones than before; the file has been replaced", whole.file);
}

void CutSource::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshCells& out) const {
  out.clear();
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.clear();
  if (count == 0) return;
  const uint64_t cell = cellOf(begins_[piece], first), end = cellOf(begins_[piece], first + count - 1) + 1;
  std::vector<uint64_t> begins(end - cell + 1);
  begins_[piece].read(cell, std::span(begins));
  MeshCells whole;
  source().readCells(piece, cell, end - cell, scalars, whole);
  std::vector<double> volumes(count);
  volumes_[piece].read(first, std::span(volumes));
  out.volumes.assign(volumes.begin(), volumes.end());
  std::vector<uint64_t> own_points(own_points_[piece].count > 0 ? end - cell : 0), own_nodes;
  own_points_[piece].read(cell, std::span(own_points));
  const uint64_t of_file = source().description().pieces[piece].points;
  auto curved = whole.curved.begin();
  for (size_t n = 0; n < whole.size(); ++n) {
    const uint64_t from = std::max(first, begins[n]) - begins[n],
                   to = std::min(first + count, begins[n + 1]) - begins[n];
    std::span<const uint64_t> nodes = whole.cornersOfCell(n);
    const bool is_curved = curved != whole.curved.end() && curved->first == n;
    const CellParts* const parts = is_curved ? partsOfCell(whole.shapes[n], curved->second) : nullptr;
    if (parts && curved->second.bezier && n < own_points.size()) {
      own_nodes.resize(nodes.size());
      std::iota(own_nodes.begin(), own_nodes.end(), of_file + own_points[n]);
      nodes = own_nodes;
    }
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
