#include "preprocess/gather/cell_slopes.h"

#include <tbb/blocked_range.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "preprocess/gather/streams_file.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/memory.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kCellsPerTask = 256;
constexpr uint64_t kUsualFaces = 6;  // of a cell, each of which two cells have

struct BodyRecord {
  uint64_t cell;
  CellBody body;  // values follow
};

struct FaceRecord {
  HangingFaces::Face face;  // without half axes if there is no last_corner
  glm::dvec3 inward;
  uint64_t last_corner;  // by FaceList::lastOfQuad(); values follow
};

/// Cells of one range that share a face, by their places in it.
struct PairRecord {
  uint32_t first, second;
};

/// A neighbour that belongs to another range.
struct NeighbourRecord {
  uint64_t cell, neighbour;
  glm::dvec3 centre;  // of the neighbour; values follow
};

/// A neighbour that is larger or smaller; twice where the faces have two corners in common, and once more for another
/// pair of faces.
struct SideRecord {
  uint64_t cell, neighbour;
  CellSide side;  // values follow
};

/// Records of one size, with values behind each.
template <typename Record>
class RecordArray {
 public:
  explicit RecordArray(size_t fields) : stride_(sizeof(Record) + fields * sizeof(float)) {}

  void load(const StreamsFile& file, size_t stream) {
    bytes_.resize(file.bytes(stream));
    size_t at = 0;
    file.forEach(stream, [&](std::span<const std::byte> records) {
      std::memcpy(bytes_.data() + at, records.data(), records.size());
      at += records.size();
    });
  }
  size_t size() const { return bytes_.size() / stride_; }
  Record operator[](size_t n) const {
    Record record;
    std::memcpy(static_cast<void*>(&record), bytes_.data() + n * stride_, sizeof record);
    return record;
  }
  void values(size_t n, std::span<float> out) const {
    std::memcpy(out.data(), bytes_.data() + n * stride_ + sizeof(Record), out.size_bytes());
  }

 private:
  size_t stride_;
  std::vector<std::byte> bytes_;
};

template <typename Record>
Record recordIn(std::span<const std::byte> bytes) {
  Record record;
  std::memcpy(static_cast<void*>(&record), bytes.data(), sizeof record);
  return record;
}

template <typename Record>
void put(std::byte* to, const Record& record, std::span<const float> values) {
  std::memcpy(to, &record, sizeof record);
  std::memcpy(to + sizeof record, values.data(), values.size_bytes());
}

/// The cells of a range, each with those that it shares a face with.
class RangeOfCells {
 public:
  explicit RangeOfCells(size_t fields)
      : bodies_(fields), beside_(fields), other_sizes_(fields), fields_(fields) {}

  struct Streams {
    const StreamsFile &bodies, &pairs, &neighbours, &sides;
  };
  /// Cells [first_cell, first_cell + cells).
  void load(const Streams& streams, size_t range, uint64_t first_cell, uint64_t cells) {
    bodies_.load(streams.bodies, range);
    beside_.load(streams.neighbours, range);
    other_sizes_.load(streams.sides, range);
    places_.assign(cells, 0);
    for (size_t n = 0; n < bodies_.size(); ++n)
      places_[bodies_[n].cell - first_cell] = static_cast<uint32_t>(n);
    begins_.assign(bodies_.size() + 1, 0);
    const auto forEachEnd = [&](const auto& use) {
      forEachPair(streams.pairs, range, [&](uint32_t first, uint32_t second) {
        use(first, second);
        use(second, first);
      });
      for (size_t n = 0; n < beside_.size(); ++n)
        use(places_[beside_[n].cell - first_cell], static_cast<uint32_t>(bodies_.size() + n));
      for (size_t n = 0; n < other_sizes_.size(); ++n)
        use(places_[other_sizes_[n].cell - first_cell],
            static_cast<uint32_t>(bodies_.size() + beside_.size() + n));
    };
    forEachEnd([&](uint32_t body, uint32_t) { ++begins_[body + 1]; });
    for (size_t n = 1; n < begins_.size(); ++n) begins_[n] += begins_[n - 1];
    ends_.assign(begins_.begin(), begins_.end() - 1);
    neighbours_.resize(begins_.back());
    forEachEnd([&](uint32_t body, uint32_t neighbour) { neighbours_[ends_[body]++] = neighbour; });
  }

  size_t size() const { return bodies_.size(); }
  BodyRecord body(size_t n) const { return bodies_[n]; }
  void values(size_t n, std::span<float> out) const { bodies_.values(n, out); }
  /// The result of neighbours(): [neighbour] and [neighbour * fields + field].
  struct Neighbours {
    std::vector<glm::dvec3> steps;
    std::vector<float> values;
    std::vector<CellSide> sides;                       // at those that are larger or smaller
    std::vector<std::pair<uint64_t, uint32_t>> order;  // scratch: their numbers and places
  };
  /// The neighbours of cell n, in the order of their numbers. Any thread.
  void neighbours(size_t n, Neighbours& out) const {
    out.steps.clear();
    out.values.clear();
    out.sides.clear();
    out.order.clear();
    for (size_t at = begins_[n]; at < begins_[n + 1]; ++at)
      out.order.emplace_back(numberOf(neighbours_[at]), neighbours_[at]);
    std::sort(out.order.begin(), out.order.end(), [&](const auto& a, const auto& b) {
      return a.first != b.first ? a.first < b.first : isBefore(a.second, b.second);
    });
    const glm::dvec3 centre = bodies_[n].body.centre;
    for (size_t at = 0; at < out.order.size(); ++at) {
      const auto [number, neighbour] = out.order[at];
      const bool is_known = at > 0 && out.order[at - 1].first == number;
      if (neighbour >= firstSide()) {
        const CellSide side = other_sizes_[neighbour - firstSide()].side;
        const bool is_same = is_known && out.order[at - 1].second >= firstSide() &&
                             !isBefore(out.order[at - 1].second, neighbour);
        if (!is_same) out.sides.push_back(side);
        if (!is_known) addStep(other_sizes_, neighbour - firstSide(), side.neighbour - centre, out);
      } else if (neighbour >= bodies_.size()) {
        const size_t other = neighbour - bodies_.size();
        addStep(beside_, other, beside_[other].centre - centre, out);
      } else {
        addStep(bodies_, neighbour, bodies_[neighbour].body.centre - centre, out);
      }
    }
  }

 private:
  template <typename Use>
  void forEachPair(const StreamsFile& pairs, size_t range, const Use& use) const {
    pairs.forEach(range, [&](std::span<const std::byte> records) {
      for (size_t at = 0; at < records.size(); at += sizeof(PairRecord)) {
        const auto pair = recordIn<PairRecord>(records.subspan(at));
        use(places_[pair.first], places_[pair.second]);
      }
    });
  }
  template <typename Record>
  void addStep(const RecordArray<Record>& records, size_t n, const glm::dvec3& step, Neighbours& out) const {
    out.steps.push_back(step);
    out.values.resize(out.values.size() + fields_);
    records.values(n, std::span(out.values).last(fields_));
  }
  /// Places count the bodies, another range's records behind them, and the sides behind those.
  size_t firstSide() const { return bodies_.size() + beside_.size(); }
  uint64_t numberOf(size_t place) const {
    if (place < bodies_.size()) return bodies_[place].cell;
    return place < firstSide() ? beside_[place - bodies_.size()].neighbour
                               : other_sizes_[place - firstSide()].neighbour;
  }
  /// Orders the places of one neighbour: sides come last, by where they are, since memory decides how they come.
  bool isBefore(size_t a, size_t b) const {
    if (a < firstSide() || b < firstSide()) return a < b;
    const auto placeOf = [&](size_t n) {
      const CellSide side = other_sizes_[n - firstSide()].side;
      return std::array{side.face.x,    side.face.y,    side.face.z,
                        side.outward.x, side.outward.y, side.outward.z};
    };
    return placeOf(a) < placeOf(b);
  }

  RecordArray<BodyRecord> bodies_;
  RecordArray<NeighbourRecord> beside_;
  RecordArray<SideRecord> other_sizes_;
  const size_t fields_;
  std::vector<uint32_t> places_;         // [cell of the range], among the bodies
  std::vector<uint32_t> begins_, ends_;  // [body], in neighbours_
  std::vector<uint32_t> neighbours_;
};

FaceRecord recordOf(const GatheredCells& cells, const HalfFace& face, uint64_t last_corner,
                    const glm::dvec3& centre_of_cell) {
  FaceRecord record{{cells.numbers[face.cell], centre_of_cell, face.centre}, face.inward, last_corner};
  if (last_corner == FaceList::kNoCorner) return record;
  std::array<glm::dvec3, 4> at;
  for (size_t n = 0; n < at.size(); ++n) at[n] = cells.at[cells.corner_begin[face.cell] + face.corners[n]];
  record.face.half_axes = HangingFaces::halfAxes(at, face.inward);
  return record;
}

/// Sets the bodies of cells [begin, end).
void setBodies(const GatheredCells& cells, size_t begin, size_t end, std::span<CellBody> out) {
  for (size_t n = begin; n < end;) {
    if (cells.areFourAlike(n, end, 0)) {
      setBodiesOfFour(cells.viewsOfFour(n, 0), out.subspan(n, kCellsAtOnce));
      n += kCellsAtOnce;
      continue;
    }
    if (cells.shapes[n] != CellKind::kNone) out[n] = bodyOf(cells.view(n, 0));
    ++n;
  }
  for (size_t n = begin; n < end; ++n)
    if (const double volume = cells.volumeOf(n); volume > 0 && out[n].volume > 0) out[n].volume = volume;
}

}  // namespace

CellSlopes::CellSlopes(uint64_t cells, size_t fields, uint64_t memory_bytes, const ScratchFiles& scratch)
    : cells_(cells), fields_(fields), range_cells_(sharesOf(cells, fields, memory_bytes).range_cells) {
  const Shares shares = sharesOf(cells, fields, memory_bytes);
  const RecordBytes records = recordBytes(fields);
  const uint64_t ranges = std::max<uint64_t>(1, (cells + range_cells_ - 1) / range_cells_);
  bodies_ = std::make_unique<StreamsFile>(scratch, ranges, shares.body_bytes);
  pairs_ = std::make_unique<StreamsFile>(scratch, ranges, shares.pair_bytes);
  neighbours_ = std::make_unique<StreamsFile>(scratch, ranges, shares.neighbour_bytes);
  sides_ = std::make_unique<StreamsFile>(scratch, ranges, shares.side_bytes);
  hanging_ = std::make_unique<HangingFaces>(fields * sizeof(float), ranges,
                                            HangingFaces::Memory{shares.direction_bytes, shares.corner_bytes},
                                            scratch);
  planes_ = std::make_unique<OuterPlanes>(ranges, range_cells_, shares.plane_bytes, scratch);
  faces_ = std::make_unique<FaceMatcher>(records.face, cells * kUsualFaces, shares.face_bytes, scratch);
  neighbour_.resize(records.neighbour);
}

CellSlopes::RecordBytes CellSlopes::recordBytes(size_t fields) {
  const uint64_t value_bytes = fields * sizeof(float);
  return {sizeof(BodyRecord) + value_bytes,
          sizeof(FaceRecord) + value_bytes,
          sizeof(PairRecord),
          sizeof(NeighbourRecord) + value_bytes,
          HangingFaces::bytesOfCorner(value_bytes),
          sizeof(SideRecord) + value_bytes};
}

CellSlopes::Shares CellSlopes::sharesOf(uint64_t cells, size_t fields, uint64_t memory_bytes) {
  const RecordBytes records = recordBytes(fields);
  const uint64_t waiting =
      std::min(FaceMatcher::waitingBytes(records.face, cells * kUsualFaces), memory_bytes / 4);
  memory_bytes -= waiting;
  const uint64_t range_bytes = records.body + kUsualFaces * (records.neighbour + 3 * sizeof(uint64_t));
  Shares shares{};
  shares.body_bytes = memory_bytes / 8;
  shares.face_bytes = memory_bytes / 4;
  shares.pair_bytes = shares.neighbour_bytes = shares.plane_bytes = shares.side_bytes = memory_bytes / 16;
  shares.corner_bytes = memory_bytes / 32;
  // When directions are looked at, no face waits any more. Numbers of points are below eight times that of the cells,
  // even where each cell has points of its own.
  shares.direction_bytes = std::min(8 * cells, waiting + memory_bytes / 32);
  // Places in a range are of 32 bits.
  shares.range_cells = std::clamp<uint64_t>(memory_bytes / 2 / range_bytes, 1, uint64_t{1} << 26);
  return shares;
}

CellSlopes::~CellSlopes() = default;

void CellSlopes::add(const GatheredCells& cells) {
  of_cells_.resize(cells.size());
  parallelInvoke([&] { list_.assign(cells); },
                 [&] {
                   parallelFor(tbb::blocked_range<size_t>(0, cells.size(), kCellsPerTask),
                               [&](const tbb::blocked_range<size_t>& part) {
                                 setBodies(cells, part.begin(), part.end(), of_cells_);
                               });
                 });
  parallelInvoke([&] { addFaces(cells); }, [&] { addBodies(cells); });
}

void CellSlopes::addBodies(const GatheredCells& cells) {
  std::vector<std::byte> record(sizeof(BodyRecord) + fields_ * sizeof(float));
  for (size_t n = 0; n < cells.size(); ++n) {
    if (cells.shapes[n] == CellKind::kNone) continue;
    put(record.data(), BodyRecord{cells.numbers[n], of_cells_[n]}, valuesOf(cells, n));
    bodies_->append(cells.numbers[n] / range_cells_, record);
  }
}

void CellSlopes::addFaces(const GatheredCells& cells) {
  const auto cellOf = [&](size_t face) { return size_t{list_.places[face].cell}; };
  const auto tellOf = [&](uint64_t cell, size_t neighbour) {
    addNeighbour(cell, cells.numbers[neighbour], of_cells_[neighbour].centre,
                 std::as_bytes(valuesOf(cells, neighbour)));
  };
  faces_->add(list_.corners,
              {[&](size_t n, std::span<std::byte> to) {
                 const HalfFace face = list_.face(cells, n);
                 put(to.data(),
                     recordOf(cells, face, list_.lastOfQuad(cells, n), of_cells_[face.cell].centre),
                     valuesOf(cells, face.cell));
               },
               [&](size_t first, size_t second) {
                 if (cellOf(first) == cellOf(second) ||
                     joinInRange(cells.numbers[cellOf(first)], cells.numbers[cellOf(second)]))
                   return;
                 tellOf(cells.numbers[cellOf(first)], cellOf(second));
                 tellOf(cells.numbers[cellOf(second)], cellOf(first));
               },
               [&](std::span<const std::byte> first, size_t second) {
                 const FaceRecord earlier = recordIn<FaceRecord>(first);
                 const uint64_t cell = cells.numbers[cellOf(second)];
                 if (joinInRange(earlier.face.cell, cell)) return;
                 tellOf(earlier.face.cell, cellOf(second));
                 addNeighbour(cell, earlier.face.cell, earlier.face.centre_of_cell,
                              first.subspan(sizeof(FaceRecord)));
               }});
}

std::span<const float> CellSlopes::valuesOf(const GatheredCells& cells, size_t n) const {
  return std::span(cells.cell_values).subspan(n * fields_, fields_);
}

bool CellSlopes::joinInRange(uint64_t a, uint64_t b) {
  const uint64_t range = a / range_cells_;
  if (b / range_cells_ != range) return false;
  pairs_->appendRecord(
      range, PairRecord{static_cast<uint32_t>(a % range_cells_), static_cast<uint32_t>(b % range_cells_)});
  return true;
}

void CellSlopes::addNeighbour(uint64_t cell, uint64_t neighbour, const glm::dvec3& centre,
                              std::span<const std::byte> values) {
  const NeighbourRecord record{cell, neighbour, centre};
  std::memcpy(neighbour_.data(), &record, sizeof record);
  std::memcpy(neighbour_.data() + sizeof record, values.data(), values.size());
  neighbours_->append(cell / range_cells_, neighbour_);
}

void CellSlopes::makeSplats(size_t range, const TakeSplat& take, SlabCells slabs, PointSums::Counts& counts) {
  RangeOfCells cells(fields_);
  const uint64_t first_cell = range * range_cells_;
  {
    const TraceScope trace("load cells");
    cells.load({*bodies_, *pairs_, *neighbours_, *sides_}, range, first_cell,
               std::min(range_cells_, cells_ - first_cell));
  }
  const OuterPlanes::OfRange planes = planes_->load(range);
  std::atomic<uint64_t> splats = 0, degenerate = 0, halved = 0, hanging = 0;
  parallelFor(tbb::blocked_range<size_t>(0, cells.size(), 1024), [&](const tbb::blocked_range<size_t>& part) {
    NodeSplat splat;
    std::vector<SplatScalar> values(fields_);
    std::vector<float> own(fields_);
    RangeOfCells::Neighbours others;
    std::vector<OuterPlane> of_border;
    std::array<SlabHalf, 2> halves;
    uint64_t made = 0, flat = 0, cut = 0, fitted = 0;
    for (size_t n = part.begin(); n < part.end(); ++n) {
      const BodyRecord body = cells.body(n);
      cells.values(n, own);
      cells.neighbours(n, others);
      if (!(body.body.volume > 0)) ++flat;
      splatOfCell(body.cell, body.body, own, {others.steps, others.values, others.sides}, splat, values);
      planes.of(body.cell, of_border);
      fitted += std::erase_if(of_border, [&](const OuterPlane& plane) {
                  return std::ranges::any_of(others.sides,
                                             [&](const CellSide& side) { return side.face == plane.point; });
                }) > 0;
      const std::span<const OuterPlane> faces = of_border;
      ++made;
      if (slabs == SlabCells::kHalved && halveSlab(faces, splat, values, halves)) {
        ++cut;
        halves[1].splat.node += cells_;
        for (SlabHalf& half : halves) {
          half.splat.border_code = meshBorderCode(half.planes, half.splat.splat, kNextOfCells);
          take(half.splat, half.values);
        }
        continue;
      }
      splat.border_code = meshBorderCode(faces, splat.splat, kNextOfCells);
      take(splat, values);
    }
    splats += made + cut;
    degenerate += flat;
    halved += cut;
    hanging += fitted;
  });
  counts.splats += splats;
  counts.degenerate += degenerate;
  counts.halved += halved;
  counts.hanging += hanging;
}

PointSums::Counts CellSlopes::finish(const TakeSplat& take, SlabCells slabs, HangingNodes hanging,
                                     const Progress& progress) {
  list_ = {};
  freeMemory(of_cells_);
  bodies_->close();
  const auto join = [&](std::span<const std::byte> first, std::span<const std::byte> second) {
    const HangingFaces::Face a = recordIn<FaceRecord>(first).face, b = recordIn<FaceRecord>(second).face;
    if (a.cell == b.cell || joinInRange(a.cell, b.cell)) return;
    addNeighbour(a.cell, b.cell, b.centre_of_cell, second.subspan(sizeof(FaceRecord)));
    addNeighbour(b.cell, a.cell, a.centre_of_cell, first.subspan(sizeof(FaceRecord)));
  };
  const auto ifQuad = [&](const FaceCorners& lowest, std::span<const std::byte> bytes, const auto& use) {
    const auto record = recordIn<FaceRecord>(bytes);
    if (hanging == HangingNodes::kFitted && record.last_corner != FaceList::kNoCorner)
      use(HangingFaces::Corners{lowest[0], lowest[1], lowest[2], record.last_corner}, record.face);
  };
  faces_->finish(
      join,
      [&](const FaceCorners& lowest, std::span<const std::byte> bytes) {
        const auto record = recordIn<FaceRecord>(bytes);
        planes_->add(record.face.cell, {record.inward, record.face.centre, true});
        ifQuad(lowest, bytes, [&](const auto& corners, const auto& face) { hanging_->look(corners, face); });
      },
      progress);
  if (hanging_->mayHang())
    faces_->finish([](std::span<const std::byte>, std::span<const std::byte>) {},
                   [&](const FaceCorners& lowest, std::span<const std::byte> bytes) {
                     ifQuad(lowest, bytes, [&](const auto& corners, const auto& face) {
                       hanging_->add(corners, face, bytes.subspan(sizeof(FaceRecord)));
                     });
                   },
                   progress);
  faces_.reset();
  std::vector<std::byte> record(sizeof(SideRecord));
  hanging_->finish(
      [&](const HangingFaces::Face& face, const HangingFaces::Face& other,
          std::span<const std::byte> values) {
        const glm::dvec3 inward = face.inward();
        const double area = glm::length(inward), shared = std::min(area, glm::length(other.inward()));
        const glm::dvec3 outward = -shared / area * inward;
        const SideRecord side{face.cell, other.cell, {outward, face.centre, other.centre_of_cell}};
        record.resize(sizeof side);
        std::memcpy(record.data(), &side, sizeof side);
        record.insert(record.end(), values.begin(), values.end());
        sides_->append(face.cell / range_cells_, record);
      },
      progress);
  hanging_.reset();
  sides_->close();
  pairs_->close();
  neighbours_->close();
  planes_->close();
  PointSums::Counts counts;
  for (size_t range = 0; range < bodies_->streams(); ++range) {
    progress.throwIfStopped();
    makeSplats(range, take, slabs, counts);
    bodies_->forget(range);
    pairs_->forget(range);
    neighbours_->forget(range);
    sides_->forget(range);
  }
  return counts;
}

}  // namespace curvisplat
