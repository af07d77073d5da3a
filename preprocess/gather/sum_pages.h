// The sums of a mesh's points, by pages: those that were used last are in memory, others in a temporary file.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/gather/page_slots.h"
#include "stream/base/nameless_file.h"

namespace curvisplat {

/// One thread, but where it says otherwise.
class SumPages {
 public:
  static constexpr unsigned kShift = 12;
  static constexpr uint64_t kPoints = uint64_t{1} << kShift;  // of a page
  // A page is read and written, a cell in a stream as well, but once for all of its corners.
  static constexpr double kMaxAgain = 0.25;

  /// Of points below `points`, each with as many `values` and `moments`. At most `pages` are in memory.
  SumPages(uint64_t points, size_t values, size_t moments, uint64_t pages, ScratchFiles scratch);

  static uint64_t bytesOfPoint(size_t values, size_t moments) {
    return sizeof(glm::dvec3) + values * sizeof(float) + moments * sizeof(double);
  }

  /// Reads those of these points that are not in memory. Returns false, and reads nothing, if they do not fit together, or if
  /// pages were read again so often that streams are faster: cells refer to points all over the mesh then.
  bool hold(std::span<const uint64_t> points);
  /// All of pages [first, end), as many as there may be in memory.
  void holdPages(uint64_t first, uint64_t end);
  /// From now on as many may be in memory.
  void setMost(uint64_t pages) { slots_.setMost(pages); }
  /// The page is not used again.
  void forget(uint64_t page) { slots_.leave(page); }
  /// Writes all pages to the file, and frees their memory.
  void putAside();

  /// Sums of a point that is in memory: its position (an x that is NaN: no cell has come), then the moments. Any thread.
  double* sums(uint64_t point) {
    return pages_[slots_.slotOf(point >> kShift)].sums.data() + (point & (kPoints - 1)) * (3 + moments_);
  }
  float* values(uint64_t point) {
    return pages_[slots_.slotOf(point >> kShift)].values.data() + (point & (kPoints - 1)) * fields_;
  }

 private:
  struct Page {
    std::vector<double> sums;
    std::vector<float> values;
  };
  void read();
  void write(uint64_t page, const Page& from);

  const uint64_t points_;
  const size_t fields_, moments_;
  const ScratchFiles scratch_;
  PageSlots slots_;
  std::vector<Page> pages_;    // [slot]
  std::vector<bool> in_file_;  // [page]
  std::unique_ptr<NamelessFile> file_;
};

}  // namespace curvisplat
