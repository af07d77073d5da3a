// `curvisplat view`: a window on a cache.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/options/option_parsers.h"
#include "tools/output/progress_bar.h"
#include "tools/output/stop_signals.h"
#include "tools/viewer/viewer.h"

namespace curvisplat {
namespace {

struct ViewWords {
  std::filesystem::path cache;
  std::string size = "1200x800", backend = "auto";
  std::optional<std::filesystem::path> state;
  std::optional<std::string> scalar, memory, frame_time;
};

void view(const ViewWords& words) {
  ViewerOptions options;
  options.size = parseImageSize("--size", words.size);
  options.backend = parseBackend(words.backend);
  options.state = words.state;
  options.scalar = words.scalar;
  if (words.memory) options.memory_bytes = parseMemory("--memory", *words.memory);
  if (words.frame_time) options.target_s = parsePositive("--frame-time", *words.frame_time) / 1000;
  const CacheReader cache(words.cache);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  try {
    runViewer(cache, options, progress);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());  // the cache decides, not the words
  }
}

}  // namespace

void addView(CLI::App& app) {
  auto words = std::make_shared<ViewWords>();
  CLI::App* command = app.add_subcommand("view", "Open a window on a cache");
  command->add_option("CACHE", words->cache, "The splat cache, a folder NAME.splats")->required();
  command->add_option("--size", words->size, "WIDTHxHEIGHT of the window")->capture_default_str();
  command->add_option("--scalar", words->scalar, "Name of the scalar; the one of the last time otherwise");
  command->add_option("--state", words->state,
                      "Camera, function and all else from FILE.json; as they were the last time otherwise");
  command->add_option("--backend", words->backend, "auto, osmesa, egl or cpu: what draws; see info --system")
      ->capture_default_str();
  command->add_option("--memory", words->memory, "Memory for the data in flight: 512M, 2G");
  command->add_option("--frame-time", words->frame_time,
                      "Milliseconds for a picture while moving; 33 with a graphics card, 100 without");
  command->callback([words] { view(*words); });
}

}  // namespace curvisplat
