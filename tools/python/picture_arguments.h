// What the package's render() passes, as the arguments of `curvisplat render`: values come as text, so that the two read them
// alike.
#pragma once

#include <pybind11/pybind11.h>

#include <map>
#include <string>

#include "render/frame/frame.h"
#include "tools/options/annotation_arguments.h"
#include "tools/options/camera_motion.h"
#include "tools/options/channel_arguments.h"
#include "tools/options/frame_arguments.h"
#include "tools/options/opacity_arguments.h"
#include "tools/options/scalar_arguments.h"
#include "tools/options/step_arguments.h"
#include "tools/options/surface_arguments.h"

namespace curvisplat::python {

/// Text by option.
using Options = std::map<std::string, std::string>;

/// Everything a picture is drawn with. What the function and the camera leave out is chosen from the data.
struct PictureArguments {
  ScalarArguments scalar;
  OpacityArguments opacity;
  CameraArguments camera;
  FrameOptions frame;
  SurfaceArguments surfaces;
  AnnotationArguments annotations;
  StepArguments steps;  // one
  ValueChannels channels;
  Backend backend = Backend::kAutomatic;
};

CameraArguments cameraArguments(const Options& camera);

/// `others`: lists, flags and numbers. Throws UsageError as the command does.
PictureArguments pictureArguments(const Options& function, const Options& camera, const Options& frame,
                                  const pybind11::dict& others);

}  // namespace curvisplat::python
