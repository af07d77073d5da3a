// The nodes of block faces, and those behind them, sorted along the seams' direction: NodeSplats as records
// of a RecordSorter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "preprocess/coincidence/coincidence_sweep.h"
#include "preprocess/coincidence/record_sorter.h"
#include "preprocess/splats/node_splats.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// A view of a node and its values in a sorter.
class SeamRecord {
 public:
  explicit SeamRecord(const double* record) : record_(record) {}

  uint64_t node() const { return RecordSorter::numberOf(record_); }
  SweptNode swept() const;
  /// Unpacks the first `values.size()` values.
  void unpack(NodeSplat& node, std::span<SplatScalar> values) const;

 private:
  const double* record_;
};

/// Throws Error if the disk fails.
class SeamSorter {
 public:
  using Visit = std::function<void(const SeamRecord&)>;

  /// Keeps to `memory_bytes`, except that it holds a record (264 bytes with one variable) a run at least: 64
  /// MiB serve 10^11 nodes.
  SeamSorter(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder);

  /// The bytes of a node on disk.
  static size_t recordBytes(size_t variables);

  /// Appends a node to `records`, of recordBytes() each, in doubles. Any thread.
  void pack(const SeamPosition& sweep, const NodeSplat& splat, std::span<const SplatScalar> values,
            std::vector<double>& records) const;
  /// Adds packed records, of this or of another process. Any thread.
  void add(std::span<const double> records);

  // The functions below are not for several threads at once.

  /// Visits all that was added, by (along, node), and forgets it.
  void drain(const Visit& visit);
  /// Ends adding, in place of drain(), so that `visitors` threads can visit ranges at the same time.
  /// Coordinates are of `coordinate_bytes` bytes.
  std::vector<SweepRange> sort(unsigned visitors, int coordinate_bytes);
  void visit(const SweepRange& range, const Visit& visit) const;
  void forget() { records_.forget(); }

  /// Visits the records as drain() does, but packed.
  void drainPacked(const std::function<void(std::span<const double>)>& visit);

 private:
  size_t variables_;
  size_t record_size_;  // in doubles
  RecordSorter records_;
  Mutex mutex_;
  LargestReach reach_ GUARDED_BY(mutex_);
};

}  // namespace curvisplat
