// Series whose steps several processes convert without knowing of each other (`convert --part i/n`), and what joins them.
// Each writes a part (series_steps.h) into NAME.splats.parts, the folder beside the cache-to-be:
//
//    NAME.splats.parts/3of8.splats   step 0, and the third eighth of the further steps
//    NAME.splats.parts/3of8.json     once that is complete: which steps it has
//
// The first part has no step twice: it begins as the series does.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Part `index` (from 0) of `count`.
struct SeriesPart {
  uint64_t index = 0, count = 1;
};

/// The places in a series of `steps` of the steps that a part converts: whole groups, one after the other. Empty if
/// there is nothing to do.
std::vector<uint64_t> placesOfPart(const SeriesPart& part, uint64_t steps);

std::filesystem::path partsFolder(const std::filesystem::path& cache);
std::filesystem::path partCache(const std::filesystem::path& folder, const SeriesPart& part);

/// Makes the folder, if no other part has. Throws Error.
void makePartsFolder(const std::filesystem::path& folder);

/// Removes what an earlier conversion of the part has noted: before its cache changes. Throws Error.
void removePartRecord(const std::filesystem::path& folder, const SeriesPart& part);

/// Notes that a part is complete: `origins` has its steps, one for each of placesOfPart(). Throws Error.
void writePartRecord(const std::filesystem::path& folder, const SeriesPart& part, uint64_t steps,
                     const std::vector<StepOrigin>& origins);

/// The folder with the parts of a series, and the cache that they are joined to.
struct JoinOptions {
  std::filesystem::path folder, output;
  bool overwrite = false;
};

/// Counts of what was joined.
struct JoinReport {
  uint64_t parts = 0, steps = 0, geometries = 0;
};

/// Joins all parts in the folder to a cache with the bytes that one process would have written. The parts stay. Throws
/// Error, which names a part that is missing or unfinished, or a step that one process would have coded otherwise.
JoinReport joinParts(const JoinOptions& options, Progress& progress);

}  // namespace curvisplat
