// Options of what is drawn over a picture: scalar bars, axes, outline, the axes grid, and their titles.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/annotate/annotations.h"
#include "render/frame/drawn_scalars.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct AnnotationArguments {
  Annotations shown;
  std::vector<std::string> bar_titles;
  std::optional<std::string> axis_titles;
};

/// Adds --scalar-bar, --scalar-bar-title, --axes, --axes-grid, --axes-titles and --outline under the heading `group`.
void addAnnotationOptions(CLI::App& command, AnnotationArguments& arguments, const std::string& group);

/// Throws UsageError if options contradict each other.
void checkAnnotationArguments(const AnnotationArguments& arguments);

/// Of the axes grid: "x", "y" and "z" unless --axes-titles says otherwise.
std::array<std::string, 3> axisTitles(const AnnotationArguments& arguments);

/// What a picture has to show, after `scale`: the data's box, and room for the coordinates of the axes grid around it.
struct ShownBox {
  glm::dvec3 lower{0.0}, upper{0.0};
};
ShownBox shownBox(const Manifest& manifest, const glm::dvec3& scale, const Annotations& annotations);

/// The functions that a picture shows, each once: of its colours, of its opacities if these are another scalar's, and of
/// surfaces that are coloured by a scalar of their own, `surface_by`. They are borrowed from `scalars` and `scene`,
/// which may be null. Throws UsageError for more titles than that.
std::vector<ShownFunction> shownFunctions(const AnnotationArguments& arguments, const DrawnScalars& scalars,
                                          const Manifest& manifest, const SurfaceScene* scene,
                                          const std::string& surface_by);

}  // namespace curvisplat
