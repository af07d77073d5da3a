// Long arrays by point of which only the pages that were used last are in memory: positions and values,
// which are read from the mesh again (PointPages), and sums, which are written to a temporary file
// (SumPages). PageSlots decides for both which pages those are; gather_forecast.h follows the same
// decisions without any data.
//
// Pages are for meshes whose cells refer to points near those of the cells before. Where pages are read
// again too often, hold() returns false, and the caller goes on with streams. One thread calls, except
// where a function says otherwise.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/gather/point_numbers.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Chooses the pages of a long array that are in memory: those that were wanted last. The caller has the
/// pages themselves, in slots.
class PageSlots {
 public:
  static constexpr uint32_t kNone = UINT32_MAX;

  /// A page has 2^shift items. At most `slots` of them are in memory.
  PageSlots(uint64_t items, unsigned shift, uint64_t slots);

  uint64_t pages() const { return slots_.size(); }
  /// kNone if it is not in memory.
  uint32_t slotOf(uint64_t page) const { return slots_[page]; }
  void setMost(uint64_t slots) { most_ = slots; }

  /// The pages of these items are wanted, and no others. Returns whether they fit.
  bool want(std::span<const uint64_t> items);
  /// The same, if all items that have been held allow it: the items of pages that were in memory before,
  /// over the items that were wanted, are at most `most_again`. Where it returns false nothing is held.
  bool hold(std::span<const uint64_t> items, double most_again);
  /// want() of pages [first, end).
  bool wantPages(uint64_t first, uint64_t end);
  /// The wanted pages that are not in memory, rising.
  std::span<const uint64_t> missing() const { return missing_; }
  /// Pages that have to leave memory for them. Their slots are free now.
  struct Left {
    uint64_t page;
    uint32_t slot;
  };
  /// Gives slots to the missing ones. Only if all that is wanted fits.
  std::span<const Left> place();
  /// The page leaves memory.
  void leave(uint64_t page);

 private:
  void wantPage(uint64_t page);
  bool wantsFit();

  const unsigned shift_;
  uint64_t most_, now_ = 0, wanted_ = 0;
  std::vector<uint32_t> slots_, free_;
  std::vector<uint64_t> used_at_;              // [page]
  std::vector<bool> was_in_memory_;            // [page]
  uint64_t held_ = 0, again_ = 0;              // items, by hold()
  std::vector<uint64_t> in_memory_, missing_;  // pages
  std::vector<Left> left_;
  uint32_t slots_made_ = 0;
};

/// Numbers, positions and values of a mesh's points, read as cells need them.
class PointPages {
 public:
  /// Keeps to `memory_bytes`. `fields`: values of each point. `reader` and `numbers` must outlive it.
  PointPages(const MeshReader& reader, const PointNumbers& numbers, size_t fields, uint64_t memory_bytes);

  /// Reads those of these points that are not in memory. Returns false, and reads nothing, if they do not
  /// fit together, or if pages were read again so often that streams are faster: cells refer to points all
  /// over the mesh then.
  bool hold(std::span<const uint64_t> points);

  /// The position of a point that hold() was last called with. Any thread.
  const glm::dvec3& at(uint64_t point) const { return pageOf(point).at[point & (kPoints - 1)]; }
  const float* values(uint64_t point) const {
    return pageOf(point).values.data() + (point & (kPoints - 1)) * fields_;
  }
  /// PointNumbers' number of it.
  uint64_t number(uint64_t point) const {
    return numbers_->merged() > 0 ? pageOf(point).numbers[point & (kPoints - 1)] : point;
  }

  /// Decides which pages are in memory: PageSlots::hold(points, kMaxAgain) of these. `merges`: some points
  /// have become others.
  static PageSlots slotsFor(uint64_t points, size_t fields, uint64_t memory_bytes, bool merges) {
    const uint64_t point_bytes =
        sizeof(glm::dvec3) + fields * sizeof(float) + (merges ? sizeof(uint64_t) : 0);
    return {points, kShift, memory_bytes / point_bytes / kPoints};
  }
  // The bound of reading pages again: with streams a reference is written and read, and its point, too.
  static constexpr double kMaxAgain = 4;

 private:
  static constexpr unsigned kShift = 14;
  static constexpr uint64_t kPoints = uint64_t{1} << kShift;  // of a page
  struct Page {
    std::vector<glm::dvec3> at;
    std::vector<float> values;      // [point * fields + field]
    std::vector<uint64_t> numbers;  // empty: no point has become another one
  };
  const Page& pageOf(uint64_t point) const { return pages_[slots_.slotOf(point >> kShift)]; }
  void add(const LoadedPoints& loaded);

  const MeshReader* reader_;
  const PointNumbers* numbers_;
  const size_t fields_;
  PageSlots slots_;
  std::vector<Page> pages_;  // [slot]
};

/// The sums of a mesh's points; pages that are not in memory are in a temporary file.
class SumPages {
 public:
  static constexpr unsigned kShift = 12;
  static constexpr uint64_t kPoints = uint64_t{1} << kShift;  // of a page
  // A page is read and written, a cell in a stream as well, but once for all of its corners.
  static constexpr double kMaxAgain = 0.25;

  /// Holds points below `points`, each with `values` values and `moments` moments. At most `pages` are in
  /// memory.
  SumPages(uint64_t points, size_t values, size_t moments, uint64_t pages, ScratchFiles scratch);

  static uint64_t bytesOfPoint(size_t values, size_t moments) {
    return sizeof(glm::dvec3) + values * sizeof(float) + moments * sizeof(double);
  }

  /// Reads those of these points that are not in memory. Returns false, and reads nothing, if they do not
  /// fit together, or if pages were read again so often that streams are faster: cells refer to points all
  /// over the mesh then.
  bool hold(std::span<const uint64_t> points);
  /// All of pages [first, end), as many as there may be in memory.
  void holdPages(uint64_t first, uint64_t end);
  /// Sets how many pages may be in memory from now on.
  void setMost(uint64_t pages) { slots_.setMost(pages); }
  /// The page is not used again.
  void forget(uint64_t page) { slots_.leave(page); }
  /// Writes all pages to the file, and frees their memory.
  void putAside();

  /// Sums of a point that is in memory: its position (an x that is NaN: no cell has come), then the moments.
  /// Any thread.
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
