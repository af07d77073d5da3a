#include "preprocess/gather/mesh_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPointsPerChunk = 65536, kCellsPerChunk = 16384;

/// Cuts [first, first + count) into chunks.
void cut(uint32_t piece, uint64_t first, uint64_t count, uint64_t number, uint64_t chunk,
         std::vector<MeshRange>& out) {
  for (uint64_t done = 0; done < count; done += chunk)
    out.push_back({piece, first + done, std::min(chunk, count - done), number + done});
}

Centring centringOf(const GridDescription& description, const std::vector<uint32_t>& scalars) {
  const Centring first = scalars.empty() ? Centring::kNode : description.scalars.at(scalars.front()).centring;
  for (const uint32_t scalar : scalars)
    if (description.scalars.at(scalar).centring != first)
      throw Error(
          "{} is at the points and {} in the cells; a cache has splats of one kind: convert them to two "
          "caches",
          description.scalars[first == Centring::kNode ? scalars.front() : scalar].name,
          description.scalars[first == Centring::kNode ? scalar : scalars.front()].name);
  return first;
}

}  // namespace

uint64_t bytesOf(const MeshCells& cells) {
  return cells.shapes.size() + cells.hidden.size() +
         (cells.corner_begin.size() + cells.face_begin.size()) * sizeof(size_t) +
         cells.corners.size() * sizeof(uint64_t) + cells.faces.size() * sizeof(uint32_t) +
         (cells.scalars.size() * cells.size() + cells.volumes.size()) * sizeof(float);
}

MeshReader::MeshReader(const MeshSource& source, std::vector<uint32_t> scalars,
                       std::optional<double> blank_value)
    : source_(&source),
      scalars_(std::move(scalars)),
      blank_value_(blank_value),
      centring_(centringOf(source.description(), scalars_)) {
  for (const MeshPiece& piece : pieces()) {
    points_ += piece.points;
    cells_ += piece.cells;
  }
}

void MeshReader::load(const MeshRange& range, LoadedPoints& out) const {
  const std::vector<uint32_t> none;
  out.range = range;
  out.blanked = {};
  MeshPoints& points = out.points;
  source_->readPoints(range.piece, range.first, range.count, centring_ == Centring::kNode ? scalars_ : none,
                      points);
  const auto single = blank_value_ ? std::optional<float>(static_cast<float>(*blank_value_)) : std::nullopt;
  for (size_t n = 0; n < points.x.size(); ++n) {
    bool by_value = false;
    // Coordinates are kept in double, values in single precision: a value beyond it is infinite here.
    bool finite = std::isfinite(points.x[n]) && std::isfinite(points.y[n]) && std::isfinite(points.z[n]);
    for (const std::vector<float>& values : points.scalars) {
      by_value = by_value || (single && values[n] == *single);
      finite = finite && std::isfinite(values[n]);
    }
    if (!points.hidden[n] && !by_value && finite) continue;
    if (!points.hidden[n] && points.scalars.size() > 1)
      out.blanked.addLost(points.scalars, n, range.number + n, blank_value_);
    points.x[n] = std::numeric_limits<double>::quiet_NaN();
    ++(points.hidden[n] ? out.blanked.by_grid : by_value ? out.blanked.by_value : out.blanked.not_finite);
  }
}

void MeshReader::load(const MeshRange& range, LoadedCells& out) const {
  const std::vector<uint32_t> none;
  out.range = range;
  out.blanked = {};
  MeshCells& cells = out.cells;
  source_->readCells(range.piece, range.first, range.count, centring_ == Centring::kCell ? scalars_ : none,
                     cells);
  checkCells(cells, pieces()[range.piece], range.first);
  const auto single = blank_value_ ? std::optional<float>(static_cast<float>(*blank_value_)) : std::nullopt;
  for (size_t n = 0; n < cells.size(); ++n) {
    bool by_value = false, finite = true;
    for (const std::vector<float>& values : cells.scalars) {
      by_value = by_value || (single && values[n] == *single);
      finite = finite && std::isfinite(values[n]);
    }
    const bool by_grid = cells.hidden[n] || cells.shapes[n] == CellKind::kNone;
    if (!by_grid && !by_value && finite) continue;
    if (!by_grid && cells.scalars.size() > 1)
      out.blanked.addLost(cells.scalars, n, range.number + n, blank_value_);
    cells.shapes[n] = CellKind::kNone;
    if (!by_grid) cells.hidden[n] = kHasNoValue;
    ++(by_grid ? out.blanked.by_grid : by_value ? out.blanked.by_value : out.blanked.not_finite);
  }
}

template <typename Loaded>
void MeshReader::forEachWhile(const std::vector<MeshRange>& ranges,
                              const std::function<bool(const Loaded&)>& use) const {
  size_t next = 0;
  ReadAhead<Loaded> ahead([&](Loaded& loaded) {
    if (next == ranges.size()) return false;
    load(ranges[next++], loaded);
    return true;
  });
  for (const Loaded* loaded = ahead.next(); loaded && use(*loaded);) loaded = ahead.next();
}

std::vector<MeshRange> MeshReader::pointRanges(uint64_t first, uint64_t count) const {
  std::vector<MeshRange> ranges;
  uint64_t number = 0;
  for (uint32_t n = 0; n < pieces().size(); ++n) {
    const uint64_t end = number + pieces()[n].points;
    const uint64_t from = std::max(first, number), to = std::min(first + count, end);
    if (from < to) cut(n, from - number, to - from, from, kPointsPerChunk, ranges);
    number = end;
  }
  return ranges;
}

std::vector<MeshRange> MeshReader::cellRanges() const {
  std::vector<MeshRange> ranges;
  uint64_t number = 0;
  for (uint32_t n = 0; n < pieces().size(); ++n) {
    cut(n, 0, pieces()[n].cells, number, kCellsPerChunk, ranges);
    number += pieces()[n].cells;
  }
  return ranges;
}

void MeshReader::forEachPoints(const std::function<void(const LoadedPoints&)>& use) const {
  readPoints(0, points_, use);
}

void MeshReader::readPoints(uint64_t first, uint64_t count,
                            const std::function<void(const LoadedPoints&)>& use) const {
  forEachWhile<LoadedPoints>(pointRanges(first, count), [&](const LoadedPoints& loaded) {
    use(loaded);
    return true;
  });
}

void MeshReader::forEachCells(const std::function<void(const LoadedCells&)>& use) const {
  forEachCells(cellRanges(), use);
}

uint64_t MeshReader::largestChunk() const {
  uint64_t largest = 0;
  forEachCells([&](const LoadedCells& loaded) { largest = std::max(largest, bytesOf(loaded.cells)); });
  return largest;
}

void MeshReader::forEachCells(const std::vector<MeshRange>& ranges,
                              const std::function<void(const LoadedCells&)>& use) const {
  forEachCellsWhile(ranges, [&](const LoadedCells& loaded) {
    use(loaded);
    return true;
  });
}

void MeshReader::forEachCellsWhile(const std::vector<MeshRange>& ranges,
                                   const std::function<bool(const LoadedCells&)>& use) const {
  forEachWhile<LoadedCells>(ranges, use);
}

}  // namespace curvisplat
