// Annotations drawn over a picture: scalar bars, the directions of the axes, the box around the data, a grid with
// coordinates. The same in `render` and in the window.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "render/annotate/annotated_scene.h"
#include "render/colour/transfer_function.h"
#include "render/image/image.h"

namespace curvisplat {

struct Annotations {
  bool scalar_bar = false;
  bool axes = false;
  bool outline = false;
  bool axes_grid = false;  // its lines lie behind the data if that is over a transparent background
  bool operator==(const Annotations&) const = default;
};

/// The size of the left part of `picture` that shows the data: all of it, or what the scalar bars leave. They
/// have a strip of their own, so that they never cover data. Its width depends on the labels and the
/// picture's height, and is at most half of the picture's.
ImageSize dataSize(const Annotations& annotations, ImageSize picture,
                   std::span<const ShownFunction> functions);
/// With one bar.
ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function);

/// The whole picture: `data`, which has the size of scene.view, over the background where it is transparent, and the
/// annotations. The text's size follows
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
