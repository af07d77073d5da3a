#include "tools/viewer/state_files.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <cstdlib>
#include <system_error>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

std::string hashOf(const std::string& text) {
  return fmt::format("{:016x}", XXH3_64bits(text.data(), text.size()));
}

}  // namespace

std::optional<fs::path> configFolder() {
  const char* const config = std::getenv("XDG_CONFIG_HOME");
  if (config && *config == '/') return fs::path(config) / "curvisplat";
  const char* const home = std::getenv("HOME");
  if (home && *home) return fs::path(home) / ".config" / "curvisplat";
  return std::nullopt;
}

std::optional<fs::path> rememberedStateOf(const fs::path& cache) {
  const auto folder = configFolder();
  if (!folder) return std::nullopt;
  std::error_code ignored;
  fs::path whole = fs::weakly_canonical(cache, ignored);
  if (whole.filename().empty()) whole = whole.parent_path();
  return *folder / "views" / fmt::format("{}-{}.json", whole.stem().string(), hashOf(whole.string()));
}

fs::path keepFunction(const std::string& preset_text) {
  const auto folder = configFolder();
  if (!folder) throw Error("cannot find the settings directory: neither XDG_CONFIG_HOME nor HOME is set");
  const fs::path file = *folder / "functions" / (hashOf(preset_text) + ".json");
  writeState(file, preset_text);
  return file;
}

void writeState(const fs::path& file, const std::string& text) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) throw Error("{}: cannot create the directory: {}", file.parent_path().string(), error.message());
  writeFileDurably(file, text);
}

}  // namespace curvisplat
