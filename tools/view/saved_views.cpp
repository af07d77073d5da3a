#include "tools/view/saved_views.h"

#include <fmt/format.h>
#include <xxhash.h>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <system_error>
#include <utility>

#include "render/colour/function_parts.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"
#include "stream/base/os.h"
#include "stream/base/text.h"
#include "stream/cache/faces_file.h"

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

std::optional<fs::path> rememberedFilmOf(const fs::path& cache) {
  const auto state = rememberedStateOf(cache);
  return state ? std::optional(state->parent_path() / (state->stem().string() + "_film.json")) : std::nullopt;
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
    if (const auto folder = fields.find("data_folder")) settings.data_folder = folder->text();
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
                                       {"recent", settings.recent},
                                       {"data_folder", settings.data_folder}};
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
  makePrivateFolders(file.parent_path());
  writeFileDurably(file, text);
}

namespace {

constexpr int kDigits = 6;  // of the picture's height, or of the number itself

std::string numbers(const glm::dvec3& point, double scale) {
  const auto part = [scale](double x) { return roundedTo(x, scale, kDigits); };
  return fmt::format("{},{},{}", part(point.x), part(point.y), part(point.z));
}

std::string number(double value) {
  return fmt::format("{}", value == 0 ? 0 : roundedTo(value, std::abs(value), kDigits));
}

/// A title as --title takes it, in which braces begin and end fields.
std::string withoutFields(const std::string& title) {
  std::string text;
  for (const char c : title) text.append(c == '{' || c == '}' ? 2 : 1, c);
  return text;
}

class CommandLine {
 public:
  explicit CommandLine(std::string begin) : text_(std::move(begin)) {}
  void add(const std::string& option, const std::string& value) {
    text_ += ' ';
    text_ += shellOption(option, value);
  }
  void add(const std::string& flag) { text_ += " " + flag; }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void addFunction(const EditedFunction& function, const std::filesystem::path& file, CommandLine& words) {
  const auto parts = function.parts(true);
  if (!parts) return words.add("--tf", file.string());
  words.add("--tf", parts->map);
  words.add("--range", fmt::format("{},{}", parts->range.first, parts->range.second));
  if (parts->asinh) words.add("--asinh", fmt::format("{},{}", parts->asinh->centre, parts->asinh->width));
}

void addOpacities(const EditedFunction& function, CommandLine& words) {
  const auto parts = function.parts(true);
  if (parts && !parts->opacities.empty()) words.add("--opacity", textOf(parts->opacities));
  words.add("--opacity-unit", number(function.opacityUnit()));
}

/// Adds the functions, in pictures of two scalars the colours of one and the opacities of the other.
void addFunctions(const ViewState& state, const CommandOptions& options, CommandLine& words) {
  const bool of_film = !options.film.empty();
  if (!of_film) addFunction(state.function, options.function_file, words);
  if (!state.opacity_by && !of_film) addOpacities(state.function, words);
  if (!state.opacity_by) return;
  const auto& [variable, function] = *state.opacity_by;
  words.add("--opacity-by", variable);
  if (const auto parts = function.parts(true)) {
    words.add("--opacity-range", fmt::format("{},{}", parts->range.first, parts->range.second));
    if (parts->asinh)
      words.add("--opacity-asinh", fmt::format("{},{}", parts->asinh->centre, parts->asinh->width));
  } else {
    words.add("--opacity-tf", options.opacity_file.string());
  }
  addOpacities(function, words);
}

/// Half the height of what is seen at the focal point.
double halfHeight(const Camera& camera) {
  if (camera.projection != Projection::kPerspective) return camera.parallel_scale;
  return glm::length(camera.position - camera.focal_point) *
         std::tan(0.5 * glm::radians(camera.view_angle_deg));
}

void addCamera(const Camera& camera, CommandLine& words) {
  const bool perspective = camera.projection == Projection::kPerspective;
  const double half_height = halfHeight(camera);
  words.add("--position", numbers(camera.position, half_height));
  words.add("--focal-point", numbers(camera.focal_point, half_height));
  if (camera.view_up != glm::dvec3(0, 0, 1)) words.add("--view-up", numbers(camera.view_up, 1));
  if (perspective)
    words.add("--view-angle", number(camera.view_angle_deg));
  else
    words.add("--parallel-scale", number(camera.parallel_scale));
}

std::string text(const ClipPlane& plane) {
  const double size = std::max({1e-300, glm::length(plane.point)});
  return numbers(plane.point, size) + "," + numbers(plane.normal, glm::length(plane.normal));
}

void addCuts(const ViewState& state, CommandLine& words) {
  if (state.clip_box) {
    const auto& [lower, upper] = *state.clip_box;
    const double size = glm::length(upper - lower);
    const auto part = [size](double x) { return roundedTo(x, size, kDigits); };
    words.add("--clip-box", fmt::format("{},{},{},{},{},{}", part(lower.x), part(upper.x), part(lower.y),
                                        part(upper.y), part(lower.z), part(upper.z)));
  }
  for (const ClipPlane& plane : visiblePlanes(state.clip_planes)) words.add("--clip-plane", text(plane));
}

std::string text(const SheetOpacity& opacity) {
  if (!opacity.by_function) return number(opacity.factor);
  return opacity.factor == 1 ? "function" : "function*" + number(opacity.factor);
}

/// Adds an option for each surface, if any is not opaque.
void addSurfaceOpacities(const ViewState& state, CommandLine& words) {
  std::vector<SheetOpacity> opacities;
  for (const SurfaceFile& surface : state.surfaces)
    if (surface.visible) opacities.push_back({surface.opacity});
  for (const NamedFaces& named : state.faces)
    if (named.visible) opacities.push_back(state.opacityOf(named));
  if (std::all_of(opacities.begin(), opacities.end(), [](const SheetOpacity& one) { return one.opaque(); }))
    return;
  for (const SheetOpacity& opacity : opacities) words.add("--surface-opacity", text(opacity));
}

std::string hexText(const glm::vec3& colour) {
  const glm::ivec3 rgb(255.0f * colour + 0.5f);
  return fmt::format("#{:02x}{:02x}{:02x}", rgb.r, rgb.g, rgb.b);
}

/// Adds options for the isosurfaces that are drawn: --iso once for each scalar.
void addIsosurfaces(const ViewState& state, CommandLine& words) {
  const std::vector<std::vector<Isosurface>> groups = state.drawnIsosurfaces();
  std::vector<std::string> colours;
  for (const std::vector<Isosurface>& group : groups) {
    std::vector<double> values;
    for (const Isosurface& one : group) {
      values.push_back(one.value);
      colours.push_back(one.colour ? hexText(*one.colour) : "function");
    }
    const std::string& scalar = group.front().scalar;
    words.add("--iso", fmt::format("{}{}{}", scalar == state.opacityScalar() ? "" : scalar,
                                   scalar == state.opacityScalar() ? "" : "=", fmt::join(values, ",")));
  }
  if (std::ranges::any_of(colours, [](const std::string& colour) { return colour != "function"; }))
    words.add("--iso-colour", fmt::format("{}", fmt::join(colours, ",")));
  if (!groups.empty() && !state.iso_opacity.opaque()) words.add("--iso-opacity", text(state.iso_opacity));
}

/// Adds options for surfaces, slices (but for a film's) and isosurfaces, except for those that are hidden.
void addSurfaces(const ViewState& state, bool has_slices, CommandLine& words) {
  std::vector<std::string> colours;
  const auto add = [&](const std::string& name, const glm::vec3& colour) {
    words.add("--surface", name);
    colours.push_back(hexText(colour));
  };
  for (const SurfaceFile& surface : state.surfaces)
    if (surface.visible) add(shortPath(surface.path).string(), surface.colour);
  for (const NamedFaces& named : state.faces)
    if (named.visible) add(named.name, named.colour);
  // Given once, or once for each surface; faces that show a scalar need none.
  const bool has_own_colours = std::ranges::any_of(state.surfaces, &SurfaceFile::visible) ||
                               std::ranges::any_of(state.faces, [](const NamedFaces& one) {
                                 return one.visible && one.name == kBlanks;
                               });
  if (!state.faces_by || has_own_colours)
    for (const std::string& colour : colours) words.add("--surface-colour", colour);
  addSurfaceOpacities(state, words);
  if (state.faces_by && !state.faceNames().faces.empty()) words.add("--surface-by", state.faces_by->variable);
  if (!state.hasSheets()) return;
  const std::vector<ClipPlane> slices = visiblePlanes(state.slices);
  if (has_slices)
    for (const ClipPlane& plane : slices) words.add("--slice", text(plane));
  if (!state.slice_opacity.opaque() && !slices.empty())
    words.add("--slice-opacity", text(state.slice_opacity));
  addIsosurfaces(state, words);
  if (!state.drawsVolume()) words.add("--volume", "off");
}

}  // namespace

bool needsFile(const EditedFunction& function) {
  return !function.parts();
}

std::string programWord() {
  const fs::path program = os::programFile();
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  std::error_code ignored;
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path found = fs::path(folder) / "curvisplat";
    if (fs::equivalent(found, program, ignored)) return "curvisplat";
    if (fs::exists(found, ignored)) break;  // another one
  }
  return program.empty() ? "curvisplat" : shellWord(program.string());
}

std::filesystem::path shortPath(const std::filesystem::path& path) {
  std::error_code ignored;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(path, ignored);
  const std::filesystem::path relative =
      whole.lexically_relative(std::filesystem::weakly_canonical(".", ignored));
  return relative.empty() || *relative.begin() == ".." ? whole : relative;
}

std::string renderCommand(const ViewState& state, const CommandOptions& options) {
  std::string files = shellWord(options.cache.string());
  for (const std::filesystem::path& file : options.solutions)
    files += fmt::format(" {}", shellWord(file.string()));
  const bool of_film = !options.film.empty(), is_movie = options.turn_frames > 0 || of_film;
  CommandLine words(
      fmt::format("{} render {} -o {}", options.program, files, is_movie ? "movie.mp4" : "picture.png"));
  if (options.precision != ValuePrecision::kAuto) words.add("--value-precision", wordOf(options.precision));
  const int multiple = is_movie ? 2 : 1;  // an .mp4 has an even width and height
  words.add("--size", fmt::format("{}x{}", options.size.width / multiple * multiple,
                                  options.size.height / multiple * multiple));
  words.add("--scalar", state.variable);
  addFunctions(state, options, words);
  if (of_film) {
    words.add("--path", options.film.string());
    words.add("--frames", std::to_string(options.film_frames));
  } else {
    addCamera(state.camera, words);
  }
  if (options.turn_frames > 0) words.add("--orbit", "360");
  if (options.turn_frames > 0 && options.turn_frames != kTurnFrames)
    words.add("--frames", std::to_string(options.turn_frames));
  if (is_movie && options.frames_per_s != kFramesPerSecond)
    words.add("--frame-rate", number(options.frames_per_s));
  if (state.lod_pixels != 1) words.add("--lod-pixels", number(state.lod_pixels));
  // The option is left out below the usual memory, where the command draws the same picture.
  if (state.memory_bytes > ViewState::kMemoryBytes)
    words.add("--memory", fmt::format("{}M", (state.memory_bytes + (1 << 20) - 1) >> 20));
  if (state.classification == Classification::kFlat) words.add("--classify", "flat");
  if (state.scale != glm::dvec3(1.0))
    words.add("--scale", fmt::format("{},{},{}", state.scale.x, state.scale.y, state.scale.z));
  if (!of_film) addCuts(state, words);
  if (state.lit) words.add("--shade");
  if (state.lit && state.light_strength != ViewState::kLightStrength)
    words.add("--light", fmt::format("{},{},{}", number(1 - state.light_strength),
                                     number(state.light_strength), Light{}.specular));
  if (state.lit && state.light_direction) words.add("--light-direction", numbers(*state.light_direction, 1));
  if (state.lit && state.shadow > 0) words.add("--shadow", number(state.shadow));
  if (state.lit && state.ambient_occlusion > 0)
    words.add("--ambient-occlusion", number(state.ambient_occlusion));
  if (!state.gradient_opacity.empty()) words.add("--gradient-opacity", textOf(state.gradient_opacity));
  addSurfaces(state, !of_film, words);
  if (state.given)
    for (const auto& [option, value] : state.given->options) words.add(option, value);
  if (!state.dark) words.add("--background", "white");
  if (state.annotations.scalar_bar) words.add("--scalar-bar");
  if (state.annotations.axes) words.add("--axes");
  if (state.annotations.axes_grid) words.add("--axes-grid");
  if (state.annotations.outline) words.add("--outline");
  const double largest =
      std::max({state.scale.x, state.scale.y, state.scale.z, 1.0});  // points are before --scale
  for (const Marker& marker : state.markers)
    words.add("--marker", fmt::format("{}:{}", numbers(marker.point, halfHeight(state.camera) / largest),
                                      signOf(marker, state.variable)));
  if (!state.title.empty()) words.add("--title", withoutFields(state.title));
  if (state.annotations.text_size > 0) words.add("--text-size", number(state.annotations.text_size));
  return words.text();
}

}  // namespace curvisplat
