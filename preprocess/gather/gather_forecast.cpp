#include "preprocess/gather/gather_forecast.h"

#include <algorithm>
#include <cmath>

#include "preprocess/gather/face_matcher.h"
#include "preprocess/gather/outer_planes.h"
#include "preprocess/gather/point_numbers.h"
#include "preprocess/gather/point_pages.h"
#include "preprocess/gather/streams_file.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxFollowed = uint64_t{1} << 19;
constexpr uint64_t kCornersOfQuad = 4;

/// Returns an upper bound of the CellSides of quads that have `corners` corners together. There are most where a large face meets two
/// small ones: these three quads have eight.
uint64_t sidesOf(uint64_t corners) {
  return 8 * corners / (3 * kCornersOfQuad);
}

}  // namespace

WaitingFaces::WaitingFaces(uint64_t faces, uint64_t range_cells) : range_cells_(range_cells) {
  while (faces >> share_ > 2 * kMaxFollowed) ++share_;
  most_waiting_ = std::max(FaceMatcher::kMaxWaiting >> share_, uint32_t{1});
}

void WaitingFaces::add(const GatheredCells& cells) {
  list_.assign(cells);
  for (size_t n = 0; n < list_.corners.size(); ++n) {
    if (const uint64_t last = list_.lastOfQuad(cells, n); last != FaceList::kNoCorner)
      addQuad(list_.corners[n], last);
    if (!follows(list_.corners[n][0])) continue;
    const uint32_t cell = list_.places[n].cell;
    const uint64_t corners =
        std::min<uint64_t>(cells.cornersOfCell(cell).size(), PointBorders::kMaxPlanesOfFace);
    add(list_.corners[n], cells.numbers[cell], static_cast<uint32_t>(corners));
  }
}

void WaitingFaces::add(const FaceCorners& corners, uint64_t cell, uint32_t corners_of_cell) {
  const auto same = open_.find(corners);
  if (same == open_.end()) {
    const uint32_t entry = newEntry({corners, false});
    open_[corners] = {cell, entry, corners_of_cell};
    return;
  }
  const Seen first = same->second;
  open_.erase(same);
  Counts::Pairs& pairs = first.entry == kSpilled ? counts_.found_late : counts_.found;
  ++(first.cell / range_cells_ == cell / range_cells_ ? pairs.in_range : pairs.across);
  if (first.entry == kSpilled) {
    ++counts_.spilled;
    newEntry({corners, true});
  } else {
    free_.push_back(first.entry);
  }
}

void WaitingFaces::addQuad(const FaceCorners& corners, uint64_t last_corner) {
  if (!std::ranges::any_of(corners, [&](uint64_t corner) { return followsQuads(corner); }) &&
      !followsQuads(last_corner))
    return;
  const auto [same, is_new] = open_quads_.emplace(corners, last_corner);
  if (!is_new) open_quads_.erase(same);
}

/// Counts corners of quads at points where many meet. At the surface of a mesh, three to five do; where cells of two
/// sizes meet, those of the larger cells do, and those of the smaller ones.
void WaitingFaces::countHanging(Counts& counts) const {
  constexpr uint64_t kMany = 6;
  std::unordered_map<uint64_t, uint64_t> at_points;
  uint64_t corners_of_quads = 0;
  const auto use = [&](uint64_t corner) {
    if (!followsQuads(corner)) return;
    ++corners_of_quads;
    ++at_points[corner];
  };
  for (const auto& [corners, last] : open_quads_) {
    for (const uint64_t corner : corners) use(corner);
    use(last);
  }
  for (const auto& [point, quads] : at_points)
    if (quads >= kMany) counts.hanging += quads << kShareOfQuads;
  counts.sides = std::min(counts.hanging, sidesOf(corners_of_quads << kShareOfQuads));
}

uint32_t WaitingFaces::newEntry(const Entry& entry) {
  uint32_t place = next_to_spill_;
  if (!free_.empty()) {
    place = free_.back();
    free_.pop_back();
  } else if (waiting_.size() < most_waiting_) {
    place = static_cast<uint32_t>(waiting_.size());
    waiting_.emplace_back();
  } else {
    next_to_spill_ = (next_to_spill_ + 1) % most_waiting_;
    if (!waiting_[place].is_second) {
      open_[waiting_[place].corners].entry = kSpilled;
      ++counts_.spilled;
    }
  }
  waiting_[place] = entry;
  return place;
}

WaitingFaces::Counts WaitingFaces::counts() const {
  Counts counts = counts_;
  for (const auto& [corners, seen] : open_) {
    if (seen.entry != kSpilled) ++counts.spilled;
    ++counts.outer;
    counts.corners_of_outer += seen.corners;
  }
  countHanging(counts);
  for (uint64_t* const count :
       {&counts.spilled, &counts.outer, &counts.corners_of_outer, &counts.hanging, &counts.sides,
        &counts.found.in_range, &counts.found.across, &counts.found_late.in_range, &counts.found_late.across})
    *count <<= share_;
  return counts;
}

namespace {

constexpr size_t kSampledChunks = 8;

uint64_t ceilDivided(uint64_t a, uint64_t b) {
  return (a + b - 1) / std::max<uint64_t>(1, b);
}

/// Some of the chunks, spread over the mesh.
std::vector<MeshRange> sampleOf(const std::vector<MeshRange>& ranges) {
  if (ranges.size() <= kSampledChunks) return ranges;
  std::vector<MeshRange> sample;
  for (size_t n = 0; n < kSampledChunks; ++n) sample.push_back(ranges[n * ranges.size() / kSampledChunks]);
  return sample;
}

uint64_t countFaces(const MeshCells& cells, size_t n) {
  const std::span<const uint32_t> faces = facesOf(cells.shapes[n], cells.facesOfCell(n));
  uint64_t count = 0;
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}) ++count;
  return count;
}

/// The counts of some chunks.
struct Sample {
  uint64_t cells = 0, drawn = 0, corners = 0, face_words = 0, faces = 0, chunk_bytes = 0;
};

Sample sampled(const MeshReader& reader, const GatherJob& job) {
  Sample sample;
  reader.forEachCells(sampleOf(reader.cellRanges()), [&](const LoadedCells& loaded) {
    const MeshCells& cells = loaded.cells;
    const uint64_t values = job.centring == Centring::kCell ? job.fields * sizeof(float) : 0;
    sample.chunk_bytes = std::max(sample.chunk_bytes, bytesOf(cells) + values * cells.size());
    sample.cells += cells.size();
    for (size_t n = 0; n < cells.size(); ++n) {
      if (cells.shapes[n] == CellKind::kNone) continue;
      ++sample.drawn;
      sample.corners += cells.cornersOfCell(n).size();
      sample.face_words += cells.facesOfCell(n).size();
      sample.faces += countFaces(cells, n);
    }
  });
  return sample;
}

/// Follows the cells through the pages of points and of sums.
class Followed {
 public:
  Followed(const MeshReader& reader, GatherCounts& counts, uint64_t faces)
      : counts_(&counts),
        points_(reader.points()),
        point_slots_(PointPages::slotsFor(reader.points(), counts.cornerFields(), counts.half(),
                                          counts.mergesPoints())),
        sum_slots_(reader.points(), SumPages::kShift, counts.sums().pages),
        faces_(faces, counts.slopes().range_cells) {
    uint64_t points = 0;
    for (const MeshPiece& piece : reader.pieces()) {
      first_points_.push_back(points);
      points += piece.points;
    }
  }

  void add(const LoadedCells& loaded) {
    const MeshCells& cells = loaded.cells;
    const uint64_t first_point = first_points_[loaded.range.piece];
    some_.clear();
    for (size_t n = 0; n < cells.size(); ++n) {
      if (cells.shapes[n] == CellKind::kNone) continue;
      const std::span<const uint64_t> corners = cells.cornersOfCell(n);
      const std::span<const uint32_t> faces = cells.facesOfCell(n);
      if (!batch_.empty() && (batch_corners_.size() + corners.size() > GatheredCells::kMaxCorners ||
                              batch_words_ + faces.size() > GatheredCells::kMaxCorners))
        endBatch();
      bool followed = false;
      for (const uint64_t corner : corners) {
        batch_corners_.push_back(first_point + corner);
        followed |= faces_.follows(first_point + corner);
      }
      batch_.push_back({corners.size(), faces.size()});
      batch_words_ += faces.size();
      if (followed) append(loaded, n);
    }
    endBatch();
    faces_.add(some_);
  }

  void finish() {
    counts_->faces = faces_.counts();
    if (counts_->job().centring == Centring::kNode) sumUp();
  }

 private:
  struct Cell {
    size_t corners, face_words;
  };

  void append(const LoadedCells& loaded, size_t n) {
    const MeshCells& cells = loaded.cells;
    const std::span<const uint32_t> faces = cells.facesOfCell(n);
    some_.numbers.push_back(loaded.range.number + n);
    some_.shapes.push_back(cells.shapes[n]);
    for (const uint64_t corner : cells.cornersOfCell(n))
      some_.corners.push_back(first_points_[loaded.range.piece] + corner);
    some_.corner_begin.push_back(some_.corners.size());
    some_.faces.insert(some_.faces.end(), faces.begin(), faces.end());
    some_.face_begin.push_back(some_.faces.size());
  }

  /// Counts a batch as CornerGather and PointSums would treat its cells.
  void endBatch() {
    counts_->cells += batch_.size();
    counts_->corners += batch_corners_.size();
    counts_->face_words += batch_words_;
    if (!streamed_ && point_slots_.hold(batch_corners_, PointPages::kMaxAgain))
      point_slots_.place();
    else
      streamed_ = true;
    if (streamed_) counts_->streamed_corners += batch_corners_.size();
    if (counts_->job().centring == Centring::kNode) endBatchOfSums();
    batch_.clear();
    batch_corners_.clear();
    batch_words_ = 0;
  }

  void endBatchOfSums() {
    if (!waiting_ && sum_slots_.hold(batch_corners_, SumPages::kMaxAgain)) {
      for (const PageSlots::Left& left : sum_slots_.place()) write(left.page);
      return;
    }
    if (!waiting_) {
      for (uint64_t page = 0; page < sum_slots_.pages(); ++page)
        if (sum_slots_.slotOf(page) != PageSlots::kNone) {
          write(page);
          sum_slots_.leave(page);
        }
      waiting_ = true;
    }
    size_t at = 0;
    for (const Cell& cell : batch_) {
      ranges_.clear();
      for (size_t n = 0; n < cell.corners; ++n)
        ranges_.push_back(batch_corners_[at++] / counts_->sums().range_points);
      std::sort(ranges_.begin(), ranges_.end());
      const auto ranges =
          static_cast<uint64_t>(std::unique(ranges_.begin(), ranges_.end()) - ranges_.begin());
      counts_->waiting_bytes +=
          ranges * PointSums::bytesOfWaiting(cell.corners, cell.face_words, counts_->job().fields);
    }
  }

  void sumUp() {
    const uint64_t pages = sum_slots_.pages();
    const uint64_t of_range = counts_->sums().range_points / SumPages::kPoints;
    sum_slots_.setMost(std::min(of_range, pages));
    for (uint64_t first = 0; first < pages; first += of_range) {
      const uint64_t end = std::min(first + of_range, pages);
      sum_slots_.wantPages(first, end);
      for (const PageSlots::Left& left : sum_slots_.place()) write(left.page);
      for (uint64_t page = first; page < end; ++page) sum_slots_.leave(page);
    }
  }

  void write(uint64_t page) {
    const size_t fields = counts_->job().fields;
    const uint64_t end = std::min((page + 1) * SumPages::kPoints, points_);
    counts_->sum_file_bytes =
        std::max(counts_->sum_file_bytes, end * SumPages::bytesOfPoint(fields, momentCount(fields)));
  }

  GatherCounts* counts_;
  const uint64_t points_;
  std::vector<uint64_t> first_points_;  // [piece]
  PageSlots point_slots_, sum_slots_;
  bool streamed_ = false, waiting_ = false;
  WaitingFaces faces_;
  std::vector<Cell> batch_;
  std::vector<uint64_t> batch_corners_, ranges_;
  uint64_t batch_words_ = 0;
  GatheredCells some_;
};

}  // namespace

GatherCounts::GatherCounts(const MeshReader& reader, const GatherJob& job, uint64_t chunk_bytes)
    : job_(job),
      points_(reader.points()),
      all_cells_(reader.cells()),
      half_(halfBesideChunks(job.memory_bytes, chunk_bytes)),
      pieces_(reader.pieces().size()),
      merges_points_(PointNumbers::mayMerge(reader)),
      sums_(PointSums::sharesOf(reader.cells(), job.fields, half_)),
      slopes_(CellSlopes::sharesOf(reader.cells(), job.fields, half_)) {}

uint64_t GatherCounts::ofCorners() const {
  const uint64_t point_bytes =
      sizeof(glm::dvec3) + cornerFields() * sizeof(float) + (merges_points_ ? sizeof(uint64_t) : 0);
  const uint64_t record_bytes = point_bytes + sizeof(uint64_t), memory_bytes = half_ / 4;
  const uint64_t ranges = ceilDivided(points_, memory_bytes / point_bytes);
  const uint64_t groups = streamed_corners / std::max<uint64_t>(1, memory_bytes / record_bytes) + 1;
  return StreamsFile::bytesInFile(streamed_corners * 2 * sizeof(uint64_t), ranges, memory_bytes) +
         StreamsFile::bytesInFile(streamed_corners * record_bytes, groups, memory_bytes);
}

GatherNeeds GatherCounts::needs() const {
  GatherNeeds needs = job_.centring == Centring::kNode ? needsOfPoints() : needsOfCells();
  if (!merges_points_) return needs;
  const uint64_t numbering_bytes = points_ * PointNumbers::kMaxBytes;
  const uint64_t kept_bytes = points_ * PointNumbers::kKeptBytes;
  needs.beside_splats += kept_bytes;
  needs.before_splats = std::max(needs.before_splats + kept_bytes,
                                 StreamsFile::bytesInFile(numbering_bytes, 1, job_.memory_bytes / 8));
  return needs;
}

GatherNeeds GatherCounts::needsOfPoints() const {
  GatherNeeds needs;
  const uint64_t ranges = ceilDivided(points_, sums_.range_points);
  const uint64_t planes_bytes = faces.corners_of_outer * OuterPlanes::bytesOfPlane();
  const uint64_t spilled_bytes = faces.spilled * FaceMatcher::spilledBytes(PointBorders::faceBytes());
  const uint64_t border_bytes = sums_.border_bytes / 2;
  needs.splats = points_;
  const uint64_t summed = sum_file_bytes +
                          StreamsFile::bytesInFile(waiting_bytes, ranges, sums_.cell_bytes()) +
                          StreamsFile::bytesInFile(spilled_bytes, 1, FaceMatcher::streamBytes(border_bytes));
  needs.beside_splats = summed + StreamsFile::bytesInFile(planes_bytes, ranges, border_bytes);
  needs.before_splats = std::max(summed + ofCorners(), needs.beside_splats);
  return needs;
}

/// The corners of outer faces that HangingFaces takes for opposite because several points share its memory.
uint64_t GatherCounts::takenForHanging() const {
  if (points_ <= slopes_.direction_bytes) return 0;
  const auto points = static_cast<double>(points_), places = static_cast<double>(slopes_.direction_bytes);
  const auto outer = static_cast<double>(faces.outer);
  constexpr double kOpposite = 0.5;  // the share of all points, in a mesh of one layer
  const double others = (points / places - 1) * std::min(1.0, outer / points);
  return static_cast<uint64_t>(kCornersOfQuad * std::min(1.0, kOpposite * others) * outer);
}

GatherNeeds GatherCounts::needsOfCells() const {
  const CellSlopes::RecordBytes records = CellSlopes::recordBytes(job_.fields);
  const uint64_t ranges = ceilDivided(all_cells_, slopes_.range_cells);
  const auto inFile = [&](uint64_t bytes, uint64_t memory_bytes) {
    return StreamsFile::bytesInFile(bytes, ranges, memory_bytes);
  };
  const auto ofPairs = [&](const WaitingFaces::Counts::Pairs& pairs) {
    return inFile(pairs.in_range * records.pair, slopes_.pair_bytes) +
           inFile(2 * pairs.across * records.neighbour, slopes_.neighbour_bytes);
  };
  const uint64_t bodies = inFile(cells * records.body, slopes_.body_bytes);
  const uint64_t spilled_bytes = faces.spilled * FaceMatcher::spilledBytes(records.face);
  const uint64_t spilled =
      StreamsFile::bytesInFile(spilled_bytes, 1, FaceMatcher::streamBytes(slopes_.face_bytes));
  const WaitingFaces::Counts::Pairs all{faces.found.in_range + faces.found_late.in_range,
                                        faces.found.across + faces.found_late.across};
  GatherNeeds needs;
  needs.splats = cells + std::min(cells, faces.outer / 2);
  const uint64_t matched =
      bodies + ofPairs(all) + inFile(faces.outer * OuterPlanes::bytesOfPlane(), slopes_.plane_bytes);
  const uint64_t at_corners = HangingFaces::bytesInFile((faces.hanging + takenForHanging()) * records.corner,
                                                        ranges, slopes_.corner_bytes);
  needs.beside_splats = matched + inFile(faces.sides * records.side, slopes_.side_bytes);
  // The last faces are matched before the first splat; then those of other sizes are found.
  needs.before_splats = std::max({spilled + bodies + ofPairs(faces.found) + ofCorners(),
                                  spilled + matched + at_corners, needs.beside_splats + at_corners});
  return needs;
}

void GatherCounts::joinPieces() {
  // Seen by itself, a piece ends where the next one begins. What is left is the outside of a body that is up
  // to twice as long as wide; unless the mesh is a layer of one cell.
  const double most = 12 * std::pow(static_cast<double>(cells), 2.0 / 3);
  const auto outer = static_cast<double>(faces.outer);
  if (pieces_ < 2 || 2 * faces.outer > cells || outer <= most) return;
  faces.found_late.across += static_cast<uint64_t>((outer - most) / 2);
  faces.corners_of_outer = static_cast<uint64_t>(static_cast<double>(faces.corners_of_outer) * most / outer);
  faces.outer = static_cast<uint64_t>(most);
}

GatherNeeds boundOfGather(const MeshReader& reader, const GatherJob& job) {
  const Sample sample = sampled(reader, job);
  GatherCounts counts(reader, job, sample.chunk_bytes);
  // A tenth more: the cells between those that were read may be larger.
  const auto ofMesh = [&](uint64_t of_sample) {
    return static_cast<uint64_t>(std::ceil(1.1 * static_cast<double>(of_sample) /
                                           static_cast<double>(std::max<uint64_t>(1, sample.cells)) *
                                           static_cast<double>(reader.cells())));
  };
  const uint64_t corners_of_cell = ceilDivided(sample.corners, sample.drawn);
  const uint64_t words_of_cell = ceilDivided(sample.face_words, sample.drawn);
  counts.cells = reader.cells();
  counts.corners = counts.streamed_corners = ofMesh(sample.corners);
  counts.waiting_bytes = ofMesh(sample.drawn) * corners_of_cell *
                         PointSums::bytesOfWaiting(corners_of_cell, words_of_cell, job.fields);
  counts.sum_file_bytes = reader.points() * SumPages::bytesOfPoint(job.fields, momentCount(job.fields));
  counts.faces.spilled = counts.faces.outer = counts.faces.found.across = ofMesh(sample.faces);
  counts.faces.hanging = kCornersOfQuad * counts.faces.outer;
  counts.faces.sides = sidesOf(counts.faces.hanging);
  counts.faces.corners_of_outer =
      counts.faces.outer * std::min(corners_of_cell, PointBorders::kMaxPlanesOfFace);
  return counts.needs();
}

GatherNeeds forecastOfGather(const MeshReader& reader, const GatherJob& job, const Progress& progress) {
  const Sample sample = sampled(reader, job);
  GatherCounts counts(reader, job, sample.chunk_bytes);
  const uint64_t faces = ceilDivided(sample.faces, std::max<uint64_t>(1, sample.cells)) * reader.cells();
  Followed followed(reader, counts, faces);
  reader.forEachCells([&](const LoadedCells& loaded) {
    progress.throwIfStopped();
    followed.add(loaded);
  });
  followed.finish();
  counts.joinPieces();
  return counts.needs();
}

}  // namespace curvisplat
