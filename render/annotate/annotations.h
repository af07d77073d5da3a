// Annotations drawn over a picture: the scalar bar, the directions of the axes, the box around the data. The
// same in `render` and in the window.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/project/screen_view.h"

namespace curvisplat {

struct Annotations {
  bool scalar_bar = false;
  bool axes = false;
  bool outline = false;
  bool operator==(const Annotations&) const = default;
};

/// The size of the left part of `picture` that shows the data: all of it, or what the scalar bar leaves. The
/// bar has a strip of its own, so that it never covers data. Its width depends on the labels and the
/// picture's height, and is at most half of the picture's.
ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function);

/// What to annotate. The transfer function is borrowed for the call.
struct AnnotatedScene {
  ImageSize picture;  // the whole picture
  ScreenView view;    // has dataSize()
  const TransferFunction& transfer_function;
  std::string title;                  // of the scalar bar: "density [kg/m3]"
  glm::dvec3 lower{0.0}, upper{0.0};  // the box around the data, before --scale
  glm::vec4 background{1, 1, 1, 1};   // text and lines are black if it is light, else white
};

/// The whole picture: `data`, which has the size of scene.view, and the annotations. The text's size follows
/// the picture's height. Throws Error if the picture is larger than Cairo supports (32,767 pixels a side).
Image annotated(const Image& data, const Annotations& annotations, const AnnotatedScene& scene);

/// Memory that annotated() needs, its result included.
uint64_t annotatedBytes(ImageSize picture);

/// The annotations alone, for the whole picture: four bytes a pixel (red, green, blue, alpha; not
/// premultiplied). Throws as annotated() does.
std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene);

/// "density [kg/m3]", or "density" if the unit is unknown.
std::string scalarTitle(const std::string& name, const std::string& unit);

}  // namespace curvisplat
