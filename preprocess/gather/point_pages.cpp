#include "preprocess/gather/point_pages.h"

#include <tbb/blocked_range.h>

#include <algorithm>

#include "preprocess/grid/parallel.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kPointsPerTask = 4096;

}  // namespace

PointPages::PointPages(const MeshReader& reader, size_t fields, uint64_t memory_bytes)
    : reader_(&reader), fields_(fields), slots_(slotsFor(reader.points(), fields, memory_bytes)) {}

bool PointPages::hold(std::span<const uint64_t> points) {
  if (!slots_.hold(points, kMaxAgain)) return false;
  const std::span<const uint64_t> missing = slots_.missing();
  if (missing.empty()) return true;
  const TraceScope trace("read points");
  slots_.place();
  for (size_t first = 0; first < missing.size();) {
    size_t end = first + 1;
    while (end < missing.size() && missing[end] == missing[end - 1] + 1) ++end;
    for (size_t n = first; n < end; ++n) {
      const uint64_t page = missing[n], begin = page * kPoints;
      if (pages_.size() <= slots_.slotOf(page)) pages_.resize(slots_.slotOf(page) + size_t{1});
      Page& to = pages_[slots_.slotOf(page)];
      const uint64_t count = std::min(kPoints, reader_->points() - begin);
      to.at.resize(count);
      to.values.resize(count * fields_);
    }
    const uint64_t from = missing[first] * kPoints;
    const uint64_t to = std::min((missing[end - 1] + 1) * kPoints, reader_->points());
    reader_->readPoints(from, to - from, [&](const LoadedPoints& loaded) { take(loaded); });
    first = end;
  }
  return true;
}

void PointPages::take(const LoadedPoints& loaded) {
  const MeshPoints& points = loaded.points;
  parallelFor(tbb::blocked_range<size_t>(0, points.x.size(), kPointsPerTask),
              [&](const tbb::blocked_range<size_t>& part) {
                for (size_t n = part.begin(); n < part.end(); ++n) {
                  const uint64_t point = loaded.range.number + n, in_page = point & (kPoints - 1);
                  Page& page = pages_[slots_.slotOf(point >> kShift)];
                  page.at[in_page] = {points.x[n], points.y[n], points.z[n]};
                  for (size_t field = 0; field < fields_; ++field)
                    page.values[in_page * fields_ + field] = points.scalars[field][n];
                }
              });
}

}  // namespace curvisplat
