// The folders that a conversion works in: its own, those that ranks share, the files of an interrupted
// conversion that it finds there, and whether the disks have space for it.
//
//    NAME.splats.partial/  beside the output, locked: the cache as it grows, and
//      journal             what is converted, where the scratch folder is, and the splats once all are there
//      bricks.log          the bricks that have been appended (CacheWriter)
//    NAME.splats.tmp.<..>/ in the temporary folder: splats.bin, a sample of them, and what buckets are divided into
//
//    begun --noteSplats()--> splats on disk --> bricks appended --CacheWriter::finish()--> in place
//      ^                          |  ^             | one by one
//      +------- lost by the disk -+  +-- goes on --+
//
// A process may die at any moment, so a conversion that resumes checks all files that it finds. It resumes
// only if all splats, or some bricks, are there. Otherwise it removes the files and starts anew. One thread
// calls.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/splat_origin.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {

/// The folder of a conversion's temporary files: made for it, and removed with all in it when it ends,
/// unless another conversion is to go on with them.
class ScratchFolder {
 public:
  /// Prefix of the names of a cache's temporary folders: its own name, cut so that what follows still fits
  /// within the 255 bytes of a file name.
  static std::string beginOfName(const std::filesystem::path& cache);
  /// A name that no other process uses: `parent`/`name`.<process number>.<n>
  static std::filesystem::path newPath(const std::filesystem::path& parent, const std::string& name);
  /// Whether `path` is a folder, and not a link, that newPath() has named from `name`.
  static bool isOne(const std::filesystem::path& path, const std::string& name);

  enum class Folder { kMake, kTakeOver };
  /// Makes the folder, which must not exist, or takes over one that was left. Throws Error if it cannot.
  ScratchFolder(std::filesystem::path path, Folder folder);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// The destructor leaves the folder.
  void leave() { leave_ = true; }

 private:
  std::filesystem::path path_;
  bool leave_ = false;
};

/// Returns at every rank the absolute path of rank 0's `folder`, on a file system that all ranks share. All
/// ranks call it. Throws Error at a rank that does not see the folder.
std::filesystem::path sharedFolder(const std::filesystem::path& folder, Ranks& ranks);

/// Makes an empty folder in `shared` for this rank's own temporary files; a single process uses `shared`
/// itself. Returns when all ranks have theirs. All ranks call it. Throws Error if the folder cannot be made.
std::filesystem::path makeFolderOfRank(const std::filesystem::path& shared, Ranks& ranks);

/// Removes this rank's folder, and the shared one if it is empty: when rank 0 fails, others still write into
/// the shared folder, so the last rank has to remove it.
void removeFolderOfRank(const std::filesystem::path& own, const std::filesystem::path& shared) noexcept;

/// How to treat an unfinished conversion to the same output.
enum class Unfinished {
  kRefuse,  // an error, if finished work would be lost
  kResume,
  kRemove,
};

/// The folders of one conversion, with its journal.
class ConversionWorkspace {
 public:
  /// Makes the folders, or takes over those of an interrupted conversion. Throws Error if the output may not
  /// be replaced, another conversion to it is running, an interrupted one is in the way, or the one to be
  /// resumed had other `facts`.
  ConversionWorkspace(const std::filesystem::path& output, bool overwrite, Unfinished unfinished,
                      const std::filesystem::path& temporary_folder, std::vector<ConversionFact> facts);
  /// Removes the folders unless leaveForResuming() was called; once the cache is in place, only the
  /// temporary files that are left.
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
  /// Forgets the splats on disk, after LostBuckets: their file is missing or damaged.
  void forgetSplats();

  /// Bytes of the files in the partial folder; the rest of the cache needs that much less disk space.
  uint64_t bytesInPartial() const;

  /// Leaves the folders for a later conversion if they hold splats or bricks. Returns whether they do.
  bool leaveForResuming();
  /// Removes the files of a conversion that was killed after its cache was in place and before
  /// clearFinished(), and returns the facts of that conversion; nullopt if there is none.
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

/// Estimates the disk space that the conversion will need, from a sample that is converted within `folder`, a
/// new one in the conversion's own. nullopt: unknown. Throws Interrupted.
using EstimateNeeds = std::function<std::optional<DiskNeeds>(const std::filesystem::path& folder)>;

/// A conversion that has not begun its passes, or takes up what an interrupted one has left in its folders.
struct UncheckedConversion {
  const ConvertOptions& options;
  const SplatOrigin& origin;
  uint64_t nodes;
  const ConversionWorkspace& workspace;
  const EstimateNeeds& estimate;  // called only if the upper bound of its needs does not fit; may be empty
};

/// Checks the space on disk before the first pass. Throws Error if the disks have too little space, unless
/// options.check_disk_space is false; Interrupted.
void checkDiskOf(const UncheckedConversion& conversion, Progress& progress);

}  // namespace curvisplat
