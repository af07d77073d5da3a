// Finds nodes or elements of a Gmsh file by their numbers ("tags"), which may be in any order. One thread
// adds them.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/spool_file.h"

namespace curvisplat {

/// Maps each tag to its index in the order of the file. Consecutive tags need no memory; others need a table
/// on disk.
class GmshTags {
 public:
  GmshTags(const std::shared_ptr<SpoolFile>& spool, const std::string& file, const char* what)
      : spool_(spool), tags_(spool), file_(file), what_(what) {}

  void add(uint64_t tag) {
    if (count_ == 0) first_ = last_ = tag;
    in_order_ = in_order_ && tag == first_ + count_;
    first_ = std::min(first_, tag);
    last_ = std::max(last_, tag);
    ++count_;
    tags_.add(tag);
  }
  /// A further number of the last one that was added.
  void addAnother(uint64_t tag) {
    in_order_ = false;
    first_ = std::min(first_, tag);
    last_ = std::max(last_, tag);
    tags_.add(tag | kAnother);
  }
  uint64_t count() const { return count_; }

  /// Ends the additions, and makes the table. Throws Error if the tags are too far apart for one.
  void finish();

  /// Replaces each tag by its index; kNowhere where there is none. Any thread, after finish().
  void replace(std::vector<uint64_t>& tags) const;

  static constexpr uint64_t kNowhere = std::numeric_limits<uint64_t>::max();

 private:
  static constexpr uint64_t kAnother = uint64_t{1} << 63;

  std::shared_ptr<SpoolFile> spool_;
  NumberSpool<uint64_t> tags_;  // in the order of the file; kAnother: of the same index as the one before
  SpooledNumbers table_;
  std::string file_;
  const char* what_;
  bool in_order_ = true;
  uint64_t first_ = 0, last_ = 0, count_ = 0;
};

}  // namespace curvisplat
