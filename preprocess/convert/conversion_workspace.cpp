#include "preprocess/convert/conversion_workspace.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <regex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/faces/grid_faces_pass.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {

std::string ScratchFolder::beginOfName(const std::filesystem::path& cache) {
  constexpr size_t kMaxBytes =
      200;  // of the 255 of most file systems; others append 36, process and number included
  return cache.filename().string().substr(0, kMaxBytes);
}

std::filesystem::path ScratchFolder::newPath(const std::filesystem::path& parent, const std::string& name) {
  static std::atomic<unsigned> made = 0;  // several conversions in one process, as in tests
  return parent / fmt::format("{}.{}.{}", name, ::getpid(), made++);
}

bool ScratchFolder::isOne(const std::filesystem::path& path, const std::string& name) {
  static const std::regex rest(R"(\.\d+\.\d+)");
  const std::string found = path.filename().string();
  std::error_code ignored;
  return found.starts_with(name) && std::regex_match(found.substr(name.size()), rest) &&
         std::filesystem::is_directory(std::filesystem::symlink_status(path, ignored));
}

ScratchFolder::ScratchFolder(std::filesystem::path path, Folder folder) : path_(std::move(path)) {
  if (folder == Folder::kTakeOver) return;
  try {
    makeFolder(path_, 0700);  // as those of the system's temporary files: it may be made among them
  } catch (const DiskFull&) {
    throw;
  } catch (const Error& error) {
    throw Error("{}; temporary files go there: choose another directory with --tmp", error.what());
  }
}

ScratchFolder::~ScratchFolder() {
  if (!leave_) removeAll(path_);
}

std::filesystem::path sharedFolder(const std::filesystem::path& folder, Ranks& ranks) {
  std::string name;
  if (ranks.isFirst()) name = std::filesystem::absolute(folder).string();
  const auto sent = fromBytes<char>(ranks.broadcast(toBytes(std::vector<char>(name.begin(), name.end()))));
  const std::filesystem::path shared(std::string(sent.begin(), sent.end()));
  if (!std::filesystem::is_directory(shared))
    throw Error("{}: does not exist here; several ranks need a file system that they share", shared.string());
  ranks.barrier();  // before the first may fail, and remove it
  return shared;
}

std::filesystem::path makeFolderOfRank(const std::filesystem::path& shared, Ranks& ranks) {
  if (ranks.alone()) return shared;
  const std::filesystem::path own = shared / fmt::format("rank{}", ranks.rank());
  removeAll(own);
  makeFolder(own);
  try {
    ranks.barrier();  // before one may fail, and remove the shared folder as empty
  } catch (...) {
    removeFolderOfRank(own, shared);
    throw;
  }
  return own;
}

void removeFolderOfRank(const std::filesystem::path& own, const std::filesystem::path& shared) noexcept {
  removeAll(own);
  std::error_code not_empty;
  std::filesystem::remove(shared, not_empty);
}

namespace {

namespace fs = std::filesystem;

std::string scratchName(const fs::path& output) {
  return ScratchFolder::beginOfName(output) + ".tmp";
}

/// Whether what the journal names can be the folder of temporary files of a conversion to `output`, in which
/// files may be removed.
bool isScratch(const fs::path& folder, const fs::path& output) {
  return ScratchFolder::isOne(folder, scratchName(output));
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
      if (journal_.splats) try {
          readSample(scratch(), *journal_.splats);
        } catch (const Error&) {
          forgetSplats();
        }
      partial_->leave(false);
      return;
    }
  } else {
    removeScratch(journal_, output);
    partial_->clear();
  }
  // The journal names the folder before it is made, so that no kill leaves one that is not known.
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
  if (journal_.splats) kept.insert(scratch() / journal_.splats->sample_file);
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
  const fs::path before = journal_.splats ? scratch() / journal_.splats->sample_file : fs::path();
  writeSample(scratch(), splats);
  journal_.splats = std::move(splats);
  writeJournalNow();
  if (!before.empty() && before != scratch() / journal_.splats->sample_file) removeFile(before);
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
  removeFileIfThere(partial_->target() / kJournalName);
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
  for (const char* name : {kBrickLogName, kPartialLock, kJournalName}) removeFileIfThere(output / name);
  return std::move(journal->facts);
}

namespace {

/// `needs` of the whole, less what an interrupted conversion has left, with what else the passes write.
DiskNeeds leftOf(const UncheckedConversion& conversion, DiskNeeds needs, const TemporaryNeeds& temporary) {
  const auto& [options, origin, nodes, workspace, estimate] = conversion;
  if (workspace.splats())
    needs.temporary_bytes -= std::min(needs.temporary_bytes, workspace.splats()->buckets.size);
  if (workspace.hasAllSplats()) needs.temporary_bytes = 0;
  if (!options.ranks->alone())
    needs.temporary_bytes += needs.cache_bytes;  // the bricks of each, before they are joined
  if (options.surfaces)
    needs.temporary_bytes +=
        temporaryBytesOfFaces(origin.description(), options.planes, options.scalars.size());
  needs.cache_bytes -= std::min(needs.cache_bytes, workspace.bytesInPartial());
  return with(temporary, needs);
}

DiskNeeds likelyNeeds(const UncheckedConversion& conversion, const DiskNeeds& most) {
  const auto likely =
      conversion.estimate ? conversion.estimate(conversion.workspace.scratch() / "sample") : std::nullopt;
  if (!likely) return most;
  return {std::min(likely->temporary_bytes, most.temporary_bytes),
          std::min(likely->cache_bytes, most.cache_bytes), 0};
}

}  // namespace

void checkDiskOf(const UncheckedConversion& conversion, Progress& progress) {
  const auto& [options, origin, nodes, workspace, estimate] = conversion;
  if (!options.check_disk_space) return;
  const auto needsOf = [&, splats = nodes](const TemporaryNeeds& temporary) {
    return diskNeeds(std::max(splats, temporary.splats), conversion.options.scalars.size());
  };
  const TemporaryNeeds most_temporary =
      workspace.hasAllSplats() ? TemporaryNeeds{} : origin.mostTemporaryNeeds();
  const std::filesystem::path folder = temporaryFolder(options);
  if (hasDiskSpace(leftOf(conversion, needsOf(most_temporary), most_temporary), options.output, folder))
    return;
  const TemporaryNeeds forecast =
      workspace.hasAllSplats() ? TemporaryNeeds{} : origin.temporaryNeeds(progress);
  checkDiskSpace(leftOf(conversion, likelyNeeds(conversion, needsOf(forecast)), forecast), options.output,
                 folder, options.full_disk_hint.empty() ? kSmallDiskHint : options.full_disk_hint);
}

}  // namespace curvisplat
