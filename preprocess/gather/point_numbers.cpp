#include "preprocess/gather/point_numbers.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "preprocess/gather/streams_file.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"

namespace curvisplat {
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
