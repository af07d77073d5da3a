// A further scalar of a series of time steps: the series is converted again with it, and takes the place of the old one once it
// is complete.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/formats/open/series_files.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// The steps that `files` make, the grid first; patterns may be among them. Throws Error.
std::vector<StepFiles> stepsOfFiles(const std::vector<std::filesystem::path>& files);

/// Converts all steps of `files` again, with the scalars that the cache has and `name`, in a folder beside the cache; takes the time
/// and the space of converting the series. Throws Error as converting does, and if the cache was made from other files or
/// with options of `convert` that it does not record, and Interrupted once `progress` is stopped; then the cache is as it was.
void addScalarToSeries(const std::filesystem::path& cache, const std::vector<std::filesystem::path>& files,
                       const std::string& name, Progress& progress);

}  // namespace curvisplat
