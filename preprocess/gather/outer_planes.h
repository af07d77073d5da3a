// The outer faces that splats end at, by ranges of the splats' numbers, through one temporary file
// (OuterPlanes), and for splats of points which faces those are (PointBorders). The planes of a splat do
// not depend on the order in which they came, nor on memory. One thread adds; any may read a loaded range.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "preprocess/gather/face_matcher.h"
#include "preprocess/gather/streams_file.h"
#include "preprocess/moments/mesh_splats.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Planes on their way to the splats that end at them.
class OuterPlanes {
 public:
  OuterPlanes(size_t ranges, uint64_t range_size, uint64_t memory_bytes, ScratchFiles scratch)
      : range_size_(range_size), file_(std::move(scratch), ranges, memory_bytes) {}

  /// Bytes of a plane in the file.
  static constexpr uint64_t bytesOfPlane() { return sizeof(OfRange::Record); }

  /// One thread. A plane without area is left out. `face`: its number, the same for all that it is added to.
  void add(uint64_t number, const OuterPlane& plane, uint64_t face = 0);
  void close() { file_.close(); }
  /// Leaves out faces that another one lies against at one of their numbers. Call it after close(). There are
  /// cells on both sides, whose faces do not fit together: nodes hang. Where more than 256 meet, all are left
  /// out. Memory: 8 bytes for each such face.
  void leaveOutClosed(const Progress& progress);

  /// The planes of a range; what comes out does not depend on the order in which they came in.
  class OfRange {
   public:
    /// The planes of the splat `number`. Any thread; `scratch` keeps its capacity.
    std::span<const OuterPlane> of(uint64_t number, std::vector<OuterPlane>& scratch) const;
    /// Whether a face of the splat was left out since another one lies against it. Any thread.
    bool isAtClosed(uint64_t number) const;

   private:
    friend class OuterPlanes;
    struct Record {
      uint64_t number, touches, face;
      std::array<double, 3> inward, point;
    };
    std::vector<Record> records_;      // by number
    std::vector<uint64_t> at_closed_;  // numbers, rising
  };
  OfRange load(size_t range);

 private:
  OfRange sorted(size_t range) const;

  const uint64_t range_size_;
  StreamsFile file_;
  std::vector<uint64_t> closed_;  // faces, rising
};

/// Whether two whole faces lie against each other: their normals are opposite, and the plane of each has the other's
/// centre in it.
bool lieAgainst(const OuterPlane& a, const OuterPlane& b);

/// Finds which outer faces the splats of points end at: those that have the point and, for points behind,
/// those of a cell that has the point.
class PointBorders {
 public:
  /// Sorts by ranges of `range_points` numbers. `cells`: about how many there will be.
  PointBorders(uint64_t points, uint64_t range_points, uint64_t cells, uint64_t memory_bytes,
               const ScratchFiles& scratch);

  /// Cells in the mesh's order.
  void add(const GatheredCells& cells);
  /// Ends adding, once, after all cells; then load().
  void finish(const Progress& progress);
  OuterPlanes::OfRange load(size_t range) { return planes_.load(range); }

  /// Bytes of the faces that wait for their second cell, whatever memory there is.
  static uint64_t waitingBytes(uint64_t cells);
  /// Bytes of the record of a face.
  static size_t faceBytes();
  static constexpr uint64_t kMaxPlanesOfFace = 8;

 private:
  FaceMatcher faces_;
  OuterPlanes planes_;
  FaceList list_;
};

}  // namespace curvisplat
