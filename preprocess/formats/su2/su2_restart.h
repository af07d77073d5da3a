// Restart and solution files of SU2, values at the points of a mesh in their order:
//
//    ASCII     "PointID","x","y","z","Density",...       one line a point; commas (.csv) or tabs (.dat)
//    binary    int32: 535532, variables, points, ., .    names of 33 bytes; doubles, point by point
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_files.h"
#include "preprocess/formats/common/spooled_numbers.h"

namespace curvisplat {

/// Any number of threads may read.
class Su2Restart {
 public:
  /// An ASCII file goes to a spool file. Throws Error if it is damaged, or has not `points` points.
  Su2Restart(std::shared_ptr<const PooledFile> file, uint64_t points, const std::filesystem::path& folder);

  /// Its variables, without the point's number and position.
  const std::vector<std::string>& names() const { return names_; }
  bool binary() const { return binary_; }
  /// Values of points [first, first + to.size()).
  void read(size_t variable, uint64_t first, std::span<float> to) const;

 private:
  void openBinary(uint64_t points);
  void readText(uint64_t points, const std::filesystem::path& folder);
  void keepNames(const std::vector<std::string>& all);

  std::shared_ptr<const PooledFile> file_;
  bool binary_ = false, swap_ = false;
  uint64_t data_ = 0;  // offset of the doubles of a binary file
  size_t stride_ = 0;  // doubles a point
  std::vector<std::string> names_;
  std::vector<size_t> columns_;  // [names_]
  SpooledNumbers text_;
};

}  // namespace curvisplat
