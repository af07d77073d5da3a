#include "preprocess/gather/halved_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "preprocess/mesh/cell_nodes.h"
#include "preprocess/mesh/curved_cells.h"
#include "preprocess/mesh/forwarding_mesh.h"
#include "preprocess/moments/cell_moments.h"
#include "stream/base/error.h"
#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

constexpr uint64_t kCellsReadAtOnce = 4096;
constexpr size_t kMiddlesUnitedAtOnce = size_t{1} << 20, kMiddlesReadAtOnce = 65536;

/// The corners that a new point is the middle of, rising; the rest kNoCorner.
using Middle = std::array<uint32_t, 8>;
constexpr uint32_t kNoCorner = std::numeric_limits<uint32_t>::max();

/// Repeated corners count once if all are repeated equally often: a collapsed face {a, a, b, b} is the edge {a, b} of the cells beside it.
Middle middleOf(std::span<const uint8_t> between, std::span<const uint64_t> corners) {
  Middle middle;
  middle.fill(kNoCorner);
  for (size_t n = 0; n < between.size(); ++n) middle[n] = static_cast<uint32_t>(corners[between[n]]);
  const auto end = middle.begin() + static_cast<ptrdiff_t>(between.size());
  std::sort(middle.begin(), end);
  const auto times = std::count(middle.begin(), end, middle[0]);
  if (times > 1 && std::all_of(middle.begin(), end, [&](uint32_t corner) {
        return std::count(middle.begin(), end, corner) == times;
      }))
    std::fill(std::unique(middle.begin(), end), end, kNoCorner);
  return middle;
}

/// Whether all corners of the middle are one point.
bool isCorner(const Middle& middle) {
  return middle[1] == kNoCorner;
}

void sortAndUnite(std::vector<Middle>& middles) {
  std::sort(middles.begin(), middles.end());
  middles.erase(std::unique(middles.begin(), middles.end()), middles.end());
}

/// Whether a cell is halved: polyhedra are not, nor parts of curved cells, whose volumes are the file's, not those of their corners.
bool canBeHalved(const MeshCells& cells, size_t n) {
  return cornersOf(cells.shapes[n]) > 0 && (cells.volumes.empty() || !(cells.volumes[n] > 0));
}

/// Finds points of a piece by their places, to what single precision rounds.
class PointsByPlace {
 public:
  /// `is_used` [point]: whether a cell has it. Only such points are found: a file may store middles of edges that its cells leave out.
  PointsByPlace(const MeshSource& source, uint32_t piece, const std::vector<bool>& is_used) {
    const uint64_t count = source.description().pieces[piece].points;
    MeshPoints points;
    double largest = 0;
    for (uint64_t first = 0; first < count; first += kPointsAtOnce) {
      source.readPoints(piece, first, std::min(kPointsAtOnce, count - first), {}, points);
      for (size_t n = 0; n < points.x.size(); ++n) {
        places_.emplace_back(points.x[n], points.y[n], points.z[n]);
        if (!isFinite(places_.back())) continue;
        const glm::dvec3 size = glm::abs(places_.back());
        largest = std::max({largest, size.x, size.y, size.z});
      }
    }
    reach_ = 2 * largest * std::numeric_limits<float>::epsilon();
    for (size_t n = 0; n < places_.size(); ++n) {
      if (!is_used[n] || !isFinite(places_[n])) continue;
      const auto [at, is_new] = known_.try_emplace(boxOf(places_[n]), static_cast<uint32_t>(n));
      if (!is_new) at->second = kNoPoint;
    }
  }

  static constexpr uint32_t kNoPoint = std::numeric_limits<uint32_t>::max();

  /// The point at `place`, the middle between `corner` and others, to a hundredth of the way. kNoPoint: none is there, or several
  /// are, as on the two sides of a thin wall.
  uint32_t at(const glm::dvec3& place, uint32_t corner) const {
    const double most = std::min(reach_, 0.01 * glm::distance(place, places_[corner]));
    uint32_t found = kNoPoint;
    if (!isFinite(place)) return found;
    for (int side = 0; side < 8; ++side) {  // all boxes within reach: a box is twice as wide
      const glm::dvec3 to((side & 1) != 0 ? reach_ : -reach_, (side & 2) != 0 ? reach_ : -reach_,
                          (side & 4) != 0 ? reach_ : -reach_);
      const auto box = known_.find(boxOf(place + to));
      if (box == known_.end()) continue;
      const uint32_t point = box->second;
      if (point == kNoPoint) return kNoPoint;
      if (point == found || glm::distance(place, places_[point]) > most) continue;
      if (found != kNoPoint) return kNoPoint;
      found = point;
    }
    return found;
  }

 private:
  static constexpr uint64_t kPointsAtOnce = 65536;
  using Box = std::array<int64_t, 3>;

  static bool isFinite(const glm::dvec3& place) {
    return std::isfinite(place.x) && std::isfinite(place.y) && std::isfinite(place.z);
  }
  Box boxOf(const glm::dvec3& place) const {
    const double edge = reach_ > 0 ? 2 * reach_ : 1;
    const glm::dvec3 box = glm::floor(place / edge);
    return {static_cast<int64_t>(box.x), static_cast<int64_t>(box.y), static_cast<int64_t>(box.z)};
  }

  std::vector<glm::dvec3> places_;
  double reach_ = 0;               // how far apart rounding may put points that are one
  std::map<Box, uint32_t> known_;  // kNoPoint: several
};

/// A part of a cell.
struct PartShares {
  double volume = 1;               // in units that all parts have in common
  std::vector<double> of_corners;  // how much of a value at a corner the part's middle has
};

/// The shares of all parts of a cell. They are made once. Thread-safe.
const std::vector<PartShares>& sharesOf(CellKind shape) {
  static const std::map<CellKind, std::vector<PartShares>> known = [] {
    std::map<CellKind, std::vector<PartShares>> of_shapes;
    for (const CellKind kind :
         {CellKind::kTetrahedron, CellKind::kPyramid, CellKind::kWedge, CellKind::kHexahedron}) {
      const CellParts& parts = partsOf(kind, kHalved);
      std::vector<uint64_t> nodes(cornersOf(kind) + middlesOf(kind).size());
      std::iota(nodes.begin(), nodes.end(), uint64_t{0});
      MeshCells cells;
      for (size_t part = 0; part < parts.size(); ++part) {
        parts.append(part, nodes, cells);
        const std::span<const uint64_t> at = cells.cornersOfCell(part);
        // The pyramids in a pyramid have twice the volume of the tetrahedra.
        const bool is_small = kind == CellKind::kPyramid && cells.shapes[part] == CellKind::kTetrahedron;
        of_shapes[kind].push_back({is_small ? 0.5 : 1.0, std::vector<double>(cornersOf(kind))});
        PartShares& shares = of_shapes[kind].back();
        const auto add = [&](size_t corner, size_t among) {
          shares.of_corners[corner] += 1.0 / static_cast<double>(among * at.size());
        };
        for (const uint64_t node : at) {
          if (node < cornersOf(kind)) {
            add(node, 1);
            continue;
          }
          const std::vector<uint8_t>& between = middlesOf(kind)[node - cornersOf(kind)];
          for (const uint8_t corner : between) add(corner, between.size());
        }
      }
    }
    return of_shapes;
  }();
  return known.at(shape);
}

/// A piece's new points and parts.
struct HalvedPiece {
  std::vector<Middle> middles;      // sorted
  std::vector<uint32_t> points;     // [middle]: a new point, or one of the file's where a node hangs
  std::vector<size_t> added;        // [new point]: its number among the middles
  std::vector<uint64_t> begins{0};  // [cell + 1], in the parts
};

uint64_t cellsOf(const GridDescription& description) {
  uint64_t cells = 0;
  for (const MeshPiece& piece : description.pieces) cells += piece.cells;
  return cells;
}

/// [point of a piece]: the mean of a scalar in the cells around it.
using PointMeans = std::vector<float>;

class HalvedMesh final : public ForwardingMesh {
 public:
  HalvedMesh(std::unique_ptr<MeshSource> whole, std::optional<double> blank_value)
      : ForwardingMesh(std::move(whole)) {
    if (blank_value) blank_value_ = static_cast<float>(*blank_value);
    const uint64_t cells = cellsOf(description_);
    if (cells > kMaxHalved)
      throw Error("{}: has {} cells; unstructured grids of up to {} cells can be refined",
                  description_.pieces.front().file, cells, kMaxHalved);
    for (uint32_t piece = 0; piece < description_.pieces.size(); ++piece) pieces_.push_back(measured(piece));
    for (size_t n = 0; n < pieces_.size(); ++n) {
      description_.pieces[n].points += pieces_[n].added.size();
      description_.pieces[n].cells = pieces_[n].begins.back();
    }
    description_.refinement = Refinement(2 * description_.refinement.parts());
    description_.format += fmt::format(", refined {}", textOf(description_.refinement.ofBlock(0)));
  }

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  HalvedPiece measured(uint32_t piece) const;
  void findPoints(uint32_t piece, const std::vector<bool>& is_used, HalvedPiece& of) const;
  void readMiddles(uint32_t piece, std::span<const Middle> middles, std::span<const uint32_t> scalars,
                   MeshPoints& out) const;

  bool findNodes(uint32_t piece, const MeshCells& whole, size_t n, std::vector<uint64_t>& nodes) const;

  bool hasValue(float value) const { return std::isfinite(value) && value != blank_value_; }
  std::shared_ptr<const PointMeans> meansOf(uint32_t piece, uint32_t scalar) const;
  PointMeans computedMeans(uint32_t piece, uint32_t scalar) const;
  void appendValues(const MeshCells& whole, size_t n, float value, const PointMeans& means,
                    std::pair<uint64_t, uint64_t> wanted, std::vector<float>& out) const;

  std::vector<HalvedPiece> pieces_;
  std::optional<float> blank_value_;
  mutable Mutex mutex_;
  mutable std::map<std::pair<uint32_t, uint32_t>, std::shared_ptr<const PointMeans>> means_
      GUARDED_BY(mutex_);
};

HalvedPiece HalvedMesh::measured(uint32_t piece) const {
  const MeshPiece& whole = source().description().pieces[piece];
  if (whole.points > kMaxHalvedPoints)
    throw Error("{}: has {} points; unstructured grids of up to {} points can be refined", whole.file,
                whole.points, kMaxHalvedPoints);
  HalvedPiece found;
  std::vector<Middle>& middles = found.middles;
  size_t united = 0;
  std::vector<bool> is_used(whole.points, false);
  MeshCells cells;
  for (uint64_t first = 0; first < whole.cells; first += kCellsReadAtOnce) {
    const uint64_t count = std::min(kCellsReadAtOnce, whole.cells - first);
    source().readCells(piece, first, count, {}, cells);
    checkCells(cells, whole, first);
    for (size_t n = 0; n < count; ++n) {
      for (const uint64_t corner : cells.cornersOfCell(n)) is_used[corner] = true;
      const bool is_halved = canBeHalved(cells, n);
      found.begins.push_back(found.begins.back() +
                             (is_halved ? partsOf(cells.shapes[n], kHalved).size() : 1));
      if (!is_halved) continue;
      for (const auto& between : middlesOf(cells.shapes[n]))
        if (const Middle middle = middleOf(between, cells.cornersOfCell(n)); !isCorner(middle))
          middles.push_back(middle);
    }
    if (middles.size() < united + kMiddlesUnitedAtOnce) continue;
    sortAndUnite(middles);
    united = middles.size();
  }
  sortAndUnite(middles);
  middles.shrink_to_fit();
  findPoints(piece, is_used, found);
  return found;
}

/// Finds the point of each middle: where a node of smaller cells hangs, it is that one.
void HalvedMesh::findPoints(uint32_t piece, const std::vector<bool>& is_used, HalvedPiece& of) const {
  const PointsByPlace known(source(), piece, is_used);
  auto next = static_cast<uint32_t>(source().description().pieces[piece].points);
  MeshPoints points;
  for (size_t first = 0; first < of.middles.size(); first += kMiddlesReadAtOnce) {
    const size_t count = std::min(kMiddlesReadAtOnce, of.middles.size() - first);
    points = {};
    readMiddles(piece, std::span(of.middles).subspan(first, count), {}, points);
    for (size_t n = 0; n < count; ++n) {
      const glm::dvec3 place(points.x[n], points.y[n], points.z[n]);
      const uint32_t there = known.at(place, of.middles[first + n][0]);
      const bool is_new = there == PointsByPlace::kNoPoint;
      if (is_new) of.added.push_back(first + n);
      of.points.push_back(is_new ? next++ : there);
    }
  }
}

void HalvedMesh::readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                            MeshPoints& out) const {
  const uint64_t of_file = source().description().pieces[piece].points;
  const uint64_t begin = std::min(first, of_file), end = std::min(first + count, of_file);
  source().readPoints(piece, begin, end - begin, scalars, out);
  const uint64_t from = std::max(first, of_file) - of_file, to = std::max(first + count, of_file) - of_file;
  std::vector<Middle> added;
  for (const size_t middle : std::span(pieces_[piece].added).subspan(from, to - from))
    added.push_back(pieces_[piece].middles[middle]);
  readMiddles(piece, added, scalars, out);
}

/// Appends the points of these middles.
void HalvedMesh::readMiddles(uint32_t piece, std::span<const Middle> middles,
                             std::span<const uint32_t> scalars, MeshPoints& out) const {
  MeshCells around;  // [middle]: its corners, as a curved cell whose nodes CellNodes reads
  std::vector<uint64_t> corners;
  for (const Middle& middle : middles) {
    corners.clear();
    for (const uint32_t corner : middle)
      if (corner != kNoCorner) corners.push_back(corner);
    around.appendCurved(CellKind::kPolyhedron, kHalved, corners);
  }
  const CellNodes known(source(), piece, around, scalars, {});
  std::vector<size_t> order;
  for (size_t n = 0; n < middles.size(); ++n) {
    const NodesOfCell nodes = known.of(CellKind::kPolyhedron, kHalved, around.cornersOfCell(n));
    // Corners are summed in the order of their places, so that the sum has the same bits in all pieces.
    order.resize(nodes.places.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      const glm::dvec3 &p = nodes.places[a], &q = nodes.places[b];
      return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
    });
    const double share = 1.0 / static_cast<double>(order.size());
    glm::dvec3 place(0.0);
    for (const size_t corner : order) place += nodes.places[corner];
    out.x.push_back(share * place.x);
    out.y.push_back(share * place.y);
    out.z.push_back(share * place.z);
    out.hidden.push_back(nodes.hidden);
    for (size_t scalar = 0; scalar < scalars.size(); ++scalar) {
      double value = 0;
      bool is_there = true;
      for (const size_t corner : order) {
        const double of_corner = nodes.values[corner * scalars.size() + scalar];
        is_there &= hasValue(static_cast<float>(of_corner));
        value += of_corner;
      }
      out.scalars[scalar].push_back(is_there ? static_cast<float>(share * value) : NAN);
    }
  }
}

/// Finds the corners and middles of cell n, in the order of a curved cell's nodes. False: the cell has other middles than before.
bool HalvedMesh::findNodes(uint32_t piece, const MeshCells& whole, size_t n,
                           std::vector<uint64_t>& nodes) const {
  const auto& [middles, points, added, begins] = pieces_[piece];
  const std::span<const uint64_t> corners = whole.cornersOfCell(n);
  nodes.assign(corners.begin(), corners.end());
  for (const auto& between : middlesOf(whole.shapes[n])) {
    const Middle middle = middleOf(between, corners);
    const auto found = std::lower_bound(middles.begin(), middles.end(), middle);
    const bool is_known = found != middles.end() && *found == middle;
    if (!is_known && !isCorner(middle)) return false;
    nodes.push_back(is_known ? points[static_cast<size_t>(found - middles.begin())] : middle[0]);
  }
  return true;
}

void HalvedMesh::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshCells& out) const {
  out.clear();
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.clear();
  if (count == 0) return;
  const std::vector<uint64_t>& begins = pieces_[piece].begins;
  const auto cellOf = [&](uint64_t part) {
    return static_cast<uint64_t>(std::upper_bound(begins.begin(), begins.end(), part) - begins.begin()) - 1;
  };
  const uint64_t cell = cellOf(first), end = cellOf(first + count - 1) + 1;
  MeshCells whole;
  source().readCells(piece, cell, end - cell, scalars, whole);
  checkCells(whole, source().description().pieces[piece], cell);
  std::vector<std::shared_ptr<const PointMeans>> means;
  for (const uint32_t scalar : scalars) means.push_back(meansOf(piece, scalar));
  std::vector<uint64_t> nodes;
  for (size_t n = 0; n < whole.size(); ++n) {
    const CellParts* const parts = canBeHalved(whole, n) ? &partsOf(whole.shapes[n], kHalved) : nullptr;
    const uint64_t begin = begins[cell + n], next = begins[cell + n + 1];
    if ((parts ? parts->size() : 1) != next - begin || (parts && !findNodes(piece, whole, n, nodes)))
      throw Error("{}: cell {} is another one than before; the file has been replaced",
                  description_.pieces[piece].file, cell + n);
    const std::pair wanted(std::max(first, begin) - begin, std::min(first + count, next) - begin);
    for (uint64_t part = wanted.first; part < wanted.second; ++part) {
      if (parts)
        parts->append(part, nodes, out);
      else
        out.appendOf(whole, n);
      out.hidden.back() = whole.hidden[n];
      if (!whole.volumes.empty()) out.volumes.push_back(whole.volumes[n]);
    }
    for (size_t scalar = 0; scalar < scalars.size(); ++scalar)
      appendValues(whole, n, whole.scalars[scalar][n], *means[scalar], wanted, out.scalars[scalar]);
  }
}

std::shared_ptr<const PointMeans> HalvedMesh::meansOf(uint32_t piece, uint32_t scalar) const {
  const MutexLock lock(mutex_);
  auto& known = means_[{piece, scalar}];
  if (!known) known = std::make_shared<const PointMeans>(computedMeans(piece, scalar));
  return known;
}

PointMeans HalvedMesh::computedMeans(uint32_t piece, uint32_t scalar) const {
  const MeshPiece& whole = source().description().pieces[piece];
  std::vector<double> sums(whole.points, 0.0);
  std::vector<uint32_t> counts(whole.points, 0);
  MeshCells cells;
  for (uint64_t first = 0; first < whole.cells; first += kCellsReadAtOnce) {
    const uint64_t count = std::min(kCellsReadAtOnce, whole.cells - first);
    source().readCells(piece, first, count, std::span(&scalar, 1), cells);
    checkCells(cells, whole, first);
    for (size_t n = 0; n < count; ++n) {
      const float value = cells.scalars[0][n];
      if (cells.hidden[n] != 0 || !hasValue(value)) continue;
      for (const uint64_t corner : cells.cornersOfCell(n)) {
        sums[corner] += value;
        ++counts[corner];
      }
    }
  }
  PointMeans means(whole.points, 0.0f);
  for (size_t n = 0; n < means.size(); ++n)
    if (counts[n] > 0) means[n] = static_cast<float>(sums[n] / counts[n]);
  return means;
}

/// Appends the values of the parts [wanted.first, wanted.second) of cell n.
void HalvedMesh::appendValues(const MeshCells& whole, size_t n, float value, const PointMeans& means,
                              std::pair<uint64_t, uint64_t> wanted, std::vector<float>& out) const {
  if (!canBeHalved(whole, n) || whole.hidden[n] != 0 || !hasValue(value)) {
    out.insert(out.end(), wanted.second - wanted.first, value);
    return;
  }
  const std::span<const uint64_t> corners = whole.cornersOfCell(n);
  const std::vector<PartShares>& shares = sharesOf(whole.shapes[n]);
  double least = value, most = value, mean = 0, volume = 0;
  for (const uint64_t corner : corners) {
    least = std::min<double>(least, means[corner]);
    most = std::max<double>(most, means[corner]);
  }
  std::vector<double> of_parts;
  for (const PartShares& part : shares) {
    double of_part = 0;
    for (size_t corner = 0; corner < corners.size(); ++corner)
      of_part += part.of_corners[corner] * means[corners[corner]];
    of_parts.push_back(of_part);
    mean += part.volume * of_part;
    volume += part.volume;
  }
  mean /= volume;
  double slope = 1;  // less where a part would have a value beyond those around
  for (const double of_part : of_parts) {
    if (value + (of_part - mean) > most) slope = std::min(slope, (most - value) / (of_part - mean));
    if (value + (of_part - mean) < least) slope = std::min(slope, (least - value) / (of_part - mean));
  }
  for (uint64_t part = wanted.first; part < wanted.second; ++part)
    out.push_back(static_cast<float>(value + slope * (of_parts[part] - mean)));
}

/// How far volumes differ from cell to cell.
struct Unevenness {
  double squares = 0;  // of the logarithms of the largest over the smallest around a cell, times its volume
  double volume = 0;
};

void addPiece(const MeshSource& source, uint32_t piece, Unevenness& to) {
  const MeshPiece& whole = source.description().pieces[piece];
  MeshCells cells;
  source.readCells(piece, 0, whole.cells, {}, cells);
  checkCells(cells, whole, 0);
  for (size_t n = 0; n < cells.size(); ++n)
    if (canBeHalved(cells, n))
      cells.curved.emplace_back(n, kHalved);  // CellNodes reads those of curved cells
  const CellNodes nodes(source, piece, cells, {}, {});
  std::map<uint64_t, std::pair<double, size_t>> at_points;
  std::vector<double> volumes(cells.size(), 0.0);
  for (const auto& [n, curve] : cells.curved) {
    const std::span<const uint64_t> corners = cells.cornersOfCell(n);
    const NodesOfCell of_cell = nodes.of(cells.shapes[n], curve, corners);
    volumes[n] = bodyOf({cells.shapes[n], of_cell.places, {}, {}}).volume;
    for (const uint64_t corner : corners) {
      at_points[corner].first += volumes[n];
      ++at_points[corner].second;
    }
  }
  for (const auto& [n, curve] : cells.curved) {
    if (!(volumes[n] > 0)) continue;
    double least = std::numeric_limits<double>::infinity(), most = 0;
    for (const uint64_t corner : cells.cornersOfCell(n)) {
      const auto& [around, count] = at_points[corner];
      least = std::min(least, around / static_cast<double>(count));
      most = std::max(most, around / static_cast<double>(count));
    }
    const double growth = std::log(most / least);
    to.squares += volumes[n] * growth * growth;
    to.volume += volumes[n];
  }
}

}  // namespace

std::unique_ptr<MeshSource> halved(std::unique_ptr<MeshSource> source, std::optional<double> blank_value) {
  return std::make_unique<HalvedMesh>(std::move(source), blank_value);
}

bool isHalvedByNeed(const MeshSource& source) {
  constexpr uint64_t kMaxCells = 30'000;
  constexpr double kUneven = 0.07;
  const std::vector<MeshPiece>& pieces = source.description().pieces;
  if (cellsOf(source.description()) > kMaxCells ||
      std::ranges::any_of(pieces, [](const MeshPiece& piece) { return piece.points > kMaxHalvedPoints; }))
    return false;
  Unevenness of_all;
  for (uint32_t piece = 0; piece < pieces.size(); ++piece) addPiece(source, piece, of_all);
  return of_all.squares > kUneven * kUneven * of_all.volume;
}

}  // namespace curvisplat
