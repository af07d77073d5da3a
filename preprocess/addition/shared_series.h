// Further steps of a series, converted by several ranks: each rank converts whole steps, a group of steps that are
// predicted from each other (series_steps.h) at a time.
//
//    rank 0   the rest of the group that the cache is in --> the cache
//    rank 1   the next group --> a part (series_steps.h) --+
//    rank 2   the group after that --> a part ------------+--> rank 0 takes the steps over, in order
//
// A round ends when rank 0 has taken over all parts, or meets a step that a rank could not convert, or
// converted otherwise than one process would have. The next round begins after the last step that was taken
// over, so rank 0 converts that step.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/addition/add_step.h"
#include "preprocess/convert/conversion_workspace.h"
#include "stream/base/ranks.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {

/// Steps [begin, end) of an input.
struct StepSpan {
  uint64_t begin = 0, end = 0;
};

/// The steps that a rank has converted in a round.
struct ConvertedSteps {
  struct Step {
    bool states_time = true, new_geometry = false;
    uint64_t bytes = 0;
    std::vector<std::string> sources, warnings;
  };
  std::vector<Step> steps;
  std::string error;  // why the rank stopped early; empty: it did not
};

/// [rank] the steps that it converts in a round, from `next` on; those of the last ranks may be empty.
/// `in_group`: how many steps of the group of `next` the cache has already; 0 if `next` begins a group.
std::vector<StepSpan> dealSteps(uint64_t next, uint64_t count, uint64_t in_group, unsigned ranks);

/// Prefix of the names of the ranks' folders for temporary files; the rank's number follows. It differs from
/// that of any other cache, so several can use one --tmp.
std::string scratchNameOfRanks(const std::filesystem::path& cache);

/// Suffix of the folder of parts, which lies beside the cache; it ends with kPartialSuffix.
inline constexpr const char* kRanksSuffix = ".ranks.partial";

/// The parts of a series, in a folder beside its cache that is removed in the end.
class SharedSteps {
 public:
  /// `add`: the options of each step, with the cache of the series; parts have their own cache. All ranks
  /// construct it at the same time; rank 0 makes the folder. Throws Error.
  SharedSteps(const SeriesInput& input, AddStepOptions add, Ranks& ranks, Progress& progress);
  ~SharedSteps();
  SharedSteps(const SharedSteps&) = delete;
  SharedSteps& operator=(const SharedSteps&) = delete;

  /// The state of the cache when a round begins.
  struct Start {
    uint64_t step = 0;  // its last
    uint64_t expects_geometry = 0;
    uint64_t next = 0;  // of the input
    uint64_t in_group = 0;
  };
  /// Converts this rank's steps to its part, at ranks other than 0. Throws Interrupted.
  ConvertedSteps convertPart(const Start& start) const;
  /// Adds to the cache, at rank 0, the steps that rank `of` has converted, and calls `took` after each with
  /// its number in the input. Returns whether all steps of `range` were added.
  bool join(unsigned of, const StepSpan& range, const ConvertedSteps& converted,
            const std::function<void(uint64_t number, const AddStepReport&)>& took) const;

 private:
  std::filesystem::path partOf(unsigned rank) const;

  const SeriesInput& input_;
  AddStepOptions add_;  // a rank other than 0 has a folder of its own for temporary files
  Ranks& ranks_;
  Progress& progress_;
  const std::filesystem::path folder_;
  std::unique_ptr<PartialFolder> locked_;   // rank 0's
  std::unique_ptr<ScratchFolder> scratch_;  // of the others
};

/// Removes what killed ranks of an earlier conversion of this series have left. One process calls it. Throws
/// Error if ranks are converting the series now.
void removeLeftOfRanks(const std::filesystem::path& cache, const std::filesystem::path& temporary_folder);

Ranks::Bytes toBytes(const ConvertedSteps& converted);
ConvertedSteps convertedFrom(const Ranks::Bytes& bytes);

}  // namespace curvisplat
