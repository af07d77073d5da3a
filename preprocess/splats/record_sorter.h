// External sort along the seams' direction: sorted runs in one temporary file once memory is full, then a merge of all
// runs at once, or of ranges of them by several threads. The order is total (position, then number), so it does not
// depend on the order of adding or on the memory.
//
// A record is of doubles, the first three of which are these:
//
//     along | across | bits of the number | whatever the caller needs
//
// In memory records stay in the order of adding; what is sorted is an entry of 16 bytes for each. Reading records in sorted order
// jumps about in memory, so they are prefetched.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "stream/base/nameless_file.h"

namespace curvisplat {

/// Not for several threads at once, except for visit(). Throws Error if the disk fails.
class RecordSorter {
 public:
  using Visit = std::function<void(const double* record)>;
  using VisitOrStop = std::function<bool(const double* record)>;  // false: stop

  /// `record_size`: in doubles, 3 or more. Keeps to `memory_bytes`, except that it holds a record a run at least.
  RecordSorter(size_t record_size, uint64_t memory_bytes, std::filesystem::path temporary_folder);

  /// Adds a record with these three numbers. Returns it for the others to be written, before the next call.
  double* add(double along, double across, uint64_t number);
  /// Visits all that was added, by (along, number), and forgets it.
  void drain(const Visit& visit);

  /// In place of drain(): ends adding. Then up to `visitors` threads may visit() at the same time, and cutsInto() is known.
  void sort(unsigned visitors = 1);
  /// Visits the records with from <= along < to, by (along, number), until `visit` returns false.
  void visit(double from, double to, const VisitOrStop& visit) const;
  /// Positions that divide the records into about `parts` of equal size, rising; fewer where records are few.
  std::vector<double> cutsInto(size_t parts) const;
  void forget();

  static double alongOf(const double* record) { return record[0]; }
  static double acrossOf(const double* record) { return record[1]; }
  static uint64_t numberOf(const double* record) { return std::bit_cast<uint64_t>(record[2]); }

 private:
  struct Run {
    uint64_t begin = 0, end = 0;  // bytes of the file
  };
  struct Entry {
    double along;
    size_t record;  // its place in memory
  };

  const double* record(const Entry& entry) const { return records_.get() + entry.record * record_size_; }
  bool isBefore(const Entry& a, const Entry& b) const {
    return a.along != b.along ? a.along < b.along : numberOf(record(a)) < numberOf(record(b));
  }
  void sortEntries();
  void visitInMemory(double from, double to, const VisitOrStop& visit) const;
  void visitRuns(double from, double to, const VisitOrStop& visit) const;
  void spill();
  void forgetMemory();
  uint64_t recordsOf(const Run& run) const { return (run.end - run.begin) / (record_size_ * sizeof(double)); }
  double alongAt(const Run& run, uint64_t record) const;
  Run partOf(const Run& run, double from, double to) const;

  size_t record_size_;
  uint64_t memory_bytes_;
  size_t capacity_;  // records in memory
  std::filesystem::path folder_;
  std::unique_ptr<double[]> records_;
  std::vector<Entry> entries_, sorted_;  // [record], until they are sorted; both of the same capacity
  std::unique_ptr<NamelessFile> file_;
  std::vector<Run> runs_;
  unsigned visitors_ = 1;
};

}  // namespace curvisplat
