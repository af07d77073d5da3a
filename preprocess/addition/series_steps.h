// Steps of a series in relation to one another: which earlier steps a step's values are predicted from
// (StepReferences), and how a whole series takes over steps that another process has converted into a part
// (makePart(), takeStep()).
//
// A part is a cache of its own to which one process adds some of the series' steps, while others add other
// steps to theirs. Later the steps are taken over as they are: their files get second names (hard links;
// copies where the file system has none).
//
//   part    step 0            a step that the whole series has as well, for its geometry; in no group of
//                             steps that are predicted from each other
//           steps 1, 2, ...   the part's own; groups (kStepGroup) begin with step 1
//
// Sets of scalars with blanks of their own (Manifest::own_blanks) are series by themselves, in parts as well. A step is added to them
// before it is added to the cache, so that readers, which see the steps that the cache has, never miss one.
//
// Same bytes: a step's files depend on its grid and on the steps that it is predicted from. takeStep()
// checks that these are the same steps in the part as in the whole series, and otherwise takes nothing. One
// thread calls, except for StepReferences.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {

/// Prepares the sets of scalars with blanks of their own for a further step: the manifest's checksums of them become such that hold
/// however many steps they have (kOwnBlanksOfSteps), and a step is removed that a killed or failed addition has left in some of
/// them. Throws Error.
void prepareSets(const std::filesystem::path& cache);

/// Makes a part in the folder `path`, which must not exist. Its step 0 is the first step of the geometry
/// that `series` is open at, with the time of the step that it is open at. Throws Error and Interrupted.
void makePart(const CacheReader& series, const std::filesystem::path& path, const Progress& progress);

/// Step `number` of a part, from 1 on.
struct PartStep {
  const CacheReader& part;  // at any step
  uint64_t number = 0;
  std::vector<std::string> sources;  // files that the series' manifest is to list
  bool states_time = true;           // otherwise it was counted on from the step before
};

/// Adds the step to the locked cache, after its last; prepareSets() comes before. Returns false, and changes nothing, if the step that
/// one process would have added is another one: then it has to be converted again. Throws Error if a file
/// cannot be written, and Interrupted; then, too, the cache is what it was. After NameNotSynced
/// (durable_file.h) it has the step.
bool takeStep(const CacheLock& lock, const PartStep& step, const Progress& progress);

/// A second name for a file, or a copy of it that is on the disk. Replaces what is at `to`. Throws Error and
/// Interrupted; then there is nothing at `to`.
void linkOrCopy(const std::filesystem::path& from, const std::filesystem::path& to, const Progress& progress);

/// The steps of a geometry come in groups of kStepGroup. The first of a group is coded alone; the second is
/// predicted from the first; the third from both, by carrying the change between them on. So any step
/// decodes from three streams at most, and it depends only on earlier steps, whatever is added later.
inline constexpr uint64_t kStepGroup = 3;

/// The steps of a series from which the next one on `geometry` is predicted, the nearest first; `series` may
/// have later steps than those before `next`. `leaves_out_first`: step 0 belongs to no group, as in a part
/// of a series.
std::vector<uint64_t> referenceSteps(const Series& series, uint32_t geometry, uint64_t next,
                                     bool leaves_out_first = false);

/// The values of a brick in the steps that a new one is predicted from. Immutable; any thread.
class StepReferences {
 public:
  /// Takes the values for a step that is about to be added to the series, on the geometry that `cache` is
  /// open at. Throws Error.
  explicit StepReferences(const CacheReader& cache, bool leaves_out_first = false);

  /// A thread's memory for what of() lends.
  struct Scratch {
    std::array<SplatVariable, 2> values;
  };
  /// Lent until the next call with the same scratch. Throws as CacheReader::readVariable().
  TimeReferences of(uint32_t brick, size_t variable, Scratch& scratch) const;

 private:
  std::array<uint8_t, 2> steps_back_{};
  std::vector<CacheReader> readers_;  // [reference]
};

}  // namespace curvisplat
