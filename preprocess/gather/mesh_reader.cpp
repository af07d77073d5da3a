#include "preprocess/gather/mesh_reader.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

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

constexpr size_t kSampledChunks = 4, kSampledCells = 4096;
// Of elements that are apart: points at the positions of others, over all of them; how many elements there are; their cells.
constexpr double kCoincidentShare = 1.0 / 32;
constexpr size_t kMinElements = 4, kMaxElement = 512;
constexpr uint64_t kWidest = 16;  // numbers of a chunk's points, over the points

/// A position without the last bits, in which files of one mesh differ.
std::array<double, 3> placeOf(const MeshPoints& points, size_t n) {
  const auto rounded = [](double x) {
    constexpr uint64_t kLost = 12, kHalf = uint64_t{1} << (kLost - 1);
    const uint64_t bits = std::bit_cast<uint64_t>(x + 0.0);  // no point at -0 differs from one at 0
    return std::bit_cast<double>((bits + kHalf) >> kLost << kLost);
  };
  return {rounded(points.x[n]), rounded(points.y[n]), rounded(points.z[n])};
}

/// Counts of a chunk of cells: its points; those that have the position of another one; its parts that have no point in common.
struct Places {
  size_t cells = 0, points = 0, taken = 0, parts = 0;
};

/// The parts of a chunk that have no point in common, of the points `numbers`, rising.
size_t partsOf(const MeshCells& cells, std::span<const uint64_t> numbers) {
  std::vector<size_t> above(numbers.size());
  std::iota(above.begin(), above.end(), size_t{0});
  const auto top = [&](uint64_t number) {
    auto n = static_cast<size_t>(std::ranges::lower_bound(numbers, number) - numbers.begin());
    while (above[n] != n) n = above[n] = above[above[n]];
    return n;
  };
  size_t parts = numbers.size();
  for (size_t n = 0; n < cells.size(); ++n) {
    if (cells.shapes[n] == CellKind::kNone) continue;
    const std::span<const uint64_t> corners = cells.cornersOfCell(n);
    for (const uint64_t corner : corners)
      if (const size_t a = top(corners.front()), b = top(corner); a != b) {
        above[b] = a;
        --parts;
      }
  }
  return parts;
}

Places placesOf(const MeshReader& reader, const LoadedCells& loaded) {
  std::vector<uint64_t> numbers;
  for (size_t n = 0; n < loaded.cells.size(); ++n)
    if (loaded.cells.shapes[n] != CellKind::kNone)
      for (const uint64_t corner : loaded.cells.cornersOfCell(n)) numbers.push_back(corner);
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  if (numbers.empty() || numbers.back() - numbers.front() > kWidest * numbers.size()) return {};
  uint64_t first_point = 0;
  for (uint32_t piece = 0; piece < loaded.range.piece; ++piece) first_point += reader.pieces()[piece].points;
  std::vector<std::array<double, 3>> places;
  size_t next = 0;
  reader.readPoints(first_point + numbers.front(), numbers.back() - numbers.front() + 1,
                    [&](const LoadedPoints& points) {
                      const uint64_t begin = points.range.first, end = begin + points.range.count;
                      for (; next < numbers.size() && numbers[next] < end; ++next)
                        if (const size_t n = numbers[next] - begin; std::isfinite(points.points.x[n]))
                          places.push_back(placeOf(points.points, n));
                    });
  std::ranges::sort(places);
  const size_t all = places.size();
  places.erase(std::unique(places.begin(), places.end()), places.end());
  return {loaded.cells.size(), all, all - places.size(), partsOf(loaded.cells, numbers)};
}

}  // namespace

bool hasElementsApart(const MeshReader& reader) {
  const std::vector<MeshRange> chunks = reader.cellRanges();
  std::vector<MeshRange> sample;
  for (size_t n = 0; n < std::min(chunks.size(), kSampledChunks); ++n) {
    sample.push_back(chunks[n * chunks.size() / std::min(chunks.size(), kSampledChunks)]);
    sample.back().count = std::min<uint64_t>(sample.back().count, kSampledCells);
  }
  Places all;
  reader.forEachCells(sample, [&](const LoadedCells& loaded) {
    const Places places = placesOf(reader, loaded);
    all.cells += places.cells;
    all.points += places.points;
    all.taken += places.taken;
    all.parts += places.parts;
  });
  return all.parts >= kMinElements && all.cells <= kMaxElement * all.parts &&
         static_cast<double>(all.taken) > kCoincidentShare * static_cast<double>(all.points);
}

namespace {

struct Point {
  std::array<double, 3> at;
  uint64_t number;
  uint64_t piece;
  bool operator<(const Point& other) const { return at != other.at ? at < other.at : number < other.number; }
};

/// A point that becomes another one.
struct Merged {
  uint64_t number, becomes;
};

/// All records of a stream, which is forgotten.
template <typename Record>
void load(StreamsFile& file, size_t stream, std::vector<Record>& out) {
  out.resize(file.bytes(stream) / sizeof(Record));
  size_t at = 0;
  file.forEach(stream, [&](std::span<const std::byte> records) {
    std::memcpy(static_cast<void*>(out.data() + at), records.data(), records.size());
    at += records.size() / sizeof(Record);
  });
  file.forget(stream);
}

}  // namespace

PointNumbers::PointNumbers(const MeshReader& reader, uint64_t memory_bytes, const ScratchFiles& scratch,
                           const Progress& progress) {
  const bool apart = hasElementsApart(reader);
  if (reader.pieces().size() < 2 && !apart) return;
  const uint64_t part_bytes = std::max<uint64_t>(1, memory_bytes / 4);
  const size_t streams = std::min<uint64_t>(reader.points() * sizeof(Point) / part_bytes + 1,
                                            StreamsFile::mostStreams(part_bytes));
  const uint64_t range_points = std::max<uint64_t>(kPointsPerChunk, part_bytes / sizeof(uint64_t));
  StreamsFile merged(scratch, reader.points() / range_points + 1, part_bytes / 2);
  {
    StreamsFile file(scratch, streams, part_bytes);
    reader.forEachPoints([&](const LoadedPoints& loaded) {
      progress.throwIfStopped();
      for (size_t n = 0; n < loaded.points.x.size(); ++n) {
        if (!std::isfinite(loaded.points.x[n])) continue;
        const Point point{placeOf(loaded.points, n), loaded.range.number + n, loaded.range.piece};
        file.appendRecord(streams > 1 ? checksumOf(std::as_bytes(std::span(point.at))) % streams : 0, point);
      }
    });
    file.close();
    std::vector<Point> points;
    for (size_t stream = 0; stream < streams; ++stream) {
      load(file, stream, points);
      progress.throwIfStopped();
      tbb::parallel_sort(points.begin(), points.end());
      for (size_t first = 0; first < points.size();) {
        size_t end = first + 1;
        for (; end < points.size() && points[end].at == points[first].at; ++end)
          if (apart || points[end].piece != points[first].piece) {
            merged.appendRecord(points[end].number / range_points,
                                Merged{points[end].number, points[first].number});
            ++merged_;
          }
        first = end;
      }
    }
  }
  merged.close();
  if (merged_ == 0) return;
  file_ = std::make_unique<NamelessFile>(scratch);
  std::vector<uint64_t> numbers;
  for (size_t range = 0; range < merged.streams(); ++range) {
    progress.throwIfStopped();
    const uint64_t first = range * range_points;
    numbers.resize(std::min(range_points, reader.points() - first));
    std::iota(numbers.begin(), numbers.end(), first);
    merged.forEach(range, [&](std::span<const std::byte> records) {
      for (size_t at = 0; at < records.size(); at += sizeof(Merged)) {
        Merged point;
        std::memcpy(&point, records.data() + at, sizeof point);
        numbers[point.number - first] = point.becomes;
      }
    });
    merged.forget(range);
    file_->out().writeAt(first * sizeof(uint64_t), std::as_bytes(std::span(numbers)));
  }
}

void PointNumbers::read(uint64_t first, std::span<uint64_t> out) const {
  if (file_)
    file_->in().readAt(first * sizeof(uint64_t), out);
  else
    std::iota(out.begin(), out.end(), first);
}

}  // namespace curvisplat
