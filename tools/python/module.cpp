// The module curvisplat._core: the libraries as plain functions, which tools/python/curvisplat turns into Python. Values
// that `curvisplat render` takes as text come as text, so that the two read them alike.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/convert.h"
#include "render/colour/published_maps.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/cache/probe.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/option_parsers.h"
#include "tools/python/array_source.h"
#include "tools/python/interruptible.h"
#include "tools/python/open_cache.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

using Options = std::map<std::string, std::string>;

std::optional<std::string> given(const Options& options, const std::string& name) {
  const auto found = options.find(name);
  return found == options.end() ? std::nullopt : std::optional(found->second);
}

ScalarArguments scalarArguments(const std::string& scalar, const Options& function) {
  return {scalar,
          given(function, "tf"),
          given(function, "range"),
          given(function, "opacity"),
          given(function, "asinh"),
          given(function, "opacity_unit")};
}

CameraArguments cameraArguments(const Options& camera) {
  CameraArguments arguments;
  arguments.view = given(camera, "view");
  arguments.position = given(camera, "position");
  arguments.focal_point = given(camera, "focal_point");
  arguments.view_up = given(camera, "view_up");
  arguments.parallel_scale = given(camera, "parallel_scale");
  arguments.view_angle = given(camera, "view_angle");
  return arguments;
}

glm::dvec3 vectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// Sets what `frame` has of the options.
FrameOptions frameOptions(const py::dict& frame) {
  FrameOptions options;
  const auto size = py::cast<std::array<int, 2>>(frame["size"]);
  options.size = parseImageSize("size", fmt::format("{}x{}", size[0], size[1]));
  options.lod_pixels = py::cast<double>(frame["lod_pixels"]);
  if (!(options.lod_pixels >= 0))
    throw UsageError("lod_pixels is {}; expected 0 (the finest level) or more", options.lod_pixels);
  options.max_splats = py::cast<std::optional<uint64_t>>(frame["max_splats"]);
  options.scale = vectorOf(py::cast<std::array<double, 3>>(frame["scale"]));
  for (int axis = 0; axis < 3; ++axis)
    if (!(options.scale[axis] >= 1e-6 && options.scale[axis] <= 1e6))
      throw UsageError("scale has the factor {}; expected three numbers between 1e-06 and 1e+06",
                       options.scale[axis]);
  if (!frame["clip_box"].is_none()) {
    const auto n = py::cast<std::array<double, 6>>(frame["clip_box"]);
    options.clip_box = WorldBox{{n[0], n[2], n[4]}, {n[1], n[3], n[5]}};
    for (int axis = 0; axis < 3; ++axis)
      if (!(options.clip_box->lower[axis] <= options.clip_box->upper[axis]))
        throw UsageError("clip_box: the {} range is reversed; expected (x0, x1, y0, y1, z0, z1)",
                         "xyz"[axis]);
  }
  for (const auto& n : py::cast<std::vector<std::array<double, 6>>>(frame["clip_planes"])) {
    options.clip_planes.push_back({{n[0], n[1], n[2]}, {n[3], n[4], n[5]}});
    if (!isUsable(options.clip_planes.back()))
      throw UsageError("clip_planes: the normal of plane {} has no direction", options.clip_planes.size());
  }
  if (options.clip_planes.size() > kMaxClipPlanes)
    throw UsageError("clip_planes: {} planes; at most {} cut a picture", options.clip_planes.size(),
                     kMaxClipPlanes);
  if (!frame["light"].is_none()) {
    const auto n = py::cast<std::array<double, 3>>(frame["light"]);
    for (const double strength : n)
      if (!(strength >= 0 && strength <= 1)) throw UsageError("light: {} is not between 0 and 1", strength);
    if (n[0] + n[1] > 1)
      throw UsageError("light: ambient and diffuse add up to {}; expected at most 1", n[0] + n[1]);
    options.light = Light();
    options.light->ambient = static_cast<float>(n[0]);
    options.light->diffuse = static_cast<float>(n[1]);
    options.light->specular = static_cast<float>(n[2]);
    if (!frame["light_direction"].is_none())
      options.light->towards = vectorOf(py::cast<std::array<double, 3>>(frame["light_direction"]));
  }
  options.background = parseBackground("background", py::cast<std::string>(frame["background"]));
  options.threads = py::cast<unsigned>(frame["threads"]);
  options.memory_bytes = parseMemory("memory", py::cast<std::string>(frame["memory"]));
  options.keep_going = py::cast<bool>(frame["keep_going"]);
  return options;
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

py::tuple render(OpenCache& cache, const std::string& scalar, const Options& function, const Options& camera,
                 const py::dict& frame, const py::object& progress) {
  const PictureArguments arguments{scalarArguments(scalar, function), cameraArguments(camera),
                                   frameOptions(frame),
                                   parseBackend(py::cast<std::string>(frame["backend"]))};
  DrawnPicture picture = cache.render(arguments, progress);
  return py::make_tuple(picture.rgba, picture.chosen, picture.notes, statisticsOf(picture.statistics));
}

py::list scalarsOf(const OpenCache& cache) {
  py::list out;
  for (const VariableInfo& variable : cache.reader().manifest().variables)
    out.append(py::make_tuple(variable.name, variable.unit, variable.min, variable.max));
  return out;
}

std::array<double, 3> arrayOf(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

/// None where the point is outside of the data.
py::object probeAt(const OpenCache& cache, const std::array<double, 3>& point) {
  const CacheReader& reader = cache.reader();
  std::vector<size_t> variables;
  for (size_t n = 0; n < reader.manifest().variables.size(); ++n) variables.push_back(n);
  const auto found = probe(reader, variables, vectorOf(point));
  if (!found) return py::none();
  py::dict values;
  for (size_t n = 0; n < variables.size(); ++n)
    values[py::str(reader.manifest().variables[n].name)] = found->variables[n].value;
  py::dict out;
  out["values"] = values;
  out["block"] = found->block + 1;
  out["index"] = py::make_tuple(found->i, found->j, found->k);
  out["position"] = arrayOf(found->centre);
  return out;
}

/// The options of a conversion that both kinds of input have.
ConvertOptions convertOptions(const std::filesystem::path& output, const py::dict& given_options) {
  ConvertOptions options;
  options.output = output.has_filename() ? output : output.parent_path();
  options.overwrite = py::cast<bool>(given_options["overwrite"]);
  options.resume = py::cast<bool>(given_options["resume"]);
  options.blank_value = py::cast<std::optional<double>>(given_options["blank_value"]);
  options.threads = py::cast<unsigned>(given_options["threads"]);
  options.title = py::cast<std::string>(given_options["title"]);
  const auto memory = py::cast<std::string>(given_options["memory"]);
  if (!memory.empty()) options.memory_bytes = parseMemory("memory", memory);
  return options;
}

py::dict reportOf(const ConvertReport& report) {
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
  out["warnings"] = report.warnings;
  return out;
}

py::dict convertSource(const GridSource& source, ConvertOptions options, const py::object& progress) {
  ConvertReport report;
  runInterruptibly(progress, [&](Progress& of_work) { report = convert(source, options, of_work); });
  return reportOf(report);
}

std::vector<uint32_t> allScalars(const ScalarNames& names) {
  std::vector<uint32_t> all;
  for (uint32_t n = 0; n < names.size(); ++n) all.push_back(n);
  return all;
}

py::dict convertArrays(const std::filesystem::path& output, const py::list& blocks, const ScalarNames& names,
                       const py::dict& given_options, const py::object& progress) {
  std::vector<BlockArrays> arrays;
  for (const py::handle& object : blocks) {
    const auto block = py::cast<py::tuple>(object);  // name, x, y, z, [scalar], blank
    BlockArrays of_block{py::cast<std::string>(block[0]), block[1], block[2], block[3], {}, block[5]};
    for (const py::handle& scalar : py::cast<py::list>(block[4]))
      of_block.scalars.push_back(py::cast<py::array>(scalar));
    arrays.push_back(std::move(of_block));
  }
  ConvertOptions options = convertOptions(output, given_options);
  options.scalars = allScalars(names);
  const auto source = sourceOfArrays(std::move(arrays), names);
  return convertSource(*source, std::move(options), progress);
}

py::dict convertCallable(const std::filesystem::path& output,
                         const std::vector<std::array<uint64_t, 3>>& shapes, const ScalarNames& names,
                         const py::object& read, const py::dict& given_options, const py::object& progress) {
  ConvertOptions options = convertOptions(output, given_options);
  options.scalars = allScalars(names);
  const auto source = sourceOfCallable(shapes, names, read);
  return convertSource(*source, std::move(options), progress);
}

py::dict convertFiles(const std::filesystem::path& output, const std::filesystem::path& grid,
                      const std::vector<std::filesystem::path>& solutions,
                      const std::vector<std::string>& scalars, std::optional<uint32_t> time_step,
                      const py::dict& given_options, const py::object& progress) {
  ConvertArguments arguments;
  arguments.grid.grid = grid;
  arguments.grid.solutions = solutions;
  arguments.grid.time_step = time_step;
  ConvertOptions options = convertOptions(output, given_options);
  if (options.title.empty()) options.title = grid.stem().string();
  ConvertReport report;
  runInterruptibly(progress, [&](Progress& of_work) {
    const auto source = openSource(arguments, options.output);
    options.scalars = chooseScalars(arguments, scalars, source->description());
    report = convert(*source, options, of_work);
    for (const std::string& warning : source->description().warnings) report.warnings.push_back(warning);
  });
  return reportOf(report);
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  module.doc() = "The libraries of curvisplat; use the package curvisplat.";
  module.attr("version") = CURVISPLAT_VERSION;

  const auto error = py::register_exception<Error>(module, "Error", PyExc_RuntimeError);
  const py::tuple usage_bases = py::make_tuple(error, py::reinterpret_borrow<py::object>(PyExc_ValueError));
  py::register_exception<UsageError>(module, "UsageError", usage_bases);

  py::class_<OpenCache>(module, "OpenCache")
      .def(py::init<std::filesystem::path>())
      .def("render", &render)
      .def("release", &OpenCache::release)
      .def("probe", &probeAt)
      .def_property_readonly("path", [](const OpenCache& cache) { return cache.path().string(); })
      .def_property_readonly("scalars", &scalarsOf)
      .def_property_readonly("lower",
                             [](const OpenCache& cache) { return arrayOf(cache.reader().manifest().lower); })
      .def_property_readonly("upper",
                             [](const OpenCache& cache) { return arrayOf(cache.reader().manifest().upper); })
      .def_property_readonly("title", [](const OpenCache& cache) { return cache.reader().manifest().title; })
      .def_property_readonly("samples",
                             [](const OpenCache& cache) { return cache.reader().manifest().nodes; })
      .def_property_readonly("splats",
                             [](const OpenCache& cache) { return cache.reader().manifest().splats; })
      .def_property_readonly("levels",
                             [](const OpenCache& cache) { return cache.reader().manifest().levels; })
      .def_property_readonly("volume",
                             [](const OpenCache& cache) { return cache.reader().manifest().volume; })
      .def_property_readonly("blocks", [](const OpenCache& cache) {
        py::list out;
        for (const BlockInfo& block : cache.reader().manifest().blocks)
          out.append(py::make_tuple(block.name, block.ni, block.nj, block.nk));
        return out;
      });
  module.def("convert_arrays", &convertArrays);
  module.def("convert_callable", &convertCallable);
  module.def("convert_files", &convertFiles);
  module.def("colour_maps", [] {
    std::vector<std::string> names;
    for (const PublishedMap& map : builtInMaps()) names.emplace_back(map.name);
    return names;
  });
  module.def("write_image",
             [](const py::array_t<float, py::array::c_style>& rgba, const std::filesystem::path& path) {
               if (rgba.ndim() != 3 || rgba.shape(2) != 4)
                 throw UsageError("{}: a picture is an array of shape (height, width, 4)", path.string());
               Image image({static_cast<int>(rgba.shape(1)), static_cast<int>(rgba.shape(0))});
               std::copy_n(rgba.data(), image.rgba.size(), image.rgba.data());
               writeImage(image, path);
             });
}

}  // namespace curvisplat::python
