// Finds which faces two cells share, and which only one has: the outer ones. FaceList lists the faces of
// gathered cells, in parallel; FaceMatcher pairs them. Cells come in the mesh's order, and most pairs are
// near one another there: up to 2^17 faces without their second cell wait in memory. If there are more,
// some go to disk, and are sorted at the end.
//
//    faces --> waiting in memory --+--> pairs
//                   | too many     |
//                   +--> streams by a hash of the corners, sorted --> pairs, single ones
//
// Faces are alike if their three lowest corners are. How many wait does not depend on the memory that there
// is, so which two of three alike faces are a pair does not, either.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/streams_file.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// The lowest three corners of a face, rising.
using FaceCorners = std::array<uint64_t, 3>;

/// Functions for the faces that come together.
struct FaceCalls {
  /// Makes the record of face n, of FaceMatcher's size. Any thread.
  std::function<void(size_t n, std::span<std::byte> to)> put;
  /// A pair of two of them, or of one of them and the record of one that came earlier. May be empty.
  std::function<void(size_t first, size_t second)> pair = {};
  std::function<void(std::span<const std::byte> first, size_t second)> pair_with_earlier = {};
};

/// Matches the faces of cells. One thread at a time, except for FaceCalls::put.
class FaceMatcher {
 public:
  using TakePair = std::function<void(std::span<const std::byte>, std::span<const std::byte>)>;
  using TakeSingle = std::function<void(const FaceCorners&, std::span<const std::byte>)>;

  /// Expects about `faces` faces. Streams keep to `memory_bytes`, beside the faces that wait
  /// (waitingBytes()).
  FaceMatcher(size_t record_bytes, uint64_t faces, uint64_t memory_bytes, ScratchFiles scratch);
  ~FaceMatcher();

  /// Calls for some of the pairs, in this thread. Records are made of the faces that have no second one
  /// among these.
  void add(std::span<const FaceCorners> faces, const FaceCalls& calls);
  /// The others, and those without another. After all faces; when it is called again, these are the same.
  void finish(const TakePair& pair, const TakeSingle& single, const Progress& progress);
  /// Frees the memory of the streams, after finish().
  void forget();

  /// Bytes of the stream that a face takes if it does not wait in memory.
  static uint64_t spilledBytes(size_t record_bytes) { return sizeof(FaceCorners) + record_bytes; }
  /// The memory of all streams.
  static uint64_t streamBytes(uint64_t memory_bytes) { return memory_bytes / 4; }
  static constexpr uint32_t kMaxWaiting = uint32_t{1} << 17;
  /// Bytes of as many faces as wait at most.
  static uint64_t waitingBytes(size_t record_bytes, uint64_t faces);

 private:
  static constexpr uint32_t kNone = UINT32_MAX, kHasRecord = UINT32_MAX - 1;
  struct Waiting {
    FaceCorners corners;
    uint32_t next;  // of the same bucket
    uint32_t face;  // among those that are added; kHasRecord: an earlier one; kNone: nothing waits here
  };
  void makeRecords(const FaceCalls& calls);
  uint32_t newEntry(const FaceCalls& calls);
  void growTable();
  void spill(uint32_t entry);
  void unlink(uint32_t entry);
  std::span<std::byte> recordOf(uint32_t entry) {
    return std::span(records_).subspan(entry * record_bytes_, record_bytes_);
  }
  uint64_t bucketOf(const FaceCorners& corners) const;
  void matchStream(size_t stream, const TakePair& pair, const TakeSingle& single) const;

  const size_t record_bytes_;
  std::vector<uint32_t> buckets_;  // the first entry of each
  std::vector<Waiting> waiting_;
  std::vector<std::byte> records_;
  std::vector<uint32_t> free_;                        // of waiting_
  std::vector<std::pair<uint32_t, uint32_t>> taken_;  // by the faces that are added: entry, face
  uint32_t next_to_spill_ = 0;
  std::unique_ptr<StreamsFile> spilled_;
  std::vector<std::byte> scratch_;
};

/// A face as one of its cells has it.
struct HalfFace {
  size_t cell = 0;                    // among the gathered ones
  std::span<const uint32_t> corners;  // places among the cell's
  bool of_plain_cell = false;         // which is no polyhedron, and whose corners are different points
  glm::dvec3 inward{0.0};             // at right angles to it, as long as its area, into the cell
  glm::dvec3 centre{0.0};             // the mean of its corners
};

/// The faces of all cells in their order. Collapsed ones, with fewer than three corners, are left out.
class FaceList {
 public:
  /// The place of a face.
  struct Place {
    uint32_t cell, at;  // among the gathered ones; where it begins in facesOf() the cell
    bool of_plain_cell;
  };
  std::vector<FaceCorners> corners;
  std::vector<Place> places;

  void assign(const GatheredCells& cells);  // in parallel; keeps the capacity
  /// Face n, measured. Any thread.
  HalfFace face(const GatheredCells& cells, size_t n) const;
  static constexpr uint64_t kNoCorner = UINT64_MAX;
  /// The highest corner of face n, if it has four and its cell is plain; otherwise kNoCorner. Positions are not needed.
  uint64_t lastOfQuad(const GatheredCells& cells, size_t n) const;

 private:
  bool assignCell(const GatheredCells& cells, size_t n);
  void leaveOutCollapsed();
  glm::dvec3 middleOf(const GatheredCells& cells, size_t cell) const;

  std::vector<size_t> begins_{0};  // [cell + 1], in corners, with collapsed ones
  // The middles of cells of very many corners, in their order: each of their very many faces needs it.
  std::vector<std::pair<size_t, glm::dvec3>> middles_;
};

}  // namespace curvisplat
