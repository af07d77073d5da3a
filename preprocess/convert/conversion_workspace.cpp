#include "preprocess/convert/conversion_workspace.h"

#include <set>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/brick_log.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

std::string scratchName(const fs::path& output) {
  return ScratchFolder::beginOfName(output) + ".tmp";
}

/// Whether what the journal names can be the folder of temporary files of a conversion to `output`, in which
/// files may be removed.
bool isScratch(const fs::path& folder, const fs::path& output) {
  std::error_code ignored;
  return folder.filename().string().starts_with(scratchName(output) + ".") &&
         fs::is_directory(fs::symlink_status(folder, ignored));
}

/// Removes the temporary files of a dead conversion to `output`; whatever else the journal may name stays.
void removeScratch(const ConversionJournal& journal, const fs::path& output) {
  if (isScratch(journal.scratch, output)) removeAll(journal.scratch);
}

bool hasBricks(const fs::path& folder) {
  std::error_code error;
  const auto size = fs::file_size(folder / kBrickLogName, error);
  return !error && size > 0;
}

}  // namespace

ConversionWorkspace::ConversionWorkspace(const fs::path& output, bool overwrite, Unfinished unfinished,
                                         const fs::path& temporary_folder, std::vector<ConversionFact> facts)
    : partial_(std::make_unique<PartialFolder>(output, overwrite, PartialFolder::Rest::kKeep)) {
  std::optional<ConversionJournal> found = readJournal(partial_->path());
  if (found) journal_ = std::move(*found);
  if (found && worthResuming() && unfinished != Unfinished::kRemove) {
    if (unfinished == Unfinished::kRefuse)
      throw Error(
          "{}: is an unfinished conversion to this output; continue it with --resume, or start anew with "
          "--overwrite",
          partial_->path().string());
    const std::string difference = differenceOf(journal_.facts, facts);
    if (!difference.empty())
      throw Error("{}: cannot be resumed: {}; start anew with --overwrite instead of --resume",
                  partial_->path().string(), difference);
    resumed_ = true;
    if (isScratch(journal_.scratch, output)) {
      scratch_ = std::make_unique<ScratchFolder>(journal_.scratch, ScratchFolder::Folder::kTakeOver);
      removeDividedBuckets();
      partial_->leave(false);
      return;
    }
  } else {
    removeScratch(journal_, output);
    partial_->clear();
  }
  // Noted before it is made: no kill leaves one behind that no one knows of.
  journal_ = {std::move(facts), ScratchFolder::newPath(fs::absolute(temporary_folder), scratchName(output)),
              std::nullopt};
  writeJournalNow();
  scratch_ = std::make_unique<ScratchFolder>(journal_.scratch, ScratchFolder::Folder::kMake);
  partial_->leave(false);
}

void ConversionWorkspace::removeDividedBuckets() const {
  const size_t files = journal_.splats ? 1 + journal_.splats->buckets_of_ranks.size() : 0;
  std::set<fs::path> kept;
  for (unsigned rank = 0; rank < files; ++rank) kept.insert(splatsFileOf(scratch(), rank));
  for (const auto& entry : fs::directory_iterator(scratch())) {
    if (kept.contains(entry.path())) continue;
    if (entry.is_directory() && !entry.is_symlink())
      removeAll(entry.path());  // a rank's bricks
    else
      removeFile(entry.path());
  }
}

bool ConversionWorkspace::worthResuming() const {
  return journal_.splats || hasBricks(partial_->path());
}

void ConversionWorkspace::noteSplats(ScatteredSplats splats) {
  journal_.splats = std::move(splats);
  writeJournalNow();
}

void ConversionWorkspace::forgetSplats() {
  journal_.splats.reset();
  writeJournalNow();
}

uint64_t ConversionWorkspace::bytesInPartial() const {
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(partial_->path()))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

bool ConversionWorkspace::leaveForResuming() {
  if (partial_->isInPlace() || !worthResuming()) return false;
  partial_->leave();
  scratch_->leave();
  return true;
}

void ConversionWorkspace::clearFinished() {
  scratch_.reset();
  removeAll(partial_->target() / kJournalName);
}

ConversionWorkspace::~ConversionWorkspace() {
  if (partial_->isInPlace()) clearFinished();
}

std::optional<std::vector<ConversionFact>> ConversionWorkspace::clearKilled(const fs::path& output) {
  if (!fs::exists(output / "manifest.json")) return std::nullopt;
  std::optional<ConversionJournal> journal = readJournal(output);
  if (!journal) return std::nullopt;
  // In the partial folder may be what is left of the cache that was replaced, or a conversion that is newer.
  PartialFolder replaced(output, true, PartialFolder::Rest::kKeep);
  if (readJournal(replaced.path())) return std::nullopt;
  replaced.clear();
  removeScratch(*journal, output);
  for (const char* name : {kBrickLogName, kPartialLock, kJournalName}) removeAll(output / name);
  return std::move(journal->facts);
}

}  // namespace curvisplat
