// Whether a conversion's disks have room for it, before the first pass.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/splat_origin.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// What the conversion will need on disk, from a sample that is converted within `folder`, a new one in the conversion's own.
/// nullopt: that is not known. Throws Interrupted.
using EstimateNeeds = std::function<std::optional<DiskNeeds>(const std::filesystem::path& folder)>;

/// A conversion that has not begun its passes, or takes up what an interrupted one has left in its folders.
struct UncheckedConversion {
  const ConvertOptions& options;
  const SplatOrigin& origin;
  uint64_t nodes;
  const ConversionWorkspace& workspace;
  const EstimateNeeds& estimate;  // called only where the most that it may need does not fit; may be empty
};

/// Throws Error if the disks have too little room, unless options.check_disk_space is false; Interrupted.
void checkDiskOf(const UncheckedConversion& conversion, Progress& progress);

}  // namespace curvisplat
