// `curvisplat render`: a cache in, a picture out.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "render/camera.h"
#include "render/frame.h"
#include "render/image.h"
#include "render/transfer_function.h"
#include "stream/cache_reader.h"
#include "stream/error.h"
#include "stream/progress.h"
#include "tools/commands.h"
#include "tools/empty_picture.h"
#include "tools/option_parsers.h"
#include "tools/run_statistics.h"

namespace curvisplat {
namespace {

/// The command line's words, as given.
struct RenderWords {
  std::filesystem::path cache, output, statistics;
  std::string size = "600x600", scalar, transfer_function = "viridis", background = "white";
  std::string classify = "pixel", scale = "1,1,1", backend = "auto", memory = "512M";
  std::string lod_pixels = "1";
  std::optional<std::string> range, opacity_unit, view, position, focal_point, view_up, parallel_scale,
      view_angle, clip_box;
  unsigned threads = 0;
};

double parsePositive(std::string_view option, const std::string& text) {
  const double value = parseNumber(option, text);
  if (!(value > 0)) throw UsageError("{} {}: expected a number above zero", option, text);
  return value;
}

WorldBox parseClipBox(const std::string& text) {
  const auto n = parseNumbers("--clip-box", text, "x0,x1,y0,y1,z0,z1");
  const WorldBox box{{n[0], n[2], n[4]}, {n[1], n[3], n[5]}};
  for (int axis = 0; axis < 3; ++axis)
    if (box.lower[axis] > box.upper[axis])
      throw UsageError("--clip-box {}: {} is given from {} to {}, the larger first", text, "xyz"[axis],
                       box.lower[axis], box.upper[axis]);
  return box;
}

FrameOptions frameOptions(const RenderWords& words) {
  FrameOptions options;
  options.size = parseImageSize("--size", words.size);
  options.lod_pixels = parseNumber("--lod-pixels", words.lod_pixels);
  if (options.lod_pixels < 0)
    throw UsageError("--lod-pixels {}: expected 0 (the finest level) or more", words.lod_pixels);
  if (words.classify != "pixel" && words.classify != "flat")
    throw UsageError("--classify {}: expected pixel or flat", words.classify);
  options.classification = words.classify == "pixel" ? Classification::pixel : Classification::flat;
  options.scale = parsePoint("--scale", words.scale);
  if (!(std::min({options.scale.x, options.scale.y, options.scale.z}) > 0))
    throw UsageError("--scale {}: expected three numbers above zero", words.scale);
  if (words.clip_box) options.clip_box = parseClipBox(*words.clip_box);
  options.background = parseBackground("--background", words.background);
  options.threads = words.threads;
  options.memory_bytes = parseByteSize("--memory", words.memory);
  return options;
}

/// What contradicts itself whatever the cache holds.
void checkWords(const RenderWords& words) {
  checkImageName(words.output);
  if (words.view && (words.position || words.focal_point || words.view_up))
    throw UsageError("--view names a camera; --position, --focal-point and --view-up place one: give either");
  if (!words.position && (words.focal_point || words.view_up))
    throw UsageError("{} needs --position", words.focal_point ? "--focal-point" : "--view-up");
  if (words.parallel_scale && words.view_angle)
    throw UsageError(
        "--parallel-scale is for an orthographic camera, --view-angle for perspective: give one");
  if (words.background == "transparent" && words.output.extension() == ".pfm")
    throw UsageError("--background transparent: a .pfm has no transparency; write .png or .exr");
  if (words.backend != "auto" && words.backend != "osmesa")
    throw UsageError("--backend {}: not in this version, which has auto and osmesa", words.backend);
  checkOutputFolder("-o", words.output);
  if (!words.statistics.empty()) checkOutputFolder("--stats", words.statistics);
}

/// A scalar that the cache lacks is bad input, not wrong usage: the cache decides.
size_t chooseVariable(const CacheReader& cache, const std::string& name) {
  try {
    return cache.variableNamed(name);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());
  }
}

Camera chooseCamera(const RenderWords& words, const glm::dvec3& lower, const glm::dvec3& upper,
                    ImageSize size) {
  const auto projection = words.view_angle ? Projection::perspective : Projection::orthographic;
  const double angle = words.view_angle ? parsePositive("--view-angle", *words.view_angle) : 30;
  if (angle >= 180) throw UsageError("--view-angle {}: expected less than 180 degrees", *words.view_angle);

  Camera camera;
  if (words.position) {
    camera.position = parsePoint("--position", *words.position);
    camera.focal_point =
        words.focal_point ? parsePoint("--focal-point", *words.focal_point) : 0.5 * (lower + upper);
    camera.view_up = words.view_up ? parsePoint("--view-up", *words.view_up) : glm::dvec3(0, 0, 1);
    if (glm::length(camera.view_up) == 0)
      throw UsageError("--view-up {}: expected a direction", *words.view_up);
    camera.projection = projection;
    camera.view_angle_deg = angle;
    camera.parallel_scale = camera.parallelScaleFor(lower, upper, size);
  } else {
    camera = Camera::named(words.view.value_or("iso"), lower, upper, size, projection, angle);
  }
  if (words.parallel_scale) camera.parallel_scale = parsePositive("--parallel-scale", *words.parallel_scale);
  return camera;
}

TransferFunction chooseTransferFunction(const RenderWords& words, const VariableInfo& variable,
                                        double diagonal) {
  const double default_unit = diagonal > 0 ? diagonal / 100 : 1;
  const double unit = words.opacity_unit ? parsePositive("--opacity-unit", *words.opacity_unit) : 0;
  std::optional<std::pair<double, double>> range;
  if (words.range) {
    const auto ends = parseNumbers("--range", *words.range, "LO,HI");
    if (!(ends[0] < ends[1])) throw UsageError("--range {}: expected LO,HI with LO < HI", *words.range);
    range.emplace(ends[0], ends[1]);
  }
  if (words.transfer_function.ends_with(".json"))
    return TransferFunction::fromFile(words.transfer_function, range ? &*range : nullptr, unit, default_unit);
  return TransferFunction::preset(words.transfer_function, range ? range->first : variable.min,
                                  range ? range->second : variable.max, unit > 0 ? unit : default_unit);
}

nlohmann::json toJson(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

nlohmann::json toJson(const Camera& camera) {
  nlohmann::json json{{"position", toJson(camera.position)},
                      {"focal_point", toJson(camera.focal_point)},
                      {"view_up", toJson(camera.view_up)}};
  if (camera.projection == Projection::orthographic) {
    json["projection"] = "orthographic";
    json["parallel_scale"] = camera.parallel_scale;
  } else {
    json["projection"] = "perspective";
    json["view_angle_deg"] = camera.view_angle_deg;
  }
  return json;
}

nlohmann::json toJson(const TransferFunction& function) {
  return {{"name", function.name()},
          {"range", {function.range().first, function.range().second}},
          {"log_scale", function.logScale()},
          {"opacity_unit", function.opacityUnit()}};
}

nlohmann::json toJson(const FrameStatistics& s) {
  return {{"seconds",
           {{"plan", s.plan_s},
            {"read", s.read_s},
            {"decode", s.decode_s},
            {"project", s.project_s},
            {"sort", s.sort_s},
            {"upload", s.upload_s},
            {"draw", s.draw_s},
            {"total", s.total_s},
            {"workers_waited", s.workers_waited_s},
            {"painter_waited", s.painter_waited_s}}},
          {"bricks_drawn", s.bricks_drawn},
          {"bricks_culled", s.bricks_culled},
          {"bricks_out_of_image", s.bricks_out_of_image},
          {"bricks_transparent", s.bricks_transparent},
          {"splats_read", s.splats_read},
          {"splats_clipped", s.splats_clipped},
          {"splats_off_screen", s.splats_off_screen},
          {"splats_transparent", s.splats_transparent},
          {"splats_drawn", s.splats_drawn},
          {"bytes_read", s.bytes_read},
          {"largest_level", s.largest_level},
          {"workers", s.workers}};
}

nlohmann::json statisticsOf(const RenderWords& words, const RenderedScene& scene,
                            const std::string& backend) {
  const FrameOptions& options = scene.options;
  nlohmann::json json = runStatistics();
  json["cache"] = words.cache.string();
  json["scalar"] = {{"name", scene.variable.name}, {"range", {scene.variable.min, scene.variable.max}}};
  json["image"] = {
      {"file", words.output.string()}, {"width", options.size.width}, {"height", options.size.height}};
  json["backend"] = backend;
  json["threads"] = options.threads;
  json["memory_bytes"] = options.memory_bytes;
  json["lod_pixels"] = options.lod_pixels;
  json["classify"] = words.classify;
  json["scale"] = toJson(options.scale);
  json["clip_box"] = nullptr;
  if (options.clip_box)
    json["clip_box"] = {{"lower", toJson(options.clip_box->lower)},
                        {"upper", toJson(options.clip_box->upper)}};
  json["background"] = words.background;
  json["camera"] = toJson(scene.camera);
  json["transfer_function"] = toJson(scene.transfer_function);
  json["frame"] = toJson(scene.statistics);
  return json;
}

void tell(const char* kind, const std::string& text) {
  fmt::print(stderr, "curvisplat: {}: {}\n", kind, text);
}

void render(const RenderWords& words) {
  checkWords(words);
  FrameOptions options = frameOptions(words);
  if (options.threads == 0) options.threads = std::max(1u, std::thread::hardware_concurrency());

  const CacheReader cache(words.cache);
  const Manifest& manifest = cache.manifest();
  const size_t variable = chooseVariable(cache, words.scalar);
  const VariableInfo& info = manifest.variables[variable];
  const glm::dvec3 lower = manifest.lower * options.scale, upper = manifest.upper * options.scale;
  const Camera camera = chooseCamera(words, lower, upper, options.size);
  const TransferFunction transfer_function = chooseTransferFunction(words, info, glm::length(upper - lower));
  for (const std::string& note : transfer_function.notes()) tell("note", note);
  const std::string range_warning = rangeMissesScalar(info, transfer_function);
  if (!range_warning.empty()) tell("warning", range_warning);

  FrameRenderer renderer(cache, variable, transfer_function);
  Progress progress;
  FrameStatistics statistics;
  const Image image = renderer.render(camera, options, statistics, &progress);
  progress.end();
  const RenderedScene scene{manifest, info, transfer_function, camera, options, statistics};
  if (isEmpty(image, options.background))
    for (const std::string& reason : whyEmpty(scene)) tell("warning", "the picture is empty: " + reason);

  writeImage(image, words.output);
  if (!words.statistics.empty())
    writeStatistics(words.statistics, statisticsOf(words, scene, renderer.backendName()));
  fmt::print("{}: {} splats of {} in {} bricks, {:.2f} s, {}\n", words.output.string(),
             statistics.splats_drawn, info.name, statistics.bricks_drawn, statistics.total_s,
             renderer.backendName());
}

}  // namespace

void addRender(CLI::App& app) {
  auto words = std::make_shared<RenderWords>();
  CLI::App* command = app.add_subcommand("render", "Render a cache to a picture");
  command->add_option("CACHE", words->cache, "The splat cache, a folder NAME.splats")->required();
  command->add_option("-o,--output", words->output, "The picture: .png, .exr or .pfm")->required();
  command->add_option("--size", words->size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  command->add_option("--scalar", words->scalar, "Name of the scalar; the cache's first otherwise");

  const std::string what = "What to see";
  command
      ->add_option("--tf", words->transfer_function,
                   fmt::format("Transfer function: {}, or a ParaView preset FILE.json", presetNames()))
      ->capture_default_str()
      ->group(what);
  command
      ->add_option(
          "--range", words->range,
          "LO,HI: stretch it over these scalars; the scalar's own range otherwise (a file: as it is)")
      ->group(what);
  command
      ->add_option("--opacity-unit", words->opacity_unit,
                   "Length, in world units, that opacities are for; 1/100 of the data's diagonal otherwise")
      ->group(what);
  command
      ->add_option("--classify", words->classify,
                   "pixel: the scalar varies within a splat; flat: one colour a splat")
      ->capture_default_str()
      ->group(what);
  command->add_option("--lod-pixels", words->lod_pixels, "Detail that may be merged away, in pixels; 0: none")
      ->capture_default_str()
      ->group(what);
  command->add_option("--scale", words->scale, "sx,sy,sz: stretch the data")
      ->capture_default_str()
      ->group(what);
  command
      ->add_option("--clip-box", words->clip_box,
                   "x0,x1,y0,y1,z0,z1: leave out what is outside, before --scale")
      ->group(what);
  command->add_option("--background", words->background, "white, black, transparent or #rrggbb")
      ->capture_default_str()
      ->group(what);

  const std::string where = "Camera";
  command->add_option("--view", words->view, "iso, +x, -x, +y, -y, +z or -z; iso otherwise")->group(where);
  command->add_option("--position", words->position, "x,y,z of the camera, after --scale")->group(where);
  command->add_option("--focal-point", words->focal_point, "x,y,z it looks at; the data's centre otherwise")
      ->group(where);
  command->add_option("--view-up", words->view_up, "x,y,z that points up; 0,0,1 otherwise")->group(where);
  command
      ->add_option("--parallel-scale", words->parallel_scale,
                   "Half the picture's height in world units; all of the data otherwise")
      ->group(where);
  command
      ->add_option("--view-angle", words->view_angle,
                   "Perspective, with this angle over the picture's height, in degrees")
      ->group(where);

  const std::string how = "Resources";
  command->add_option("--backend", words->backend, "auto or osmesa")->capture_default_str()->group(how);
  command->add_option("--memory", words->memory, "Memory for the data in flight: 512M, 2G")
      ->capture_default_str()
      ->group(how);
  command->add_option("--threads", words->threads, "Workers; 0: one a core")
      ->capture_default_str()
      ->group(how);
  command->add_option("--stats", words->statistics, "Write what was done, and how long it took, to FILE.json")
      ->group(how);
  command->callback([words] { render(*words); });
}

}  // namespace curvisplat
