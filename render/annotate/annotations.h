// What is drawn over a picture so that people can read it: the scalar bar, the axes' directions, the box
// around the data. The same in `render` and in the window.
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

/// The part of a picture of `picture` pixels that shows the data, from the left: all of it, or what the
/// scalar bar leaves. The bar has a strip of its own, so that it never covers data; its width depends on the
/// labels and the picture's height, and is at most half of the picture's.
ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function);

/// What there is to annotate. The function outlives the call.
struct AnnotatedScene {
  ImageSize picture;  // all of it
  ScreenView view;    // of dataSize()
  const TransferFunction& transfer_function;
  std::string title;                  // of the scalar bar: "density [kg/m3]"
  glm::dvec3 lower{0.0}, upper{0.0};  // the box around the data, before --scale
  glm::vec4 background{1, 1, 1, 1};   // text and lines are black on a light one, white on a dark one
};

/// The whole picture, from `data` of the size of scene.view. Text is sized by the picture's height. Throws
/// Error where the picture is larger than Cairo draws (32,767 pixels a side).
Image annotated(const Image& data, const Annotations& annotations, const AnnotatedScene& scene);

/// What annotated() takes in memory, its result included.
uint64_t annotatedBytes(ImageSize picture);

/// The annotations alone, for the whole picture: four bytes a pixel, red, green, blue, alpha, colours not
/// multiplied. Throws as annotated() does.
std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene);

/// "density [kg/m3]"; "density" where the unit is unknown.
std::string scalarTitle(const std::string& name, const std::string& unit);

}  // namespace curvisplat
