// External sort along the seams' direction: sorted runs in one temporary file once memory is full, then a
// merge of all runs at once, or of ranges of them by several threads. The order is total (position, then
// number), so it does not depend on the order of adding or on the memory.
//
// A record is of doubles, the first three of which are these:
//
//     along | across | bits of the number | whatever the caller needs
//
// In memory records stay in the order of adding; what is sorted is an entry of 16 bytes for each. Reading
// records in sorted order jumps about in memory, so they are prefetched. The memory has two halves: while a
// thread sorts and writes one, others fill the other.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// Throws Error if the disk fails.
class RecordSorter {
 public:
  using Visit = std::function<void(const double* record)>;
  using VisitOrStop = std::function<bool(const double* record)>;  // false: stop

  /// `record_size`: in doubles, 3 or more. Keeps to `memory_bytes`, except that it holds two records, and
  /// one a run, at least.
  RecordSorter(size_t record_size, uint64_t memory_bytes, std::filesystem::path temporary_folder);

  /// Adds whole records. Any thread; one of them may write those of a full half meanwhile.
  void add(std::span<const double> records);

  // The functions below are not for several threads at once, except for visit().

  /// Visits all that was added, by (along, number), and forgets it.
  void drain(const Visit& visit);

  /// Ends adding, in place of drain(). Then up to `visitors` threads may visit() at the same time, and
  /// cutsInto() is known.
  void sort(unsigned visitors = 1);
  /// Visits the records with from <= along < to, by (along, number), until `visit` returns false.
  void visit(double from, double to, const VisitOrStop& visit) const;
  /// Positions that divide the records into about `parts` of equal size, rising; fewer where records are
  /// few.
  std::vector<double> cutsInto(size_t parts) const;
  void forget();

  static void setKey(double* record, double along, double across, uint64_t number) {
    record[0] = along;
    record[1] = across;
    record[2] = std::bit_cast<double>(number);
  }
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

  /// Records that are sorted together.
  struct Half {
    size_t first = 0;                    // its first record's place in memory
    std::vector<Entry> entries, sorted;  // [record], until they are sorted; of the same capacity
    bool is_being_written = false;
  };

  const double* record(const Entry& entry) const { return records_.get() + entry.record * record_size_; }
  bool isBefore(const Entry& a, const Entry& b) const {
    return a.along != b.along ? a.along < b.along : numberOf(record(a)) < numberOf(record(b));
  }
  void takeMemory();
  size_t fill(Half& half, std::span<const double> records);
  void sortEntries(Half& half) const;
  void visitInMemory(const std::vector<Entry>& entries, double from, double to,
                     const VisitOrStop& visit) const;
  void visitRuns(double from, double to, const VisitOrStop& visit) const;
  Run write(Half& half);
  void forgetMemory();
  uint64_t recordsOf(const Run& run) const { return (run.end - run.begin) / (record_size_ * sizeof(double)); }
  double alongAt(const Run& run, uint64_t record) const;
  Run partOf(const Run& run, double from, double to) const;

  size_t record_size_;
  uint64_t memory_bytes_;
  size_t half_;  // records of a half
  std::filesystem::path folder_;
  // The members below belong, while records are added, to the thread that holds the mutex; a half that is
  // being written, and the file, to the one that writes it.
  Mutex mutex_;
  ConditionVariable changed_;
  std::unique_ptr<double[]> records_;
  std::array<Half, 2> halves_;
  size_t filling_ = 0;  // of the halves
  std::unique_ptr<NamelessFile> file_;
  std::vector<Run> runs_;
  unsigned visitors_ = 1;
};

}  // namespace curvisplat
