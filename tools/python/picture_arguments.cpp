#include "tools/python/picture_arguments.h"

#include <pybind11/stl.h>

#include <optional>
#include <vector>

#include "tools/options/option_parsers.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

using Texts = std::vector<std::string>;

std::optional<std::string> given(const Options& options, const std::string& name) {
  const auto found = options.find(name);
  return found == options.end() ? std::nullopt : std::optional(found->second);
}

template <typename Value>
Value of(const py::dict& others, const char* name) {
  return py::cast<Value>(others[name]);
}

ScalarArguments scalarArguments(const Options& function) {
  return {function.at("scalar"),      given(function, "tf"),    given(function, "range"),
          given(function, "opacity"), given(function, "asinh"), given(function, "opacity_unit")};
}

OpacityArguments opacityArguments(const Options& function) {
  OpacityArguments arguments;
  arguments.by.scalar = given(function, "opacity_by").value_or("");
  arguments.by.transfer_function = given(function, "opacity_tf");
  arguments.by.range = given(function, "opacity_range");
  arguments.by.asinh = given(function, "opacity_asinh");
  arguments.iso_scalar = given(function, "iso_by").value_or("");
  return arguments;
}

FrameArguments frameArguments(const Options& frame, const py::dict& others) {
  FrameArguments arguments;
  arguments.size = frame.at("size");
  arguments.background = frame.at("background");
  arguments.classify = frame.at("classify");
  arguments.scale = frame.at("scale");
  arguments.memory = frame.at("memory");
  arguments.lod_pixels = frame.at("lod_pixels");
  arguments.clip_box = given(frame, "clip_box");
  arguments.max_splats = given(frame, "max_splats");
  arguments.clip_planes = of<Texts>(others, "clip_planes");
  arguments.shade = of<bool>(others, "shade");
  arguments.light = given(frame, "light");
  arguments.light_direction = given(frame, "light_direction");
  arguments.threads = of<unsigned>(others, "threads");
  arguments.keep_going = of<bool>(others, "keep_going");
  return arguments;
}

SurfaceArguments surfaceArguments(const py::dict& others) {
  SurfaceArguments arguments;
  arguments.surfaces = of<Texts>(others, "surfaces");
  arguments.colours = of<Texts>(others, "surface_colours");
  arguments.surface_by = of<std::string>(others, "surface_by");
  arguments.surface_opacities = of<Texts>(others, "surface_opacity");
  arguments.slices = of<Texts>(others, "slices");
  arguments.slice_opacity = of<std::string>(others, "slice_opacity");
  arguments.isovalues = of<Texts>(others, "isovalues");
  if (others.contains("iso_opacity")) arguments.iso_opacity = of<std::string>(others, "iso_opacity");
  arguments.volume = of<bool>(others, "volume") ? "on" : "off";
  return arguments;
}

AnnotationArguments annotationArguments(const Options& frame, const py::dict& others) {
  AnnotationArguments arguments;
  arguments.bar_titles = of<Texts>(others, "scalar_bar_titles");
  arguments.axis_titles = given(frame, "axes_titles");
  arguments.shown.scalar_bar = of<bool>(others, "scalar_bar") || !arguments.bar_titles.empty();
  arguments.shown.axes = of<bool>(others, "axes");
  arguments.shown.axes_grid = of<bool>(others, "axes_grid") || arguments.axis_titles;
  arguments.shown.outline = of<bool>(others, "outline");
  return arguments;
}

StepArguments stepArguments(const Options& frame, const py::dict& others) {
  StepArguments arguments;
  arguments.step = of<std::optional<uint64_t>>(others, "step");
  arguments.time = given(frame, "time");
  arguments.interpolates = of<bool>(others, "interpolate");
  return arguments;
}

}  // namespace

CameraArguments cameraArguments(const Options& camera) {
  CameraArguments arguments;
  arguments.view = given(camera, "view");
  arguments.position = given(camera, "position");
  arguments.focal_point = given(camera, "focal_point");
  arguments.view_up = given(camera, "view_up");
  arguments.parallel_scale = given(camera, "parallel_scale");
  arguments.view_angle = given(camera, "view_angle");
  arguments.orbit = given(camera, "orbit");
  return arguments;
}

PictureArguments pictureArguments(const Options& function, const Options& camera, const Options& frame,
                                  const py::dict& others) {
  return {scalarArguments(function),
          opacityArguments(function),
          cameraArguments(camera),
          frameOptions(frameArguments(frame, others)),
          surfaceArguments(others),
          annotationArguments(frame, others),
          stepArguments(frame, others),
          valueChannels(given(frame, "channels"), "picture.exr"),
          parseBackend(of<std::string>(others, "backend"))};
}

}  // namespace curvisplat::python
