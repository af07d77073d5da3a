// The conversion behind a kept cache: with all default options of `convert` but the precision; and before that of a large grid, one of a
// coarse sample of it, which can be shown within a second.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/codec/values_codec.h"
#include "tools/options/preview_folder.h"

namespace curvisplat {

/// Something to show before the cache is complete.
struct KeptPreview {
  std::filesystem::path cache, whole;  // what there is now, and what it will be
  uint64_t stride = 1;                 // it is of every stride-th index plane; 1: of all of them
  uint64_t lattice = 0;     // of a mesh: nodes of the lattice that stands for it along each axis; else 0
  bool first_step = false;  // of a series
  std::shared_ptr<const PreviewFolder> folder;  // of `cache`, which is there while this is held
};

/// Who is told of a conversion. Called from the thread that converts.
struct KeptCacheEvents {
  std::function<void(const std::string&)> say = [](const std::string&) {};  // warnings and notes
  std::function<void(const KeptPreview&)> preview = {};                     // empty: none is made
};

/// Grids with more nodes or cells than this get a preview, of about a quarter of it: a second of conversion at most.
inline constexpr uint64_t kNodesWithoutPreview = 1'000'000;

/// Converts the grid or the series of time steps in `files` to `output`, which is complete or does not exist. Previews
/// and scratch files are in the same folder, and go with it; a preview stays while it is held. A series stays in the
/// folder of its preview, and `output` links to it. Previews of a series are of its first step: a coarse one, if it is
/// large, then the step as converted. Throws Error as opening and converting do, Interrupted once
/// `progress` is stopped.
void makeKeptCache(const std::vector<std::filesystem::path>& files, const std::filesystem::path& output,
                   Progress& progress, const KeptCacheEvents& events,
                   ValuePrecision precision = ValuePrecision::kNormal);

}  // namespace curvisplat
