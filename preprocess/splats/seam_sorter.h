// External sort of block-face nodes along the seams' direction: sorted runs in one temporary file once memory
// is full, then a merge of all runs at once. The order is total (position, then node), so it does not depend
// on the order of adding or on the memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/splats/node_splats.h"
#include "stream/base/nameless_file.h"

namespace curvisplat {

/// A face node and its position along two generic directions, at right angles to one another.
struct SeamNode {
  double along = 0, across = 0;
  NodeSplat splat;
};

/// Not for several threads at once. Throws Error if the disk fails.
class SeamSorter {
 public:
  using Visit = std::function<void(const SeamNode&, std::span<const SplatScalar>)>;

  /// Keeps to `memory_bytes`, except that it holds a record (224 bytes with one variable) a run at least: 64
  /// MiB serve 10^11 nodes.
  SeamSorter(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder);

  /// What a node takes, in memory or on disk.
  static size_t recordBytes(size_t variables);

  void add(const SeamNode& node, std::span<const SplatScalar> values);
  /// Visits all that was added, by (along, node), and forgets it.
  void drain(const Visit& visit);

  /// The same as records of recordBytes(), in doubles, which the sorter of another process can take.
  void drainPacked(const std::function<void(std::span<const double>)>& visit);
  void addPacked(std::span<const double> records);

 private:
  struct Run {
    uint64_t begin, end;  // bytes of the file
  };
  /// Orders the records in memory.
  struct Entry {
    double along;
    uint64_t node;
    size_t record;  // its place in memory; of a merge: the run whose first it is
    bool operator<(const Entry& other) const {
      return along != other.along ? along < other.along : node < other.node;
    }
  };

  static void pack(const SeamNode& node, std::span<const SplatScalar> values, std::vector<double>& out);
  void spill();
  void unpack(const double* record, SeamNode& node, std::span<SplatScalar> values) const;
  void drainRuns(const Visit& visit);

  size_t variables_;
  size_t record_size_;  // in doubles
  uint64_t memory_bytes_;
  size_t capacity_;  // records in memory
  std::filesystem::path folder_;
  std::vector<double> records_;  // packed
  std::vector<Entry> entries_;   // [record], until they are sorted
  std::unique_ptr<NamelessFile> file_;
  std::vector<Run> runs_;
};

}  // namespace curvisplat
