// The window on a cache: the picture, the panels, and the loop that joins them with the frame loop.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "render/camera/camera.h"
#include "render/frame/backend.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct ViewerOptions {
  ImageSize size{1200, 800};
  Backend backend = Backend::kAutomatic;
  std::optional<std::filesystem::path> state;  // else what is remembered of this cache
  std::optional<std::string> scalar;
  std::optional<uint64_t> memory_bytes;
  std::optional<double>
      target_s;  // for a picture while moving; else 33 ms with a graphics card, 100 ms without
};

/// Opens the window and returns when it is closed; half a second after `stopped` is, it closes the window and
/// throws Interrupted. Throws Error where there is no window to be had, and where the cache cannot be read
/// any more; UsageError for a scalar that the cache lacks.
void runViewer(const CacheReader& cache, const ViewerOptions& options, const Progress& stopped);

}  // namespace curvisplat
