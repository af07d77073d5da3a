// The origin of the splats of a grid or a mesh.
#pragma once

#include <cstdint>
#include <memory>

#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// `source` and the options' ranks must outlive it.
std::unique_ptr<SplatOrigin> originOf(const DataSource& source, const ConvertOptions& options,
                                      const MemoryPlan& plan, const ScratchFiles& scratch);

/// How many samples it has. Throws Error if these are too many to convert.
uint64_t nodesOf(const SplatOrigin& origin);

}  // namespace curvisplat
