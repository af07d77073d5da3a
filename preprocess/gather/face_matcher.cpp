#include "preprocess/gather/face_matcher.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_sort.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include "preprocess/grid/parallel.h"
#include "stream/base/memory.h"

namespace curvisplat {
namespace {

constexpr size_t kRecordsPerTask = 512;

uint64_t hashOf(const FaceCorners& corners) {
  uint64_t hash = 0;
  for (const uint64_t corner : corners) {
    hash ^= corner;
    hash *= 0x9e3779b97f4a7c15;
    hash ^= hash >> 29;
  }
  return hash;
}

bool areSame(const FaceCorners& a, const FaceCorners& b) {
  return ((a[0] ^ b[0]) | (a[1] ^ b[1]) | (a[2] ^ b[2])) == 0;
}

}  // namespace

FaceMatcher::FaceMatcher(size_t record_bytes, uint64_t faces, uint64_t memory_bytes, ScratchFiles scratch)
    : record_bytes_(record_bytes) {
  const uint64_t most = std::min<uint64_t>(std::max<uint64_t>(faces, 1), kMaxWaiting);
  buckets_.assign(std::bit_ceil(2 * most), kNone);
  // A stream is sorted in memory.
  const uint64_t bytes = faces * (sizeof(FaceCorners) + record_bytes + 2 * sizeof(uint64_t));
  const uint64_t streams = bytes / std::max<uint64_t>(1, memory_bytes / 2) + 1;
  spilled_ = std::make_unique<StreamsFile>(
      std::move(scratch), std::min<uint64_t>(streams, StreamsFile::mostStreams(streamBytes(memory_bytes))),
      streamBytes(memory_bytes));
  scratch_.resize(sizeof(FaceCorners) + record_bytes);
}

FaceMatcher::~FaceMatcher() = default;

uint64_t FaceMatcher::waitingBytes(size_t record_bytes, uint64_t faces) {
  return std::min<uint64_t>(faces, kMaxWaiting) * (sizeof(Waiting) + record_bytes + 6 * sizeof(uint32_t));
}

uint64_t FaceMatcher::bucketOf(const FaceCorners& corners) const {
  return hashOf(corners) & (buckets_.size() - 1);
}

void FaceMatcher::unlink(uint32_t entry) {
  uint32_t* link = &buckets_[bucketOf(waiting_[entry].corners)];
  while (*link != entry) link = &waiting_[*link].next;
  *link = waiting_[entry].next;
  waiting_[entry].face = kNone;
}

void FaceMatcher::spill(uint32_t entry) {
  const FaceCorners& corners = waiting_[entry].corners;
  std::memcpy(scratch_.data(), &corners, sizeof corners);
  std::memcpy(scratch_.data() + sizeof corners, recordOf(entry).data(), record_bytes_);
  spilled_->append(spilled_->streams() > 1 ? (hashOf(corners) >> 32) % spilled_->streams() : 0, scratch_);
}

uint32_t FaceMatcher::newEntry(const FaceCalls& calls) {
  if (!free_.empty()) {
    const uint32_t entry = free_.back();
    free_.pop_back();
    return entry;
  }
  if (waiting_.size() < kMaxWaiting) {
    waiting_.emplace_back();
    records_.resize(records_.size() + record_bytes_);
    return static_cast<uint32_t>(waiting_.size() - 1);
  }
  const uint32_t entry = next_to_spill_;
  next_to_spill_ = (next_to_spill_ + 1) % kMaxWaiting;
  if (waiting_[entry].face != kHasRecord) calls.put(waiting_[entry].face, recordOf(entry));
  spill(entry);
  unlink(entry);
  return entry;
}

/// Doubles the table for cells with more faces than was expected, such as polyhedra of thousands.
void FaceMatcher::growTable() {
  buckets_.assign(2 * buckets_.size(), kNone);
  for (uint32_t entry = 0; entry < waiting_.size(); ++entry) {
    if (waiting_[entry].face == kNone) continue;
    uint32_t& bucket = buckets_[bucketOf(waiting_[entry].corners)];
    waiting_[entry].next = std::exchange(bucket, entry);
  }
}

void FaceMatcher::add(std::span<const FaceCorners> faces, const FaceCalls& calls) {
  constexpr size_t kAhead = 8;  // faces whose places in the table are fetched before they are looked up
  taken_.clear();
  for (size_t n = 0; n < faces.size(); ++n) {
    if (n + 2 * kAhead < faces.size()) __builtin_prefetch(&buckets_[bucketOf(faces[n + 2 * kAhead])]);
    if (n + kAhead < faces.size()) {
      const uint32_t entry = buckets_[bucketOf(faces[n + kAhead])];
      if (entry != kNone) __builtin_prefetch(&waiting_[entry]);
    }
    if (waiting_.size() > buckets_.size()) growTable();
    const FaceCorners& corners = faces[n];
    const uint64_t bucket = bucketOf(corners);
    uint32_t same = buckets_[bucket];
    while (same != kNone && !areSame(waiting_[same].corners, corners)) same = waiting_[same].next;
    if (same != kNone) {
      const uint32_t face = waiting_[same].face;
      if (face == kHasRecord) {
        if (calls.pair_with_earlier) calls.pair_with_earlier(recordOf(same), n);
      } else if (calls.pair) {
        calls.pair(face, n);
      }
      unlink(same);
      free_.push_back(same);
      continue;
    }
    const uint32_t entry = newEntry(calls);
    waiting_[entry] = {corners, buckets_[bucket], static_cast<uint32_t>(n)};
    buckets_[bucket] = entry;
    taken_.emplace_back(entry, static_cast<uint32_t>(n));
  }
  makeRecords(calls);
}

/// Makes records of the faces that were added and still wait.
void FaceMatcher::makeRecords(const FaceCalls& calls) {
  std::erase_if(taken_, [&](const auto& taken) { return waiting_[taken.first].face != taken.second; });
  parallelFor(tbb::blocked_range<size_t>(0, taken_.size(), kRecordsPerTask),
              [&](const tbb::blocked_range<size_t>& part) {
                for (size_t n = part.begin(); n < part.end(); ++n) {
                  const auto [entry, face] = taken_[n];
                  calls.put(face, recordOf(entry));
                  waiting_[entry].face = kHasRecord;
                }
              });
}

void FaceMatcher::matchStream(size_t stream, const TakePair& pair, const TakeSingle& single) const {
  const size_t stride = sizeof(FaceCorners) + record_bytes_;
  std::vector<std::byte> bytes(spilled_->bytes(stream));
  size_t end = 0;
  spilled_->forEach(stream, [&](std::span<const std::byte> records) {
    std::memcpy(bytes.data() + end, records.data(), records.size());
    end += records.size();
  });
  const auto cornersAt = [&](size_t n) {
    FaceCorners corners;
    std::memcpy(&corners, bytes.data() + n * stride, sizeof corners);
    return corners;
  };
  const auto recordAt = [&](size_t n) {
    return std::span<const std::byte>(bytes).subspan(n * stride + sizeof(FaceCorners), record_bytes_);
  };
  std::vector<std::pair<uint64_t, size_t>> keys(bytes.size() / stride);  // hash, record
  for (size_t n = 0; n < keys.size(); ++n) keys[n] = {hashOf(cornersAt(n)), n};
  tbb::parallel_sort(keys.begin(), keys.end());
  std::vector<std::pair<FaceCorners, size_t>> same_hash;
  for (size_t first = 0; first < keys.size();) {
    size_t last = first + 1;
    while (last < keys.size() && keys[last].first == keys[first].first) ++last;
    same_hash.clear();  // other faces may have the same hash
    for (size_t n = first; n < last; ++n) same_hash.emplace_back(cornersAt(keys[n].second), keys[n].second);
    if (same_hash.size() > 2) std::sort(same_hash.begin(), same_hash.end());
    for (size_t n = 0; n < same_hash.size();) {
      if (n + 1 < same_hash.size() && same_hash[n].first == same_hash[n + 1].first) {
        pair(recordAt(same_hash[n].second), recordAt(same_hash[n + 1].second));
        n += 2;
      } else {
        single(same_hash[n].first, recordAt(same_hash[n].second));
        ++n;
      }
    }
    first = last;
  }
}

void FaceMatcher::finish(const TakePair& pair, const TakeSingle& single, const Progress& progress) {
  for (uint32_t entry = 0; entry < waiting_.size(); ++entry)
    if (waiting_[entry].face != kNone) spill(entry);
  freeMemory(free_);
  freeMemory(taken_);
  freeMemory(buckets_);
  freeMemory(waiting_);
  freeMemory(records_);
  spilled_->close();
  for (size_t stream = 0; stream < spilled_->streams(); ++stream) {
    progress.throwIfStopped();
    matchStream(stream, pair, single);
  }
}

void FaceMatcher::forget() {
  for (size_t stream = 0; stream < spilled_->streams(); ++stream) spilled_->forget(stream);
}

namespace {

constexpr size_t kMatchedPerTask = 256, kManyCorners = 64;
constexpr FaceCorners kCollapsed{UINT64_MAX, UINT64_MAX, UINT64_MAX};

bool areDifferent(std::span<const uint64_t> corners) {
  bool any_same = false;
  for (size_t a = 1; a < corners.size(); ++a)
    for (size_t b = 0; b < a; ++b) any_same |= corners[a] == corners[b];
  return !any_same;
}

void sortPair(uint64_t& a, uint64_t& b) {
  const uint64_t lower = std::min(a, b), upper = std::max(a, b);
  a = lower;
  b = upper;
}

/// The lowest three of the three or four different corners of a plain cell's face.
FaceCorners lowestOfPlain(std::span<const uint64_t> corners, std::span<const uint32_t> face) {
  FaceCorners lowest{corners[face[0]], corners[face[1]], corners[face[2]]};
  if (face.size() > 3) {
    uint64_t last = corners[face[3]];
    for (uint64_t& corner : lowest) sortPair(corner, last);
  }
  sortPair(lowest[0], lowest[1]);
  sortPair(lowest[1], lowest[2]);
  sortPair(lowest[0], lowest[1]);
  return lowest;
}

/// The lowest three different ones.
FaceCorners lowestOf(std::span<const uint64_t> corners, std::span<const uint32_t> face) {
  FaceCorners lowest = kCollapsed;
  for (const uint32_t place : face) {
    uint64_t corner = corners[place];
    if (corner == lowest[0] || corner == lowest[1]) continue;
    for (uint64_t& at : lowest)
      if (corner < at) std::swap(corner, at);
  }
  return lowest[2] == UINT64_MAX ? kCollapsed : lowest;
}

void measure(std::span<const glm::dvec3> at, const glm::dvec3& middle, HalfFace& face) {
  const std::span<const uint32_t> corners = face.corners;
  const glm::dvec3& first = at[corners[0]];
  glm::dvec3 sum(0.0), area(0.0);
  for (size_t n = 0; n < corners.size(); ++n) {
    sum += at[corners[n]] - first;
    const uint32_t next = corners[n + 1 == corners.size() ? 0 : n + 1];
    area += glm::cross(at[corners[n]] - first, at[next] - first);
  }
  face.centre = first + sum / static_cast<double>(corners.size());
  face.inward = (glm::dot(area, middle - face.centre) < 0 ? -0.5 : 0.5) * area;
}

/// The number of faces of a cell; `own`: those of a polyhedron.
size_t countOf(CellKind shape, std::span<const uint32_t> own) {
  static constexpr std::array<size_t, 5> kFaces{0, 4, 5, 5, 6};  // [CellKind]
  if (shape != CellKind::kPolyhedron) return kFaces[static_cast<size_t>(shape)];
  size_t count = 0;
  for (size_t at = 0; at < own.size(); at += own[at] + size_t{1}) ++count;
  return count;
}

glm::dvec3 middleOf(std::span<const glm::dvec3> corners) {
  glm::dvec3 middle(0.0);
  for (const glm::dvec3& corner : corners) middle += corner;
  return middle / static_cast<double>(corners.size());
}

std::span<const uint32_t> facesOfCell(const GatheredCells& cells, size_t n) {
  return facesOf(cells.shapes[n], cells.facesOfPolyhedron(n));
}

FaceCorners lowestOf(std::span<const uint64_t> corners, std::span<const uint32_t> face, bool is_plain) {
  return is_plain ? lowestOfPlain(corners, face) : lowestOf(corners, face);
}

}  // namespace

void FaceList::assign(const GatheredCells& cells) {
  begins_.resize(cells.size() + 1);
  middles_.clear();
  for (size_t n = 0; n < cells.size(); ++n) {
    begins_[n + 1] = begins_[n] + countOf(cells.shapes[n], cells.facesOfPolyhedron(n));
    // A forecast has no positions, and measures nothing.
    if (cells.cornersOfCell(n).size() > kManyCorners && !cells.at.empty())
      middles_.emplace_back(n, curvisplat::middleOf(cells.view(n, 0).corners));
  }
  corners.resize(begins_.back());
  places.resize(begins_.back());
  std::atomic<bool> any_collapsed = false;
  parallelFor(tbb::blocked_range<size_t>(0, cells.size(), kMatchedPerTask),
              [&](const tbb::blocked_range<size_t>& part) {
                bool collapsed = false;
                for (size_t n = part.begin(); n < part.end(); ++n) collapsed |= assignCell(cells, n);
                if (collapsed) any_collapsed = true;
              });
  if (any_collapsed) leaveOutCollapsed();
}

/// Returns whether a face is collapsed.
bool FaceList::assignCell(const GatheredCells& cells, size_t n) {
  if (cells.shapes[n] == CellKind::kNone) return false;
  const std::span<const uint64_t> of_cell = cells.cornersOfCell(n);
  const bool is_plain = cells.shapes[n] != CellKind::kPolyhedron && areDifferent(of_cell);
  const std::span<const uint32_t> faces = facesOfCell(cells, n);
  bool collapsed = false;
  size_t to = begins_[n];
  for (size_t at = 0; at < faces.size(); at += faces[at] + size_t{1}, ++to) {
    corners[to] = lowestOf(of_cell, faces.subspan(at + 1, faces[at]), is_plain);
    places[to] = {static_cast<uint32_t>(n), static_cast<uint32_t>(at), is_plain};
    collapsed |= corners[to][2] == UINT64_MAX;
  }
  return collapsed;
}

void FaceList::leaveOutCollapsed() {
  size_t kept = 0;
  for (size_t n = 0; n < corners.size(); ++n) {
    if (corners[n][2] == UINT64_MAX) continue;
    corners[kept] = corners[n];
    places[kept++] = places[n];
  }
  corners.resize(kept);
  places.resize(kept);
}

glm::dvec3 FaceList::middleOf(const GatheredCells& cells, size_t cell) const {
  const CellView view = cells.view(cell, 0);
  if (view.corners.size() <= kManyCorners) return curvisplat::middleOf(view.corners);
  return std::lower_bound(middles_.begin(), middles_.end(), cell,
                          [](const auto& middle, size_t wanted) { return middle.first < wanted; })
      ->second;
}

HalfFace FaceList::face(const GatheredCells& cells, size_t n) const {
  const Place& place = places[n];
  const std::span<const uint32_t> faces = facesOfCell(cells, place.cell);
  const CellView view = cells.view(place.cell, 0);
  HalfFace face{
      place.cell, faces.subspan(place.at + size_t{1}, faces[place.at]), place.of_plain_cell, {}, {}};
  measure(view.corners, middleOf(cells, place.cell), face);
  return face;
}

uint64_t FaceList::lastOfQuad(const GatheredCells& cells, size_t n) const {
  const Place& place = places[n];
  const std::span<const uint32_t> faces = facesOfCell(cells, place.cell);
  if (!place.of_plain_cell || faces[place.at] != 4) return kNoCorner;
  uint64_t last = 0;
  for (const uint32_t corner : faces.subspan(place.at + size_t{1}, 4))
    last = std::max(last, cells.cornersOfCell(place.cell)[corner]);
  return last;
}

}  // namespace curvisplat
