// Annotations drawn over a picture: scalar bars, the directions of the axes, the box around the data, a grid
// with coordinates, markers; and a picture of the built-in colour maps. `render` and the window share them.
//
// Scalar bars have a strip of their own at the right, so that they never cover data. Drawing takes 4
// bytes a pixel, and 16 a pixel of the bars (annotatedBytes()). Pure; any thread. In a build without Cairo asking for an annotation is a
// UsageError.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <span>
#include <string>
#include <vector>

#include "render/annotate/annotated_scene.h"
#include "render/colour/transfer_function.h"
#include "render/image/image.h"

namespace curvisplat {

/// Whether this program was built with them.
bool hasAnnotations();

/// The annotations that are drawn over a picture.
struct Annotations {
  bool scalar_bar = false;
  bool axes = false;
  bool outline = false;
  bool axes_grid = false;
  bool texts = false;    // the scene's title and label
  bool markers = false;  // the scene's
  double text_size = 0;  // of the font, in pixels; 0: by the picture's size

  /// Whether lines of them lie behind the data, which then has to be drawn over a transparent background.
  bool lieBehind() const { return axes_grid || outline; }
  bool operator==(const Annotations&) const = default;
};

/// The size of the left part of `picture` that shows the data: all of it, or what the scalar bars leave. The
/// width of their strip depends on the labels and the picture's size, and is at most half of the
/// picture's.
ImageSize dataSize(const Annotations& annotations, ImageSize picture,
                   std::span<const ShownFunction> functions);
/// The size with one bar, of colours and opacities.
ImageSize dataSize(const Annotations& annotations, ImageSize picture, const TransferFunction& function);

/// Returns where the names of x, y and z stand at the ends of the axes' arrows, in pixels of the picture.
std::array<glm::dvec2, 3> axisNames(const AnnotatedScene& scene);

/// The whole picture: `data`, which has the size of scene.view, over the background where it is transparent,
/// and the annotations. Without a text size it follows the picture's size. Takes the memory of `data` if it is as
/// large as the picture, and frees it otherwise. Throws Error if the picture is larger than Cairo supports
/// (32,767 pixels a side).
Image annotated(Image data, const Annotations& annotations, const AnnotatedScene& scene);

/// Puts behind a picture, where it is transparent, the background and on it what lies behind the data: lines of the axes
/// grid, and the outline's edges on the far side. annotated() does it, too.
void putBehind(Image& picture, const Annotations& annotations, const AnnotatedScene& scene);

/// Memory that annotated() needs beside that of `data`, of this size, which it gives back meanwhile. Its result
/// is included.
uint64_t annotatedBytes(ImageSize picture, ImageSize data);

/// The annotations alone that lie over the data and beside it, for the whole picture: four bytes a pixel (red, green, blue, alpha; not
/// premultiplied). Throws as annotated() does.
std::vector<uint8_t> annotationLayer(const Annotations& annotations, const AnnotatedScene& scene);

/// A picture of the built-in colour maps with their names: by category, in three columns on white. Throws
/// UsageError in a build without Cairo.
Image colourMapSheet();

}  // namespace curvisplat
