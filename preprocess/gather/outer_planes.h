// The outer faces that splats end at, by ranges of the splats' numbers, through one temporary file.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "preprocess/gather/streams_file.h"
#include "preprocess/moments/mesh_borders.h"
#include "stream/base/nameless_file.h"
#include "stream/base/progress.h"

namespace curvisplat {

class OuterPlanes {
 public:
  OuterPlanes(size_t ranges, uint64_t range_size, uint64_t memory_bytes, ScratchFiles scratch)
      : range_size_(range_size), file_(std::move(scratch), ranges, memory_bytes) {}

  /// Of a plane in the file.
  static constexpr uint64_t bytesOfPlane() { return sizeof(OfRange::Record); }

  /// One thread. A plane without area is left out. `face`: its number, the same for all that it is added to.
  void add(uint64_t number, const OuterPlane& plane, uint64_t face = 0);
  void close() { file_.close(); }
  /// After close(): leaves out faces that another one lies against at one of their numbers. There are cells on both sides,
  /// whose faces do not fit together: nodes hang. Where more than 256 meet, all are left out. Memory: 8 bytes for each
  /// such face.
  void leaveOutClosed(const Progress& progress);

  /// The planes of a range; what comes out does not depend on the order in which they came in.
  class OfRange {
   public:
    /// Of a splat. Any thread; `scratch` keeps its capacity.
    std::span<const OuterPlane> of(uint64_t number, std::vector<OuterPlane>& scratch) const;

   private:
    friend class OuterPlanes;
    struct Record {
      uint64_t number, touches, face;
      std::array<double, 3> inward, point;
    };
    std::vector<Record> records_;  // by number
  };
  OfRange load(size_t range);

 private:
  OfRange sorted(size_t range) const;

  const uint64_t range_size_;
  StreamsFile file_;
  std::vector<uint64_t> closed_;  // faces, rising
};

}  // namespace curvisplat
