// The folders that a conversion works in, and the files of an interrupted conversion that it finds there.
//
//    NAME.splats.partial/    beside the output, locked: the cache as it grows, and
//      journal               what is converted, where the scratch folder is, and the splats once all are there
//      bricks.log            the bricks that have been appended (CacheWriter)
//    NAME.splats.tmp.<...>/  in the temporary folder: splats.bin, and what buckets are divided into
//
//    begun --noteSplats()--> splats on disk --> bricks appended --CacheWriter::finish()--> in place
//      ^                          |  ^             | one by one
//      +------- lost by the disk -+  +-- goes on --+
//
// A process may die at any moment, so a conversion that resumes checks all files that it finds. It resumes
// only if all splats, or some bricks, are there. Otherwise it removes the files and starts anew.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/scratch_folder.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {

/// What to do about an unfinished conversion to the same output.
enum class Unfinished {
  kRefuse,  // it is an error, if there is something to lose
  kResume,
  kRemove,
};

class ConversionWorkspace {
 public:
  /// Makes the folders, or takes over those of an interrupted conversion. Throws Error if the output may not
  /// be replaced, another conversion to it is running, an interrupted one is in the way, or the one to be
  /// resumed had other `facts`.
  ConversionWorkspace(const std::filesystem::path& output, bool overwrite, Unfinished unfinished,
                      const std::filesystem::path& temporary_folder, std::vector<ConversionFact> facts);
  /// Removes the folders unless leaveForResuming() was called; once the cache is in place, only the temporary
  /// files that are left.
  ~ConversionWorkspace();

  bool resumed() const { return resumed_; }
  /// The splats that an interrupted conversion has left, all or some; nullopt: they have to be made.
  const std::optional<ScatteredSplats>& splats() const { return journal_.splats; }
  bool hasAllSplats() const { return journal_.splats && !journal_.splats->unfinished; }
  PartialFolder& partial() { return *partial_; }
  std::filesystem::path splatsFile() const { return splatsFileOf(scratch_->path(), 0); }
  /// The splats that a rank has scattered, in the scratch folder.
  static std::filesystem::path splatsFileOf(const std::filesystem::path& scratch, unsigned rank) {
    return scratch / (rank == 0 ? "splats.bin" : "splats." + std::to_string(rank) + ".bin");
  }
  const ConversionJournal& journal() const { return journal_; }
  const std::filesystem::path& scratch() const { return scratch_->path(); }

  void noteSplats(ScatteredSplats splats);
  /// After LostBuckets: the splats on disk are damaged.
  void forgetSplats();

  /// Bytes that the partial folder takes already, which need no further disk space.
  uint64_t bytesInPartial() const;

  /// Leaves the folders for a later conversion if they are worth it. Returns whether they are.
  bool leaveForResuming();
  /// If a conversion was killed after its cache was in place and before clearFinished(): removes its files
  /// and returns the facts of that conversion.
  static std::optional<std::vector<ConversionFact>> clearKilled(const std::filesystem::path& output);

 private:
  bool worthResuming() const;
  void removeDividedBuckets() const;
  void clearFinished();
  void writeJournalNow() { writeJournal(partial_->path(), journal_); }

  std::unique_ptr<PartialFolder> partial_;
  ConversionJournal journal_;
  std::unique_ptr<ScratchFolder> scratch_;
  bool resumed_ = false;
};

}  // namespace curvisplat
