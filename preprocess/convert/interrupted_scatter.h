// What a scatter pass notes from time to time in the conversion's journal, and how another one goes on from there. The
// slabs that were done are read again, but of their splats only those are made that wait for the seams.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/scattered_splats.h"
#include "preprocess/convert/splat_origin.h"

namespace curvisplat {

/// Notes that are due every `interval`, or less often: writing them takes a twentieth of the time at most. `write` gets
/// what there is to note. `from`: see ScatterNotes; must outlive them.
ScatterNotes timedNotes(std::chrono::milliseconds interval, const ScatterState* from,
                        const std::function<void(const ScatterState&)>& write);

/// The file of splats that an interrupted scatter has left, to append to. Throws LostBuckets if it is damaged, or was
/// made with more memory than `plan` has.
std::unique_ptr<BucketFile> openScattered(const std::filesystem::path& file, const ScatteredSplats& left,
                                          const MemoryPlan& plan);

}  // namespace curvisplat
