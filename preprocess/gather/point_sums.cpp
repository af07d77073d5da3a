#include "preprocess/gather/point_sums.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>

#include "preprocess/gather/streams_file.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kSummedPerTask = 256;
constexpr size_t kMomentBytes = size_t{16} << 20;  // of a batch of cells
constexpr size_t kCellsPerRead = 8192;

/// A cell in a stream: this, its corners' numbers, positions and values, and its faces.
struct CellRecord {
  uint64_t number;
  uint32_t corners, faces;
  uint32_t shape;
  float volume;
};

void appendBytes(std::vector<std::byte>& out, const void* from, size_t bytes) {
  const size_t at = out.size();
  out.resize(at + bytes);
  if (bytes > 0) std::memcpy(out.data() + at, from, bytes);
}

template <typename T>
const std::byte* takeBytes(const std::byte* from, size_t count, std::vector<T>& out) {
  const size_t at = out.size();
  out.resize(at + count);
  if (count > 0) std::memcpy(static_cast<void*>(out.data() + at), from, count * sizeof(T));
  return from + count * sizeof(T);
}

/// Makes moments those of a cell of this volume: all of them are sums over it.
void scaleTo(double volume, size_t stride, std::span<double> moments) {
  double flat = 0;
  for (size_t corner = 0; corner < moments.size(); corner += stride) flat += moments[corner];
  if (flat > 0)
    for (double& moment : moments) moment *= volume / flat;
}

/// The moments of cells [begin, end); `out`: [corner of the first cell ...][moment].
void momentsOf(const GatheredCells& cells, size_t begin, size_t end, size_t fields, DualScratch& scratch,
               std::span<double> out) {
  const size_t stride = momentCount(fields);
  const auto outOf = [&](size_t first, size_t last) {
    const size_t from = cells.corner_begin[first] - cells.corner_begin[begin];
    return out.subspan(from * stride, (cells.corner_begin[last] - cells.corner_begin[first]) * stride);
  };
  for (size_t n = begin; n < end;) {
    if (cells.areFourAlike(n, end, fields) &&
        dualMomentsOfFour(cells.viewsOfFour(n, fields), fields, outOf(n, n + kCellsAtOnce))) {
      n += kCellsAtOnce;
      continue;
    }
    if (cells.shapes[n] == CellKind::kNone)
      std::ranges::fill(outOf(n, n + 1), 0.0);
    else
      dualMoments(cells.view(n, fields), fields, scratch, outOf(n, n + 1));
    ++n;
  }
  for (size_t n = begin; n < end; ++n)
    if (const double volume = cells.volumeOf(n); volume > 0) scaleTo(volume, stride, outOf(n, n + 1));
}

}  // namespace

PointSums::PointSums(uint64_t points, uint64_t cells, size_t fields, uint64_t memory_bytes,
                     const ScratchFiles& scratch)
    : points_(points),
      fields_(fields),
      shares_(sharesOf(cells, fields, memory_bytes)),
      scratch_(scratch),
      sums_(std::make_unique<SumPages>(points, fields, momentCount(fields), shares_.pages, scratch)),
      borders_(std::make_unique<PointBorders>(points, shares_.range_points, cells, shares_.border_bytes,
                                              scratch)) {}

PointSums::Shares PointSums::sharesOf(uint64_t cells, size_t fields, uint64_t memory_bytes) {
  Shares shares{};
  shares.border_bytes = memory_bytes / 8;
  shares.sum_bytes =
      memory_bytes - shares.border_bytes - std::min(PointBorders::waitingBytes(cells), memory_bytes / 4);
  const uint64_t page_bytes = SumPages::kPoints * SumPages::bytesOfPoint(fields, momentCount(fields));
  shares.pages = shares.sum_bytes / page_bytes;
  // Ranges are summed up, and become splats, once the corners' positions are no longer in memory.
  shares.range_points = std::max<uint64_t>(1, shares.sum_bytes * 3 / 2 / page_bytes) * SumPages::kPoints;
  return shares;
}

uint64_t PointSums::bytesOfWaiting(uint64_t corners, uint64_t face_words, size_t fields) {
  return sizeof(CellRecord) + corners * (sizeof(uint64_t) + sizeof(glm::dvec3) + fields * sizeof(float)) +
         face_words * sizeof(uint32_t);
}

PointSums::~PointSums() = default;

void PointSums::add(const GatheredCells& cells) {
  parallelInvoke([&] { borders_->add(cells); }, [&] { sum(cells); });
}

void PointSums::sum(const GatheredCells& cells) {
  if (!waiting_ && sums_->hold(cells.corners)) {
    const TraceScope trace("sum cells");
    return accumulate(cells, {0, points_});
  }
  if (!waiting_) {  // and so do all that come
    sums_->putAside();
    const uint64_t ranges = (points_ + shares_.range_points - 1) / shares_.range_points;
    waiting_ = std::make_unique<StreamsFile>(scratch_, ranges, shares_.cell_bytes());
  }
  write(cells);
}

void PointSums::write(const GatheredCells& cells) {
  std::vector<std::byte> record;
  std::vector<uint64_t> ranges;
  for (size_t n = 0; n < cells.size(); ++n) {
    if (cells.shapes[n] == CellKind::kNone) continue;
    const CellView view = cells.view(n, fields_);
    const std::span<const uint64_t> corners = cells.cornersOfCell(n);
    const CellRecord head{cells.numbers[n], static_cast<uint32_t>(corners.size()),
                          static_cast<uint32_t>(view.faces.size()), static_cast<uint32_t>(view.shape),
                          cells.volumeOf(n)};
    record.clear();
    appendBytes(record, &head, sizeof head);
    appendBytes(record, corners.data(), corners.size_bytes());
    appendBytes(record, view.corners.data(), view.corners.size_bytes());
    appendBytes(record, view.values.data(), view.values.size_bytes());
    appendBytes(record, view.faces.data(), view.faces.size_bytes());
    ranges.clear();
    for (const uint64_t corner : corners) ranges.push_back(corner / shares_.range_points);
    std::sort(ranges.begin(), ranges.end());
    ranges.erase(std::unique(ranges.begin(), ranges.end()), ranges.end());
    for (const uint64_t range : ranges) waiting_->append(range, record);
  }
}

namespace {

/// Turns moments about some values of the point into those about others.
void rebase(std::span<double> moments, const float* from, const float* to, size_t fields) {
  for (size_t field = 0; field < fields; ++field) {
    const double step = static_cast<double>(from[field]) - to[field];
    if (step == 0) continue;
    double* const of_field = moments.data() + 10 + 5 * field;
    of_field[4] += step * (2 * of_field[0] + step * moments[0]);
    for (size_t n = 0; n < 4; ++n) of_field[n] += step * moments[n];
  }
}

}  // namespace

void PointSums::accumulate(const GatheredCells& cells, const PointRange& range) {
  const size_t stride = momentCount(fields_);
  const size_t most_corners = std::max<size_t>(1, kMomentBytes / (stride * sizeof(double)));
  const auto threads = static_cast<size_t>(tbb::this_task_arena::max_concurrency());
  // Each looks at all corners. A power of two: dividing by another number takes as long as adding moments.
  const size_t stripes = threads == 1 ? 1 : std::bit_ceil(2 * threads);
  tbb::enumerable_thread_specific<DualScratch> scratch;
  for (size_t begin = 0; begin < cells.size();) {
    size_t end = begin + 1;
    const size_t first_corner = cells.corner_begin[begin];
    while (end < cells.size() && cells.corner_begin[end + 1] - first_corner <= most_corners) ++end;
    const size_t corners = cells.corner_begin[end] - first_corner;
    moments_.resize(std::max(moments_.size(), corners * stride));
    parallelFor(tbb::blocked_range<size_t>(begin, end, kSummedPerTask),
                [&](const tbb::blocked_range<size_t>& part) {
                  const size_t from = cells.corner_begin[part.begin()] - first_corner;
                  momentsOf(cells, part.begin(), part.end(), fields_, scratch.local(),
                            std::span(moments_).subspan(from * stride));
                });
    // Each point's sum has the order of the cells, whoever adds them. A page is summed by one task.
    parallelFor(size_t{0}, stripes, [&](size_t stripe) {
      for (size_t n = begin; n < end; ++n) {
        if (cells.shapes[n] == CellKind::kNone) continue;
        for (size_t corner = cells.corner_begin[n]; corner < cells.corner_begin[n + 1]; ++corner) {
          const uint64_t point = cells.corners[corner];
          if ((point >> SumPages::kShift & (stripes - 1)) != stripe || point < range.first ||
              point >= range.end)
            continue;
          double* const sums = sums_->sums(point);
          const float* const own = cells.corner_values.data() + corner * fields_;
          const std::span from(&moments_[(corner - first_corner) * stride], stride);
          if (std::isnan(sums[0])) {
            for (int axis = 0; axis < 3; ++axis) sums[axis] = cells.at[corner][axis];
            std::copy_n(own, fields_, sums_->values(point));
          } else {
            rebase(from, own, sums_->values(point), fields_);  // a point that is several in the file
          }
          for (size_t m = 0; m < stride; ++m) sums[3 + m] += from[m];
        }
      }
    });
    begin = end;
  }
}

void PointSums::flushRange(const RangeOfSplats& range, const TakeSplat& take, Counts& counts) {
  const size_t stride = momentCount(fields_);
  std::atomic<uint64_t> splats = 0, degenerate = 0, hanging = 0;
  parallelFor(tbb::blocked_range<uint64_t>(range.points.first, range.points.end, 1024),
              [&](const tbb::blocked_range<uint64_t>& part) {
                const TraceScope trace("splats of points");
                NodeSplat splat;
                std::vector<SplatScalar> values(fields_);
                std::vector<OuterPlane> of_point;
                uint64_t made = 0, flat = 0, fitted = 0;
                for (uint64_t point = part.begin(); point < part.end(); ++point) {
                  const double* const sums = sums_->sums(point);
                  if (std::isnan(sums[0])) continue;
                  const std::span<const double> moments(sums + 3, stride);
                  if (!(moments[0] > 0)) ++flat;
                  splatOfPoint(point, {{sums[0], sums[1], sums[2]}, {sums_->values(point), fields_}, moments},
                               splat, values);
                  const std::span<const OuterPlane> outer = range.planes.of(point, of_point);
                  if (range.hanging == HangingNodes::kFitted && range.planes.isAtClosed(point)) {
                    fitAtHangingNode(outer, splat, values);
                    ++fitted;
                  }
                  splat.border_code = meshBorderCode(outer, splat.splat, kNextOfPoints);
                  take(splat, values);
                  ++made;
                }
                splats += made;
                degenerate += flat;
                hanging += fitted;
              });
  counts.splats += splats;
  counts.degenerate += degenerate;
  counts.hanging += hanging;
}

void PointSums::sumWaiting(size_t stream, const PointRange& range, const Progress& progress) {
  GatheredCells cells;
  const auto sum = [&] {
    progress.throwIfStopped();
    accumulate(cells, range);
    cells.clear();
  };
  waiting_->forEach(stream, [&](std::span<const std::byte> records) {
    for (const std::byte* at = records.data(); at < records.data() + records.size();) {
      CellRecord head;
      std::memcpy(&head, at, sizeof head);
      at += sizeof head;
      cells.numbers.push_back(head.number);
      cells.shapes.push_back(static_cast<CellKind>(head.shape));
      cells.volumes.push_back(head.volume);
      at = takeBytes(at, head.corners, cells.corners);
      at = takeBytes(at, head.corners, cells.at);
      at = takeBytes(at, head.corners * fields_, cells.corner_values);
      at = takeBytes(at, head.faces, cells.faces);
      cells.corner_begin.push_back(cells.corners.size());
      cells.face_begin.push_back(cells.faces.size());
      if (cells.size() == kCellsPerRead) sum();
    }
  });
  sum();
  waiting_->forget(stream);
}

PointSums::Counts PointSums::finish(const TakeSplat& take, HangingNodes hanging, const Progress& progress) {
  Counts counts;
  borders_->finish(progress);
  if (waiting_) waiting_->close();
  constexpr uint64_t kPoints = SumPages::kPoints;
  sums_->setMost((std::min(shares_.range_points, points_) + kPoints - 1) / kPoints);
  size_t stream = 0;
  for (uint64_t first = 0; first < points_; first += shares_.range_points, ++stream) {
    progress.throwIfStopped();
    const PointRange range{first, std::min(first + shares_.range_points, points_)};
    const uint64_t first_page = range.first / kPoints, end_page = (range.end + kPoints - 1) / kPoints;
    sums_->holdPages(first_page, end_page);
    if (waiting_) sumWaiting(stream, range, progress);
    flushRange({range, borders_->load(stream), hanging}, take, counts);
    for (uint64_t page = first_page; page < end_page; ++page) sums_->forget(page);
  }
  sums_.reset();
  return counts;
}

}  // namespace curvisplat
