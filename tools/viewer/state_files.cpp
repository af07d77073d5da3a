#include "tools/viewer/state_files.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"
#include "stream/base/message.h"

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

namespace {

constexpr size_t kMaxRecent = 12;

std::optional<fs::path> settingsFile() {
  const auto folder = configFolder();
  return folder ? std::optional(*folder / "window.json") : std::nullopt;
}

/// File names can be anything but a slash and a leading dot: those and % are written as %2f.
std::string fileNameOf(const std::string& name) {
  std::string file;
  for (const char c : name) {
    const bool plain =
        c != '/' && c != '%' && !(c == '.' && file.empty()) && static_cast<unsigned char>(c) >= 32;
    file += plain ? std::string(1, c) : fmt::format("%{:02x}", static_cast<unsigned char>(c));
  }
  return file;
}

std::string nameOfFile(const std::string& file) {
  std::string name;
  for (size_t n = 0; n < file.size(); ++n) {
    if (file[n] == '%' && n + 2 < file.size()) {
      name += static_cast<char>(std::strtol(file.substr(n + 1, 2).c_str(), nullptr, 16));
      n += 2;
    } else {
      name += file[n];
    }
  }
  return name;
}

fs::path viewFolderOf(const fs::path& cache) {
  const auto state = rememberedStateOf(cache);
  if (!state) throw Error("cannot find the settings directory: neither XDG_CONFIG_HOME nor HOME is set");
  return state->parent_path() / "saved" / state->stem();
}

}  // namespace

void WindowSettings::opened(std::vector<std::string> files) {
  std::erase(recent, files);
  recent.insert(recent.begin(), std::move(files));
  if (recent.size() > kMaxRecent) recent.resize(kMaxRecent);
}

WindowSettings readSettings() {
  WindowSettings settings;
  const auto file = settingsFile();
  std::error_code ignored;
  if (!file || !fs::exists(*file, ignored)) return settings;
  try {
    const JsonDocument document(readTextFile(*file), file->string(), "the settings of the window");
    const JsonField fields = document.root();
    settings.light_theme = fields.at("light_theme").flag();
    settings.text_scale = fields.at("text_scale").number(0.5, 4);
    for (const JsonField& files : fields.at("recent").elements(kMaxRecent)) {
      settings.recent.push_back(files.texts());
      if (settings.recent.back().empty()) settings.recent.pop_back();
    }
  } catch (const Error& error) {
    printMessage("warning: {}; using the default settings", error.what());
    return {};
  }
  return settings;
}

void writeSettings(const WindowSettings& settings) {
  const auto file = settingsFile();
  if (!file) return;
  const nlohmann::ordered_json json = {{"light_theme", settings.light_theme},
                                       {"text_scale", settings.text_scale},
                                       {"recent", settings.recent}};
  writeState(*file, json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

std::vector<std::string> savedViewsOf(const fs::path& cache) {
  std::vector<std::string> names;
  if (!configFolder()) return names;
  std::error_code error;
  for (fs::directory_iterator at(viewFolderOf(cache), error), end; !error && at != end; at.increment(error))
    if (at->path().extension() == ".json") names.push_back(nameOfFile(at->path().stem().string()));
  std::sort(names.begin(), names.end());
  return names;
}

fs::path savedViewOf(const fs::path& cache, const std::string& name) {
  return viewFolderOf(cache) / (fileNameOf(name) + ".json");
}

void writeState(const fs::path& file, const std::string& text) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) throw Error("{}: cannot create the directory: {}", file.parent_path().string(), error.message());
  writeFileDurably(file, text);
}

}  // namespace curvisplat
