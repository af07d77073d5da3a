#include "preprocess/gather/point_sums.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "preprocess/gather/streams_file.h"

namespace curvisplat {
namespace {

constexpr size_t kCellsPerTask = 256;
// Points whose numbers differ in this many lowest bits are summed by one task.
constexpr uint64_t kStripe = 4096;
constexpr size_t kMomentBytes = size_t{16} << 20;  // of a batch of cells
constexpr size_t kCellsPerRead = 8192;

/// A cell in a stream: this, its corners' numbers, positions and values, and its faces.
struct CellRecord {
  uint64_t number;
  uint32_t corners, faces;
  uint32_t shape;
  uint32_t reserved = 0;
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
}

}  // namespace

struct PointSums::Sums {
  Sums(uint64_t first_point, uint64_t points, size_t fields)
      : first(first_point),
        at(points, glm::dvec3(std::numeric_limits<double>::quiet_NaN())),
        values(points * fields),
        moments(points * momentCount(fields)) {}

  uint64_t first;
  std::vector<glm::dvec3> at;   // NaN: no cell has come
  std::vector<float> values;    // [point * fields + field]
  std::vector<double> moments;  // [point * momentCount + moment]
};

PointSums::PointSums(uint64_t points, uint64_t cells, size_t fields, uint64_t memory_bytes,
                     const std::filesystem::path& folder)
    : points_(points), fields_(fields) {
  const uint64_t border_bytes = memory_bytes / 8;
  memory_bytes -= border_bytes + std::min(PointBorders::waitingBytes(cells), memory_bytes / 4);
  const auto with_borders = [&] {
    borders_ = std::make_unique<PointBorders>(points, range_points_, cells, border_bytes, folder);
  };
  const uint64_t bytes = sizeof(glm::dvec3) + fields * sizeof(float) + momentCount(fields) * sizeof(double);
  if (points * bytes <= memory_bytes) {
    range_points_ = std::max<uint64_t>(1, points);
    sums_ = std::make_unique<Sums>(0, points, fields);
    with_borders();
    return;
  }
  // Ranges are summed once the corners' positions are no longer in memory.
  range_points_ = std::max<uint64_t>(1, memory_bytes * 3 / 2 / bytes);
  const uint64_t ranges = (points + range_points_ - 1) / range_points_;
  waiting_ = std::make_unique<StreamsFile>(folder, ranges, memory_bytes / 4);
  with_borders();
}

PointSums::~PointSums() = default;

void PointSums::add(const GatheredCells& cells) {
  tbb::parallel_invoke([&] { borders_->add(cells); },
                       [&] { sums_ ? accumulate(cells, *sums_) : write(cells); });
}

void PointSums::write(const GatheredCells& cells) {
  std::vector<std::byte> record;
  std::vector<uint64_t> ranges;
  for (size_t n = 0; n < cells.size(); ++n) {
    if (cells.shapes[n] == CellKind::kNone) continue;
    const CellView view = cells.view(n, fields_);
    const std::span<const uint64_t> corners = cells.cornersOfCell(n);
    const CellRecord head{cells.numbers[n], static_cast<uint32_t>(corners.size()),
                          static_cast<uint32_t>(view.faces.size()), static_cast<uint32_t>(view.shape)};
    record.clear();
    appendBytes(record, &head, sizeof head);
    appendBytes(record, corners.data(), corners.size_bytes());
    appendBytes(record, view.corners.data(), view.corners.size_bytes());
    appendBytes(record, view.values.data(), view.values.size_bytes());
    appendBytes(record, view.faces.data(), view.faces.size_bytes());
    ranges.clear();
    for (const uint64_t corner : corners) ranges.push_back(corner / range_points_);
    std::sort(ranges.begin(), ranges.end());
    ranges.erase(std::unique(ranges.begin(), ranges.end()), ranges.end());
    for (const uint64_t range : ranges) waiting_->append(range, record);
  }
}

void PointSums::accumulate(const GatheredCells& cells, Sums& sums) {
  const size_t stride = momentCount(fields_);
  const size_t most_corners = std::max<size_t>(1, kMomentBytes / (stride * sizeof(double)));
  const uint64_t end_point = sums.first + sums.at.size();
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
    tbb::parallel_for(tbb::blocked_range<size_t>(begin, end, kCellsPerTask),
                      [&](const tbb::blocked_range<size_t>& part) {
                        const size_t from = cells.corner_begin[part.begin()] - first_corner;
                        momentsOf(cells, part.begin(), part.end(), fields_, scratch.local(),
                                  std::span(moments_).subspan(from * stride));
                      });
    // Each point's sum has the order of the cells, whoever adds them.
    tbb::parallel_for(size_t{0}, stripes, [&](size_t stripe) {
      for (size_t n = begin; n < end; ++n) {
        if (cells.shapes[n] == CellKind::kNone) continue;
        for (size_t corner = cells.corner_begin[n]; corner < cells.corner_begin[n + 1]; ++corner) {
          const uint64_t point = cells.corners[corner];
          if ((point / kStripe & (stripes - 1)) != stripe || point < sums.first || point >= end_point)
            continue;
          const size_t to = point - sums.first;
          if (std::isnan(sums.at[to].x)) {
            sums.at[to] = cells.at[corner];
            std::copy_n(cells.corner_values.data() + corner * fields_, fields_,
                        sums.values.data() + to * fields_);
          }
          const double* from = &moments_[(corner - first_corner) * stride];
          double* sum = &sums.moments[to * stride];
          for (size_t m = 0; m < stride; ++m) sum[m] += from[m];
        }
      }
    });
    begin = end;
  }
}

void PointSums::flushRange(const Sums& sums, const OuterPlanes::OfRange& planes, const TakeSplat& take,
                           Counts& counts) const {
  const size_t stride = momentCount(fields_);
  std::atomic<uint64_t> splats = 0, degenerate = 0;
  tbb::parallel_for(
      tbb::blocked_range<size_t>(0, sums.at.size(), 1024), [&](const tbb::blocked_range<size_t>& part) {
        NodeSplat splat;
        std::vector<SplatScalar> values(fields_);
        std::vector<OuterPlane> of_point;
        uint64_t made = 0, flat = 0;
        for (size_t n = part.begin(); n < part.end(); ++n) {
          if (std::isnan(sums.at[n].x)) continue;
          if (!(sums.moments[n * stride] > 0)) ++flat;
          splatOfPoint(sums.first + n,
                       {sums.at[n], std::span(sums.values).subspan(n * fields_, fields_),
                        std::span(sums.moments).subspan(n * stride, stride)},
                       splat, values);
          splat.border_code = meshBorderCode(planes.of(sums.first + n, of_point), splat.splat, kNextOfPoints);
          take(splat, values);
          ++made;
        }
        splats += made;
        degenerate += flat;
      });
  counts.splats += splats;
  counts.degenerate += degenerate;
}

PointSums::Counts PointSums::finish(const TakeSplat& take, const Progress& progress) {
  Counts counts;
  borders_->finish(progress);
  if (sums_) {
    flushRange(*sums_, borders_->load(0), take, counts);
    sums_.reset();
    return counts;
  }
  waiting_->close();
  GatheredCells cells;
  for (size_t range = 0; range < waiting_->streams(); ++range) {
    const uint64_t first = range * range_points_;
    Sums sums(first, std::min(range_points_, points_ - first), fields_);
    cells.clear();
    const auto sum = [&] {
      progress.throwIfStopped();
      accumulate(cells, sums);
      cells.clear();
    };
    waiting_->forEach(range, [&](std::span<const std::byte> records) {
      for (const std::byte* at = records.data(); at < records.data() + records.size();) {
        CellRecord head;
        std::memcpy(&head, at, sizeof head);
        at += sizeof head;
        cells.numbers.push_back(head.number);
        cells.shapes.push_back(static_cast<CellKind>(head.shape));
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
    waiting_->forget(range);
    flushRange(sums, borders_->load(range), take, counts);
  }
  return counts;
}

}  // namespace curvisplat
