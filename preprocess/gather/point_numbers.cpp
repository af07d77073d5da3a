#include "preprocess/gather/point_numbers.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "preprocess/gather/streams_file.h"
#include "stream/base/checksum.h"

namespace curvisplat {
namespace {

constexpr size_t kTriedChunks = 4, kSampledCells = 4096;
// Elements are apart if more than kCoincidentShare of the points have the position of another point, and the cells fall
// into at least kMinElements parts of at most kMaxElement cells on the average (an element of order 8 has 8 x 8 x 8).
constexpr double kCoincidentShare = 1.0 / 32;
constexpr size_t kMinElements = 4, kMaxElement = 512;
constexpr uint64_t kWidest = 16;       // numbers of a chunk's points, over the points
constexpr uint64_t kMinRange = 65536;  // points whose numbers are written together

using Place = std::array<double, 3>;

/// The coordinate, or where `step` is not 0 the nearest multiple of it, in steps. Never -0.
double rounded(double x, double step) {
  return (step > 0 ? std::nearbyint(x / step) : x) + 0.0;
}

/// The step that positions of elements are rounded to: programs that write a point for each of its elements
/// differ in the last bits.
double stepOf(std::span<const Place> places) {
  constexpr int kBits = 40;
  double most = 0;
  for (const Place& place : places)
    for (const double x : place) most = std::max(most, std::abs(x));
  return most > 0 ? std::max(std::scalbn(1.0, std::ilogb(most) - kBits), std::numeric_limits<double>::min())
                  : 0;
}

/// Counts of chunks of cells: points; those that have the position of another one; parts without a common point.
struct Counts {
  size_t cells = 0, points = 0, taken = 0, parts = 0;
  double step = 0;  // stepOf() the points
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

/// Adds a chunk's.
void add(const MeshReader& reader, const LoadedCells& loaded, Counts& counts) {
  std::vector<uint64_t> numbers;
  for (size_t n = 0; n < loaded.cells.size(); ++n)
    if (loaded.cells.shapes[n] != CellKind::kNone)
      for (const uint64_t corner : loaded.cells.cornersOfCell(n)) numbers.push_back(corner);
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  if (numbers.empty() || numbers.back() - numbers.front() > kWidest * numbers.size()) return;
  uint64_t first_point = 0;
  for (uint32_t piece = 0; piece < loaded.range.piece; ++piece) first_point += reader.pieces()[piece].points;
  std::vector<Place> places;
  size_t next = 0;
  reader.readPoints(first_point + numbers.front(), numbers.back() - numbers.front() + 1,
                    [&](const LoadedPoints& some) {
                      const uint64_t begin = some.range.first, end = begin + some.range.count;
                      for (; next < numbers.size() && numbers[next] < end; ++next)
                        if (const size_t n = numbers[next] - begin; std::isfinite(some.points.x[n]))
                          places.push_back({some.points.x[n], some.points.y[n], some.points.z[n]});
                    });
  const double step = stepOf(places);
  for (Place& place : places)
    for (double& x : place) x = rounded(x, step);
  std::ranges::sort(places);
  counts.cells += loaded.cells.size();
  counts.points += places.size();
  counts.taken += static_cast<size_t>(places.end() - std::unique(places.begin(), places.end()));
  counts.parts += partsOf(loaded.cells, numbers);
  counts.step = std::max(counts.step, step);
}

/// stepOf() the points, or nullopt if elements are not apart.
std::optional<double> stepOfElementsApart(const MeshReader& reader) {
  const std::vector<MeshRange> chunks = reader.cellRanges();
  const size_t count = std::min(chunks.size(), kTriedChunks);
  std::vector<MeshRange> sample;
  for (size_t n = 0; n < count; ++n) {
    sample.push_back(chunks[n * chunks.size() / count]);
    sample.back().count = std::min<uint64_t>(sample.back().count, kSampledCells);
  }
  Counts all;
  reader.forEachCells(sample, [&](const LoadedCells& loaded) { add(reader, loaded, all); });
  const bool apart = all.parts >= kMinElements && all.cells <= kMaxElement * all.parts &&
                     static_cast<double>(all.taken) > kCoincidentShare * static_cast<double>(all.points);
  return apart ? std::optional(all.step) : std::nullopt;
}

struct Point {
  Place at;
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

bool hasElementsApart(const MeshReader& reader) {
  return stepOfElementsApart(reader).has_value();
}

PointNumbers::PointNumbers(const MeshReader& reader, uint64_t memory_bytes, const ScratchFiles& scratch,
                           const Progress& progress) {
  const std::optional<double> apart = stepOfElementsApart(reader);
  if (reader.pieces().size() < 2 && !apart) return;
  const double step = apart.value_or(0);
  const uint64_t part_bytes = std::max<uint64_t>(1, memory_bytes / 4);
  const size_t streams = std::min<uint64_t>(reader.points() * sizeof(Point) / part_bytes + 1,
                                            StreamsFile::mostStreams(part_bytes));
  const uint64_t range_points = std::max<uint64_t>(kMinRange, part_bytes / sizeof(uint64_t));
  StreamsFile merged(scratch, reader.points() / range_points + 1, part_bytes / 2);
  {
    StreamsFile file(scratch, streams, part_bytes);
    reader.forEachPoints([&](const LoadedPoints& loaded) {
      progress.throwIfStopped();
      const MeshPoints& points = loaded.points;
      for (size_t n = 0; n < points.x.size(); ++n) {
        if (!std::isfinite(points.x[n])) continue;
        const Point point{
            {rounded(points.x[n], step), rounded(points.y[n], step), rounded(points.z[n], step)},
            loaded.range.number + n,
            loaded.range.piece};
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
