#include "preprocess/gather/mesh_reader.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "preprocess/gather/streams_file.h"
#include "stream/base/checksum.h"
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

namespace {

struct Point {
  std::array<double, 3> at;
  uint64_t number;
  uint64_t piece;
  bool operator<(const Point& other) const { return at != other.at ? at < other.at : number < other.number; }
};

}  // namespace

PointNumbers::PointNumbers(const MeshReader& reader, uint64_t memory_bytes, const ScratchFiles& scratch,
                           const Progress& progress) {
  if (reader.pieces().size() < 2) return;
  const uint64_t all_bytes = reader.points() * sizeof(Point);
  const size_t streams = std::min<uint64_t>(all_bytes / std::max<uint64_t>(1, memory_bytes / 4) + 1,
                                            StreamsFile::mostStreams(memory_bytes / 4));
  StreamsFile file(scratch, streams, memory_bytes / 4);
  reader.forEachPoints([&](const LoadedPoints& loaded) {
    progress.throwIfStopped();
    const MeshPoints& points = loaded.points;
    for (size_t n = 0; n < points.x.size(); ++n) {
      if (!std::isfinite(points.x[n])) continue;
      // No point at -0 differs from one at 0.
      const Point point{{points.x[n] + 0.0, points.y[n] + 0.0, points.z[n] + 0.0},
                        loaded.range.number + n,
                        loaded.range.piece};
      file.appendRecord(streams > 1 ? checksumOf(std::as_bytes(std::span(point.at))) % streams : 0, point);
    }
  });
  file.close();
  std::vector<Point> points;
  for (size_t stream = 0; stream < streams; ++stream) {
    points.resize(file.bytes(stream) / sizeof(Point));
    size_t at = 0;
    file.forEach(stream, [&](std::span<const std::byte> records) {
      std::memcpy(points.data() + at, records.data(), records.size());
      at += records.size() / sizeof(Point);
    });
    file.forget(stream);
    progress.throwIfStopped();
    tbb::parallel_sort(points.begin(), points.end());
    for (size_t first = 0; first < points.size();) {
      size_t end = first + 1;
      for (; end < points.size() && points[end].at == points[first].at; ++end)
        if (points[end].piece != points[first].piece)
          merged_.emplace_back(points[end].number, points[first].number);
      first = end;
    }
    if (merged_.size() * sizeof(merged_.front()) > memory_bytes / 4)
      throw Error("--memory: {} points are shared by pieces of the mesh, more than fit; increase --memory",
                  merged_.size());
  }
  tbb::parallel_sort(merged_.begin(), merged_.end());
}

uint64_t PointNumbers::operator()(uint64_t number) const {
  if (merged_.empty()) return number;
  const auto found = std::lower_bound(merged_.begin(), merged_.end(), std::pair(number, uint64_t{0}));
  return found != merged_.end() && found->first == number ? found->second : number;
}

}  // namespace curvisplat
