// The folders that a conversion works in, and what it finds in them of one that was interrupted.
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
// A process may die anywhere: what it leaves is checked by whoever goes on from it. Worth going on from is
// what has all splats, or some bricks. Anything less is removed and made again.
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
  /// Removes the folders, unless leaveForResuming() was called; once the cache is in place, what is left of
  /// the work.
  ~ConversionWorkspace();

  bool resumed() const { return resumed_; }
  /// The splats that an interrupted conversion has left; none: they are to be made.
  const std::optional<ScatteredSplats>& splats() const { return journal_.splats; }
  PartialFolder& partial() { return *partial_; }
  std::filesystem::path splatsFile() const { return splatsFileOf(scratch_->path(), 0); }
  /// The splats that a rank has scattered, in the scratch folder.
  static std::filesystem::path splatsFileOf(const std::filesystem::path& scratch, unsigned rank) {
    return scratch / (rank == 0 ? "splats.bin" : "splats." + std::to_string(rank) + ".bin");
  }
  const ConversionJournal& journal() const { return journal_; }
  const std::filesystem::path& scratch() const { return scratch_->path(); }

  void noteSplats(ScatteredSplats splats);
  /// They are not what they were.
  void forgetSplats();

  /// Bytes that the folders take already, for who asks whether there is room.
  uint64_t bytesInPartial() const;

  /// Leaves the folders for a later conversion if they are worth it. Returns whether they are.
  bool leaveForResuming();
  /// A conversion that was killed between putting its cache into place and clearFinished(): clears for it,
  /// and returns true. Facts as above.
  static bool clearIfFinished(const std::filesystem::path& output, const std::vector<ConversionFact>& facts);

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
