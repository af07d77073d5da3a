#include "preprocess/gather/corner_gather.h"

#include <tbb/blocked_range.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "preprocess/gather/point_pages.h"
#include "preprocess/gather/streams_file.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kGatheredPerTask = 512;

uint64_t cornersDrawn(const MeshCells& cells) {
  uint64_t corners = 0;
  for (size_t n = 0; n < cells.size(); ++n)
    if (cells.shapes[n] != CellKind::kNone) corners += cells.cornersOfCell(n).size();
  return corners;
}

/// The slot of a corner, and the point that it waits for.
struct Reference {
  uint64_t point, slot;
};

}  // namespace

/// Uses some cells in a task, while the caller gathers the next ones.
class CornerGather::UsedBeside {
 public:
  explicit UsedBeside(const std::function<void(const GatheredCells&)>& use) : use_(&use) {}
  ~UsedBeside() {
    try {
      task_.wait();
    } catch (...) {  // another error is on its way
    }
  }
  UsedBeside(const UsedBeside&) = delete;
  UsedBeside& operator=(const UsedBeside&) = delete;

  /// To be filled.
  GatheredCells& next() { return cells_[next_]; }
  /// next() is full. Waits until those before it have been used.
  void use() {
    task_.wait();
    task_.run(withPermit([this, full = next_] {
      const TraceScope trace("use cells");
      (*use_)(cells_[full]);
    }));
    next_ = 1 - next_;
  }
  /// Waits for the last ones. Throws what `use` threw.
  void finish() { task_.wait(); }

 private:
  const std::function<void(const GatheredCells&)>* use_;
  std::array<GatheredCells, 2> cells_;
  size_t next_ = 0;
  tbb::task_group task_;
};

CellView GatheredCells::view(size_t n, size_t corner_fields) const {
  const size_t begin = corner_begin[n], count = corner_begin[n + 1] - begin;
  return {shapes[n], std::span(at).subspan(begin, count),
          std::span(corner_values).subspan(begin * corner_fields, count * corner_fields),
          std::span(faces).subspan(face_begin[n], face_begin[n + 1] - face_begin[n])};
}

bool GatheredCells::areFourAlike(size_t n, size_t end, size_t corner_fields) const {
  if (end - n < kCellsAtOnce || !isTakenAtOnce(shapes[n], corner_fields)) return false;
  const auto first = shapes.begin() + static_cast<ptrdiff_t>(n);
  return std::count(first, first + kCellsAtOnce, shapes[n]) == kCellsAtOnce;
}

std::array<CellView, kCellsAtOnce> GatheredCells::viewsOfFour(size_t n, size_t corner_fields) const {
  return {view(n, corner_fields), view(n + 1, corner_fields), view(n + 2, corner_fields),
          view(n + 3, corner_fields)};
}

void GatheredCells::clear() {
  numbers.clear();
  shapes.clear();
  corner_begin.assign(1, 0);
  corners.clear();
  at.clear();
  corner_values.clear();
  face_begin.assign(1, 0);
  faces.clear();
  cell_values.clear();
  volumes.clear();
}

uint64_t halfBesideChunks(uint64_t memory_bytes, uint64_t chunk_bytes) {
  return (memory_bytes - std::min(2 * chunk_bytes, memory_bytes / 2)) / 2;
}

CornerGather::CornerGather(const MeshReader& reader, const PointNumbers& numbers, uint64_t memory_bytes,
                           ScratchFiles scratch, Progress& progress)
    : reader_(&reader),
      numbers_(&numbers),
      memory_bytes_(memory_bytes),
      scratch_(std::move(scratch)),
      progress_(&progress),
      corner_fields_(reader.centring() == Centring::kNode ? reader.scalars() : 0),
      cell_fields_(reader.centring() == Centring::kCell ? reader.scalars() : 0) {}

size_t CornerGather::gather(const LoadedCells& loaded, size_t begin, GatheredCells& out) const {
  out.clear();
  const MeshCells& cells = loaded.cells;
  uint64_t first_point = 0;
  for (uint32_t piece = 0; piece < loaded.range.piece; ++piece)
    first_point += reader_->pieces()[piece].points;
  size_t n = begin, corners = 0;
  for (; n < cells.size(); ++n) {
    if (cells.shapes[n] == CellKind::kNone) continue;
    const std::span<const uint64_t> points = cells.cornersOfCell(n);
    const std::span<const uint32_t> faces = cells.facesOfCell(n);
    if (out.size() > 0 && (corners + points.size() > GatheredCells::kMaxCorners ||
                           out.faces.size() + faces.size() > GatheredCells::kMaxCorners))
      break;
    out.numbers.push_back(loaded.range.number + n);
    out.shapes.push_back(cells.shapes[n]);
    if (out.corners.size() < corners + points.size())
      out.corners.resize(std::max(corners + points.size(), GatheredCells::kMaxCorners));
    for (const uint64_t point : points) out.corners[corners++] = first_point + point;
    out.corner_begin.push_back(corners);
    out.faces.insert(out.faces.end(), faces.begin(), faces.end());
    out.face_begin.push_back(out.faces.size());
    for (const std::vector<float>& values : cells.scalars) out.cell_values.push_back(values[n]);
    if (!cells.volumes.empty()) out.volumes.push_back(cells.volumes[n]);
  }
  out.corners.resize(corners);
  out.at.resize(corners);
  out.corner_values.resize(corners * corner_fields_);
  return n;
}

void CornerGather::forEach(const std::function<void(const GatheredCells&)>& use) {
  UsedBeside used(use);
  std::vector<MeshRange> left = reader_->cellRanges();
  gatherByPages(left, used);
  if (!left.empty()) gatherByStreams(left, used);
  used.finish();
}

/// Makes a cell with a blanked corner degenerate: it takes part in nothing.
void CornerGather::dropIfBlanked(GatheredCells& cells, size_t n) {
  for (size_t corner = cells.corner_begin[n]; corner < cells.corner_begin[n + 1]; ++corner)
    if (std::isnan(cells.at[corner].x)) cells.shapes[n] = CellKind::kNone;
}

void CornerGather::gatherByPages(std::vector<MeshRange>& ranges, UsedBeside& used) {
  PointPages pages(*reader_, *numbers_, corner_fields_, memory_bytes_);
  size_t done = 0;  // ranges
  reader_->forEachCellsWhile(ranges, [&](const LoadedCells& loaded) {
    progress_->throwIfStopped();
    for (size_t begin = 0, end = 0; begin < loaded.cells.size(); begin = end) {
      const TraceScope trace("gather corners");
      GatheredCells& cells = used.next();
      end = gather(loaded, begin, cells);
      if (!pages.hold(cells.corners)) {
        ranges[done].first += begin;
        ranges[done].number += begin;
        ranges[done].count -= begin;
        return false;
      }
      parallelFor(tbb::blocked_range<size_t>(0, cells.size(), kGatheredPerTask),
                  [&](const tbb::blocked_range<size_t>& part) {
                    for (size_t n = part.begin(); n < part.end(); ++n) {
                      for (size_t at = cells.corner_begin[n]; at < cells.corner_begin[n + 1]; ++at) {
                        cells.at[at] = pages.at(cells.corners[at]);
                        std::copy_n(pages.values(cells.corners[at]), corner_fields_,
                                    cells.corner_values.data() + at * corner_fields_);
                        cells.corners[at] = pages.number(cells.corners[at]);
                      }
                      dropIfBlanked(cells, n);
                    }
                  });
      used.use();
    }
    progress_->advance(loaded.range.count);
    ++done;
    return true;
  });
  ranges.erase(ranges.begin(), ranges.begin() + static_cast<ptrdiff_t>(done));
}

void CornerGather::gatherByStreams(const std::vector<MeshRange>& of_cells, UsedBeside& used) {
  const bool merges = numbers_->merged() > 0;
  const size_t number_bytes = merges ? sizeof(uint64_t) : 0;
  const size_t point_bytes = number_bytes + sizeof(glm::dvec3) + corner_fields_ * sizeof(float);
  const size_t record_bytes = sizeof(uint64_t) + point_bytes;
  const uint64_t range_points = std::max<uint64_t>(1, memory_bytes_ / 4 / point_bytes);
  const uint64_t ranges = (reader_->points() + range_points - 1) / range_points;
  const uint64_t group_slots = std::max<uint64_t>(1, memory_bytes_ / 4 / (point_bytes + sizeof(uint64_t)));

  StreamsFile references(scratch_, ranges, memory_bytes_ / 4);
  std::vector<Group> groups(1);
  GatheredCells cells;
  reader_->forEachCells(of_cells, [&](const LoadedCells& loaded) {
    progress_->throwIfStopped();
    const uint64_t corners = cornersDrawn(loaded.cells);
    if (groups.back().slots > 0 && groups.back().slots + corners > group_slots)
      groups.push_back({{}, groups.back().first_slot + groups.back().slots, 0});
    Group& group = groups.back();
    uint64_t slot = group.first_slot + group.slots;
    for (size_t next = 0; next < loaded.cells.size();) {
      next = gather(loaded, next, cells);
      for (const uint64_t point : cells.corners)
        references.appendRecord(point / range_points, Reference{point, slot++});
    }
    group.ranges.push_back(loaded.range);
    group.slots += corners;
  });
  references.close();

  StreamsFile corners(scratch_, groups.size(), memory_bytes_ / 4);
  {
    std::vector<std::byte> points, record(record_bytes);
    std::vector<uint64_t> numbers;
    for (uint64_t range = 0; range < ranges; ++range) {
      const uint64_t first = range * range_points, count = std::min(range_points, reader_->points() - first);
      points.resize(count * point_bytes);
      reader_->readPoints(first, count, [&](const LoadedPoints& loaded) {
        progress_->throwIfStopped();
        std::byte* to = points.data() + (loaded.range.number - first) * point_bytes;
        if (merges) {
          numbers.resize(loaded.points.x.size());
          numbers_->read(loaded.range.number, numbers);
        }
        for (size_t n = 0; n < loaded.points.x.size(); ++n) {
          if (merges) std::memcpy(to, &numbers[n], number_bytes);
          to += number_bytes;
          const glm::dvec3 at(loaded.points.x[n], loaded.points.y[n], loaded.points.z[n]);
          std::memcpy(to, &at, sizeof at);
          to += sizeof at;
          for (size_t field = 0; field < corner_fields_; ++field, to += sizeof(float))
            std::memcpy(to, &loaded.points.scalars[field][n], sizeof(float));
        }
      });
      size_t group = 0;
      references.forEach(range, [&](std::span<const std::byte> records) {
        progress_->throwIfStopped();
        for (size_t at = 0; at < records.size(); at += sizeof(Reference)) {
          Reference reference;
          std::memcpy(&reference, records.data() + at, sizeof reference);
          // Slots rise within a range.
          while (reference.slot >= groups[group].first_slot + groups[group].slots) ++group;
          std::memcpy(record.data(), &reference.slot, sizeof reference.slot);
          std::memcpy(record.data() + sizeof reference.slot,
                      points.data() + (reference.point - first) * point_bytes, point_bytes);
          corners.append(group, record);
        }
      });
      references.forget(range);
    }
  }
  corners.close();

  std::vector<std::byte> slots;
  for (size_t number = 0; number < groups.size(); ++number) {
    const Group& group = groups[number];
    slots.resize(group.slots * point_bytes);
    corners.forEach(number, [&](std::span<const std::byte> records) {
      for (size_t at = 0; at < records.size(); at += record_bytes) {
        uint64_t slot;
        std::memcpy(&slot, records.data() + at, sizeof slot);
        std::memcpy(slots.data() + (slot - group.first_slot) * point_bytes, records.data() + at + sizeof slot,
                    point_bytes);
      }
    });
    corners.forget(number);
    size_t slot = 0;
    reader_->forEachCells(group.ranges, [&](const LoadedCells& loaded) {
      for (size_t next = 0; next < loaded.cells.size();) {
        const TraceScope trace("gather corners");
        GatheredCells& gathered = used.next();
        next = gather(loaded, next, gathered);
        for (size_t n = 0; n < gathered.corners.size(); ++n, ++slot) {
          const std::byte* from = slots.data() + slot * point_bytes;
          if (merges) std::memcpy(&gathered.corners[n], from, number_bytes);
          from += number_bytes;
          std::memcpy(static_cast<void*>(&gathered.at[n]), from, sizeof(glm::dvec3));
          if (corner_fields_ > 0)
            std::memcpy(&gathered.corner_values[n * corner_fields_], from + sizeof(glm::dvec3),
                        corner_fields_ * sizeof(float));
        }
        for (size_t n = 0; n < gathered.size(); ++n) dropIfBlanked(gathered, n);
        used.use();
      }
      progress_->advance(loaded.range.count);
    });
    CURVISPLAT_CHECK_OP(slot, ==, group.slots);
  }
}

}  // namespace curvisplat
