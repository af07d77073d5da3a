// A part of a series: a cache of its own to which one process adds some of the series' steps, while others add other
// steps to theirs. Later the steps are taken over into the whole series, as they are: their files get second names
// (hard links; copies where the file system has none).
//
//   part    step 0                a step that the whole series has as well, for its geometry; in no group of steps that are
//                                 predicted from each other
//           steps 1, 2, ...       the part's own; groups (step_references.h) begin with step 1
//
// Same bytes: a step's files depend on its grid and on the steps that it is predicted from. takeStep() checks that these
// are the same steps in the part as in the whole series, and otherwise takes nothing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/cache_lock.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Makes a part in the folder `path`, which must not exist. Its step 0 is the first step of the geometry that `series` is
/// open at. Throws Error and Interrupted.
void makePart(const CacheReader& series, const std::filesystem::path& path, const Progress& progress);

/// Step `number` of a part, from 1 on.
struct PartStep {
  const CacheReader& part;  // at any step
  uint64_t number = 0;
  std::vector<std::string> sources;  // files that the series' manifest is to list
  bool states_time = true;           // otherwise it was counted on from the step before
};

/// Adds the step to the locked cache, after its last. Returns false, and changes nothing, if the step that one process
/// would have added is another one: then it has to be converted again. Throws Error if a file cannot be written, and
/// Interrupted; then, too, the cache is what it was. After NameNotSynced (durable_file.h) it has the step.
bool takeStep(const CacheLock& lock, const PartStep& step, const Progress& progress);

/// A second name for a file, or a copy of it that is on the disk. Replaces what is at `to`. Throws Error and Interrupted;
/// then there is nothing at `to`.
void linkOrCopy(const std::filesystem::path& from, const std::filesystem::path& to, const Progress& progress);

}  // namespace curvisplat
