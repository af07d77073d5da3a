// The module curvisplat._core: the libraries as plain functions, which tools/python/curvisplat turns into Python. Values
// that `curvisplat render` takes as text come as text, so that the two read them alike.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/series_files.h"
#include "render/camera/camera_path.h"
#include "render/colour/transfer_function.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/cache/series.h"
#include "stream/model/refinement.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/globe_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/output/start_checks.h"
#include "tools/python/array_source.h"
#include "tools/python/cache_arrays.h"
#include "tools/python/interruptible.h"
#include "tools/python/open_cache.h"
#include "tools/python/remote_folder.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

constexpr const char* kThreads = "threads";  // the argument

glm::dvec3 vectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// A message, which may have a file's name in it: bytes that are not UTF-8 become \\xNN.
py::str shownText(std::string_view message) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeUTF8(message.data(), static_cast<py::ssize_t>(message.size()), "backslashreplace"));
}

py::list shownTexts(const std::vector<std::string>& messages) {
  py::list texts;
  for (const std::string& message : messages) texts.append(shownText(message));
  return texts;
}

/// A path as os.fsdecode() has it.
py::str nameOf(const std::filesystem::path& path) {
  return py::reinterpret_steal<py::str>(PyUnicode_DecodeFSDefault(path.c_str()));
}

py::dict statisticsOf(const FrameStatistics& statistics) {
  py::dict out;
  out["splats_drawn"] = statistics.splats_drawn;
  out["bricks_drawn"] = statistics.bricks_drawn;
  out["bytes_read"] = statistics.bytes_read;
  out["largest_error_px"] = statistics.largest_error_px;
  out["seconds"] = statistics.total_s;
  out["memory_bytes"] = statistics.memory_used_bytes;
  out["bricks_unreadable"] = statistics.bricks_unreadable.size();
  return out;
}

/// `function`, `camera`, `frame`: text by option; `others`: lists, flags and numbers.
py::tuple render(OpenCache& cache, const Options& function, const Options& camera, const Options& frame,
                 const py::dict& others, const py::object& progress) {
  const PictureArguments arguments = pictureArguments(function, camera, frame, others);
  const auto busy = cache.use();
  const DrawnPicture picture = cache.withScalar(arguments.scalar.scalar).render(arguments, progress);
  return py::make_tuple(picture.rgba, shownText(picture.chosen), shownTexts(picture.notes),
                        shownTexts(picture.warnings), picture.channels, statisticsOf(picture.statistics));
}

py::list scalarsOf(OpenCache& cache) {
  py::list out;
  const auto add = [&out](const OpenCache& one) {
    const std::shared_ptr<const CacheReader> reader = one.reader();
    for (const VariableInfo& variable : reader->manifest().variables)
      out.append(py::make_tuple(variable.name, variable.unit, variable.min, variable.max));
  };
  const std::vector<OpenCache*> own_blanks = cache.allOwnBlanks();
  add(cache);
  for (const OpenCache* const own : own_blanks) add(*own);
  return out;
}

std::array<double, 3> coordinatesOf(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

std::unique_ptr<OpenCache> opened(const std::filesystem::path& path, std::shared_ptr<void> mirror) {
  const UnlockedWork unlocked;
  return std::make_unique<OpenCache>(CacheReader(path), std::move(mirror));
}

std::vector<double> timesOf(const OpenCache& cache) {
  const std::shared_ptr<const CacheReader> reader = cache.reader();
  std::vector<double> times;
  for (const SeriesStep& step : reader->series().steps) times.push_back(step.time);
  return times;
}

std::vector<double> histogramOfCache(OpenCache& whole, const std::string& scalar,
                                     const std::pair<double, double>& range, bool log, size_t bins) {
  const auto busy = whole.use();
  return whole.withScalar(scalar).histogram({scalar, range.first, range.second, log, bins});
}

/// (position, focal_point, view_up, parallel_scale) of each frame.
py::list camerasOf(const OpenCache& cache, const Options& camera, const std::string& size,
                   const std::string& scale, uint64_t frames) {
  CameraArguments arguments = cameraArguments(camera);
  arguments.frames = frames;
  checkCameraArguments(arguments);
  if (frames == 0 || frames > kMaxFrames)
    throw UsageError("{} frames: expected from 1 to {}", frames, kMaxFrames);
  const std::shared_ptr<const CacheReader> reader = cache.reader();
  const Manifest& manifest = reader->manifest();
  const auto vertical = camera.find("vertical_scale");
  const glm::dvec3 factors = verticallyScaled(
      parsePoint("scale", scale), vertical == camera.end() ? std::nullopt : std::optional(vertical->second),
      manifest.globe);
  const CameraMotion motion = chooseCameraMotion(
      arguments, {manifest.lower * factors, manifest.upper * factors}, parseImageSize("size", size));
  py::list out;
  for (uint64_t frame = 0; frame < motion.frames; ++frame) {
    const Camera at = motion.camera(frame);
    out.append(py::make_tuple(coordinatesOf(at.position), coordinatesOf(at.focal_point),
                              coordinatesOf(at.view_up), at.parallel_scale));
  }
  return out;
}

py::tuple orbitedCamera(const std::array<double, 3>& position, const std::array<double, 3>& focal_point,
                        const std::array<double, 3>& view_up, double degrees) {
  Camera camera;
  camera.position = vectorOf(position);
  camera.focal_point = vectorOf(focal_point);
  camera.view_up = vectorOf(view_up);
  const Camera turned = orbited(camera, degrees);
  return py::make_tuple(py::tuple(py::cast(coordinatesOf(turned.position))),
                        py::tuple(py::cast(coordinatesOf(turned.view_up))));
}

py::tuple probeAt(OpenCache& cache, const std::vector<std::array<double, 3>>& points,
                  const std::optional<std::vector<std::filesystem::path>>& source) {
  const auto busy = cache.use();
  std::vector<std::shared_ptr<const CacheReader>> sets{cache.reader()};
  for (const OpenCache* const own : cache.allOwnBlanks()) sets.push_back(own->reader());
  return probedArrays(sets, points, source);
}

py::tuple sample(OpenCache& cache, const DataChoice& choice, const std::array<uint32_t, 3>& size,
                 const py::object& progress) {
  const auto busy = cache.use();
  return sampledArrays(*cache.withScalar(choice.scalar).reader(), choice, size, progress);
}

py::tuple points(OpenCache& cache, const DataChoice& choice, const py::object& progress) {
  const auto busy = cache.use();
  return pointArrays(*cache.withScalar(choice.scalar).reader(), choice, progress);
}

/// A number of parts or "auto", the default. Throws UsageError.
std::string refinementOf(const py::dict& given_options) {
  if (!given_options.contains("refine")) return "auto";
  const auto text = py::cast<std::string>(given_options["refine"]);
  parseRefinement("refine", text);
  return text;
}

std::vector<uint32_t> allScalars(size_t count) {
  std::vector<uint32_t> all(count);
  std::iota(all.begin(), all.end(), 0u);
  return all;
}

/// The source with cells cut as "refine" asks. Reads it without the interpreter's lock, which a source of Python's needs; but it is
/// deleted with it.
std::unique_ptr<DataSource> refinedAs(const py::dict& given_options, std::unique_ptr<DataSource> source,
                                      std::optional<double> blank_value, const py::object& progress) {
  const std::vector<uint32_t> all = allScalars(source->description().scalars.size());
  const auto threads = py::cast<unsigned>(given_options["threads"]);
  const auto parts = parseRefinement("refine", refinementOf(given_options));
  Refinement refinement(parts.value_or(1));
  if (!parts)
    runInterruptibly(progress,
                     [&](Progress&) { refinement = refinementByNeed(*source, all, threads, blank_value); });
  return refinedBy(refinement, std::move(source), blank_value);
}

/// The options of a conversion that both kinds of input have.
ConvertOptions convertOptions(const std::filesystem::path& output, const py::dict& given_options) {
  ConvertOptions options;
  options.output = output.has_filename() ? output : output.parent_path();
  options.overwrite = py::cast<bool>(given_options["overwrite"]);
  options.resume = options.keep_interrupted = py::cast<bool>(given_options["resume"]);
  options.blank_value = py::cast<std::optional<double>>(given_options["blank_value"]);
  options.threads = py::cast<unsigned>(given_options["threads"]);
  options.title = py::cast<std::string>(given_options["title"]);
  options.precision =
      parseValuePrecision("value_precision", py::cast<std::string>(given_options["value_precision"]));
  const auto memory = py::cast<std::string>(given_options["memory"]);
  if (!memory.empty()) options.memory_bytes = parseMemory("memory", memory);
  return options;
}

/// Says what a conversion did to the cells without having been asked to.
std::vector<std::string> notesOn(const GridDescription& description, bool cuts_by_need) {
  const std::string note = cuts_by_need ? noteOnCuts(description, "refine=1") : "";
  return note.empty() ? std::vector<std::string>{} : std::vector{note};
}

py::dict reportOf(const ConvertReport& report, const std::vector<std::string>& notes) {
  py::dict out;
  out["samples"] = report.nodes;
  out["blanked"] = report.blanked.by_grid + report.blanked.by_value + report.blanked.not_finite;
  out["splats"] = report.splats;
  out["bricks"] = report.bricks;
  out["levels"] = report.levels;
  out["volume"] = report.volume;
  out["merged_nodes"] = report.merged_nodes;
  uint64_t bytes = 0;
  for (const FileReport& file : report.files) bytes += file.bytes;
  out["bytes"] = bytes;
  out["warnings"] = shownTexts(report.warnings);
  out["notes"] = shownTexts(notes);
  out["steps"] = 1;
  return out;
}

/// To be called before a conversion. Those heaps stay that the interpreter's threads have.
void beginThreads(unsigned count) {
  limitHeaps(kHeapsOfConversion);
  requireThreads(count, kThreads);
}

py::dict convertSource(const DataSource& source, ConvertOptions options, const py::dict& given_options,
                       const py::object& progress) {
  options.differing = DifferingScalars::kKeepApart;
  ConvertReport report;
  beginThreads(options.threads);
  runInterruptibly(progress, [&](Progress& of_work) { report = convert(source, options, of_work); });
  return reportOf(report, notesOn(source.description(), refinementOf(given_options) == "auto"));
}

std::unique_ptr<GridSource> sourceOf(const py::list& blocks, const ScalarNames& names,
                                     const py::dict& given_options) {
  std::vector<BlockArrays> arrays;
  for (const py::handle& object : blocks) {
    const auto block = py::cast<py::tuple>(object);  // name, x, y, z, [scalar], blank
    BlockArrays of_block{py::cast<std::string>(block[0]), block[1], block[2], block[3], {}, block[5]};
    for (const py::handle& scalar : py::cast<py::list>(block[4]))
      of_block.scalars.push_back(py::cast<py::array>(scalar));
    arrays.push_back(std::move(of_block));
  }
  return sourceOfArrays(std::move(arrays), names, py::cast<std::optional<double>>(given_options["time"]));
}

py::dict convertArrays(const std::filesystem::path& output, const py::list& blocks, const ScalarNames& names,
                       const py::dict& given_options, const py::object& progress) {
  ConvertOptions options = convertOptions(output, given_options);
  options.scalars = allScalars(names.size());
  beginThreads(options.threads);
  const auto source =
      refinedAs(given_options, sourceOf(blocks, names, given_options), options.blank_value, progress);
  options.time = py::cast<std::optional<double>>(given_options["time"]);
  return convertSource(*source, std::move(options), given_options, progress);
}

/// The steps that the cache has then.
uint64_t appendArrays(const std::filesystem::path& cache, const py::list& blocks, const ScalarNames& names,
                      const py::dict& given_options, const py::object& progress) {
  SeriesOptions options;
  options.convert = convertOptions(cache, given_options);
  options.add = true;
  // Opened at once: its errors name the array.
  std::unique_ptr<DataSource> source = sourceOf(blocks, names, given_options);
  source = refinedBy(readManifest(options.convert.output).refinement, std::move(source),
                     options.convert.blank_value);
  SeriesInput input;
  input.count = 1;
  input.name = [](uint64_t) { return std::string("arrays in memory"); };
  input.open = [&](uint64_t) { return std::move(source); };
  input.scalars = [&](const GridDescription&) { return allScalars(names.size()); };
  SeriesReport report;
  beginThreads(options.convert.threads);
  runInterruptibly(progress, [&](Progress& of_work) {
    report = convertSeries(input, options, of_work, [](const SeriesEvent&) {});
  });
  return report.steps;
}

py::dict convertCallable(const std::filesystem::path& output,
                         const std::vector<std::array<uint64_t, 3>>& shapes, const ScalarNames& names,
                         const py::object& read, const py::dict& given_options, const py::object& progress) {
  ConvertOptions options = convertOptions(output, given_options);
  options.scalars = allScalars(names.size());
  const bool parts = py::cast<bool>(given_options["parts_of_rows"]);
  beginThreads(options.threads);
  const auto source =
      refinedAs(given_options, sourceOfCallable(shapes, names, {read, parts}), options.blank_value, progress);
  return convertSource(*source, std::move(options), given_options, progress);
}

/// The steps of the files that "steps" leaves, or none where they are one.
std::vector<StepFiles> stepsIn(ConvertArguments& arguments) {
  expandPatterns(arguments.grid);
  if (!arguments.steps && !arguments.adds_steps && !hasSeveralStepFiles(arguments.grid)) return {};
  if (arguments.grid.time_step)
    throw UsageError("time_step: chooses one step, and there are several here; use steps instead");
  return chosenSteps(arguments, "steps");
}

/// The report of the first step, with the number of steps and the bytes of all.
py::dict convertSteps(const ConvertArguments& arguments, const std::vector<StepFiles>& steps,
                      ConvertOptions of_each, const py::object& progress) {
  SeriesOptions options;
  options.convert = std::move(of_each);
  options.add = arguments.adds_steps;
  options.keep_going = arguments.keep_going;
  const SeriesInput input = seriesInput(arguments, steps, steps);
  SeriesReport series;
  ConvertReport first;
  std::vector<std::string> warnings, notes;
  beginThreads(options.convert.threads);
  runInterruptibly(progress, [&](Progress& of_work) {
    series = convertSeries(input, options, of_work, [&](const SeriesEvent& event) {
      if (!event.reason.empty()) warnings.push_back(event.name + " was left out: " + event.reason);
      if (event.converted) first = *event.converted;
      if (event.source && event.converted) notes = notesOn(*event.source, arguments.refine == "auto");
      if (event.source)
        warnings.insert(warnings.end(), event.source->warnings.begin(), event.source->warnings.end());
    });
  });
  const CacheReader cache(options.convert.output);
  uint64_t bytes = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(options.convert.output))
    if (entry.is_regular_file()) bytes += entry.file_size();
  first.warnings.insert(first.warnings.end(), warnings.begin(), warnings.end());
  py::dict out = reportOf(first, notes);
  out["samples"] = cache.manifest().nodes;
  out["splats"] = cache.manifest().splats;
  out["bricks"] = cache.bricks().size();
  out["levels"] = cache.manifest().levels;
  out["volume"] = cache.manifest().volume;
  out["bytes"] = bytes;
  out["steps"] = series.steps;
  return out;
}

py::dict convertFiles(const std::filesystem::path& output, const std::filesystem::path& grid,
                      const std::vector<std::filesystem::path>& solutions,
                      const std::vector<std::string>& scalars, const py::dict& given_options,
                      const py::object& progress) {
  ConvertArguments arguments;
  arguments.grid.grid = grid;
  arguments.grid.solutions = solutions;
  arguments.grid.time_step = py::cast<std::optional<uint32_t>>(given_options["time_step"]);
  arguments.grid.select = py::cast<std::vector<std::string>>(given_options["select"]);
  arguments.grid.globe.vertical_scale = py::cast<double>(given_options["vertical_scale"]);
  arguments.scalars = scalars;
  arguments.steps = py::cast<std::optional<std::string>>(given_options["steps"]);
  arguments.keep_going = py::cast<bool>(given_options["keep_going"]);
  arguments.adds_steps = py::cast<bool>(given_options["add"]);
  if (!arguments.adds_steps) arguments.refine = refinementOf(given_options);
  ConvertOptions options = convertOptions(output, given_options);
  arguments.output = arguments.to = options.output;
  arguments.blank_value = options.blank_value;
  const std::vector<StepFiles> steps = stepsIn(arguments);
  if (options.title.empty()) options.title = arguments.grid.grid.stem().string();
  if (!steps.empty()) return convertSteps(arguments, steps, std::move(options), progress);
  ConvertReport report;
  std::vector<std::string> notes;
  beginThreads(options.threads);
  runInterruptibly(progress, [&](Progress& of_work) {
    const auto source = openSource(arguments, options.output);
    options.scalars = chooseScalars(arguments, scalars, source->description());
    options.differing = DifferingScalars::kKeepApart;
    report = convert(*source, options, of_work);
    for (const std::string& warning : source->description().warnings) report.warnings.push_back(warning);
    notes = notesOn(source->description(), arguments.refine == "auto");
  });
  return reportOf(report, notes);
}

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

/// `more`: further channels by name, of an .exr file.
void writePicture(const Floats& rgba, const std::filesystem::path& path,
                  const std::map<std::string, Floats>& more) {
  if (rgba.ndim() != 3 || rgba.shape(2) != 4)
    throw UsageError("{}: a picture is an array of shape (height, width, 4)", path.string());
  checkImageSize(static_cast<uint64_t>(rgba.shape(1)), static_cast<uint64_t>(rgba.shape(0)), path);
  Image image({static_cast<int>(rgba.shape(1)), static_cast<int>(rgba.shape(0))});
  std::copy_n(rgba.data(), image.rgba.size(), image.rgba.data());
  if (more.empty()) return writeImage(image, path);
  std::vector<ImageChannel> channels;
  for (const auto& [name, values] : more) {
    if (values.ndim() != 2 || values.shape(0) != rgba.shape(0) || values.shape(1) != rgba.shape(1))
      throw UsageError("{}: channel {} has another shape than the picture", path.string(), name);
    channels.push_back({name, {values.data(), values.data() + values.size()}});
  }
  writeExr(image, channels, path);
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  module.doc() = "The libraries of curvisplat; use the package curvisplat.";
  module.attr("version") = CURVISPLAT_VERSION;

  static const py::handle error_type = py::exception<Error>(module, "Error", PyExc_RuntimeError).release();
  const py::tuple usage_bases =
      py::make_tuple(error_type, py::reinterpret_borrow<py::object>(PyExc_ValueError));
  static const py::handle usage_type = py::exception<UsageError>(module, "UsageError", usage_bases).release();
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const std::filesystem::filesystem_error& failure) {
      PyErr_SetObject(error_type.ptr(), shownText(textOf(failure)).ptr());
    } catch (const UsageError& failure) {
      PyErr_SetObject(usage_type.ptr(), shownText(failure.what()).ptr());
    } catch (const Error& failure) {
      PyErr_SetObject(error_type.ptr(), shownText(failure.what()).ptr());
    }
  });

  py::class_<DataChoice>(module, "DataChoice")
      .def(py::init([](const std::string& scalar, const std::array<double, 3>& lower,
                       const std::array<double, 3>& upper, std::optional<uint32_t> level, uint64_t step) {
        return DataChoice{scalar, lower, upper, level, step};
      }));
  module.def("set_interrupt_hook", &setInterruptHook);
  py::class_<RemoteFolder, std::shared_ptr<RemoteFolder>>(module, "RemoteFolder")
      .def(py::init<const std::filesystem::path&, py::object>())
      .def_property_readonly("path", [](const RemoteFolder& folder) { return nameOf(folder.path()); })
      .def_property_readonly("fetched_bytes", &RemoteFolder::fetchedBytes);
  py::class_<OpenCache>(module, "OpenCache")
      .def(py::init([](const std::filesystem::path& path) { return opened(path, nullptr); }))
      .def(py::init(
          [](const std::shared_ptr<RemoteFolder>& folder) { return opened(folder->path(), folder); }))
      .def("render", &render)
      .def("release", &OpenCache::release)
      .def("probe", &probeAt)
      .def("cameras", &camerasOf)
      .def("sample", &sample)
      .def("points", &points)
      .def("histogram", &histogramOfCache)
      .def_property_readonly("times", &timesOf)
      .def_property_readonly(
          "time_unit", [](const OpenCache& cache) { return cache.reader()->seriesManifest().time_unit; })
      .def_property_readonly("path",
                             [](const OpenCache& cache) { return nameOf(cache.reader()->cachePath()); })
      .def_property_readonly("scalars", &scalarsOf)
      .def_property_readonly(
          "lower", [](const OpenCache& cache) { return coordinatesOf(cache.reader()->manifest().lower); })
      .def_property_readonly(
          "upper", [](const OpenCache& cache) { return coordinatesOf(cache.reader()->manifest().upper); })
      .def_property_readonly("title", [](const OpenCache& cache) { return cache.reader()->manifest().title; })
      .def_property_readonly("samples",
                             [](const OpenCache& cache) { return cache.reader()->manifest().nodes; })
      .def_property_readonly("splats",
                             [](const OpenCache& cache) { return cache.reader()->manifest().splats; })
      .def_property_readonly("levels",
                             [](const OpenCache& cache) { return cache.reader()->manifest().levels; })
      .def_property_readonly("volume",
                             [](const OpenCache& cache) { return cache.reader()->manifest().volume; })
      .def_property_readonly("blocks", [](const OpenCache& cache) {
        const std::shared_ptr<const CacheReader> reader = cache.reader();
        py::list out;
        for (const BlockInfo& block : reader->manifest().blocks)
          out.append(py::make_tuple(block.name, block.ni, block.nj, block.nk));
        return out;
      });
  module.def("orbited", &orbitedCamera);
  module.def("convert_arrays", &convertArrays);
  module.def("append_arrays", &appendArrays);
  module.def("convert_callable", &convertCallable);
  module.def("convert_files", &convertFiles);
  module.def("colour_maps", [] {
    std::vector<std::string> names;
    for (const PublishedMap& map : builtInMaps()) names.emplace_back(map.name);
    return names;
  });
  module.def("write_image", &writePicture);
  py::module_::import("atexit").attr("register")(py::cpp_function(&endAllWork));
}

}  // namespace curvisplat::python
