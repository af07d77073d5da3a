// Positions and values of a mesh's points, read as cells need them: the pages of them that were used last are in memory.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/gather/page_slots.h"

namespace curvisplat {

class PointPages {
 public:
  /// Keeps to `memory_bytes`. `fields`: values of each point. `reader` must outlive it.
  PointPages(const MeshReader& reader, size_t fields, uint64_t memory_bytes);

  /// Reads those of these points that are not in memory. Returns false, and reads nothing, if they do not fit together, or if
  /// pages were read again so often that streams are faster: cells refer to points all over the mesh then.
  bool hold(std::span<const uint64_t> points);

  /// Of a point that hold() was last called with. Any thread.
  const glm::dvec3& at(uint64_t point) const { return pageOf(point).at[point & (kPoints - 1)]; }
  const float* values(uint64_t point) const {
    return pageOf(point).values.data() + (point & (kPoints - 1)) * fields_;
  }

  /// What decides which pages are in memory: PageSlots::hold(points, kMaxAgain) of these.
  static PageSlots slotsFor(uint64_t points, size_t fields, uint64_t memory_bytes) {
    return {points, kShift, memory_bytes / (sizeof(glm::dvec3) + fields * sizeof(float)) / kPoints};
  }
  // With streams a reference is written and read, and its point, too.
  static constexpr double kMaxAgain = 4;

 private:
  static constexpr unsigned kShift = 14;
  static constexpr uint64_t kPoints = uint64_t{1} << kShift;  // of a page
  struct Page {
    std::vector<glm::dvec3> at;
    std::vector<float> values;  // [point * fields + field]
  };
  const Page& pageOf(uint64_t point) const { return pages_[slots_.slotOf(point >> kShift)]; }
  void take(const LoadedPoints& loaded);

  const MeshReader* reader_;
  const size_t fields_;
  PageSlots slots_;
  std::vector<Page> pages_;  // [slot]
};

}  // namespace curvisplat
