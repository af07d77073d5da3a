// Options of what is drawn over a picture: scalar bars, axes, the outline, the axes grid, titles and markers. Shared by
// the subcommands that draw.
//
// Arguments hold values as given and are checked without a cache. The functions keep no state: any thread may call them.
#pragma once

#include <CLI/CLI.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "render/annotate/annotations.h"
#include "render/frame/frame_options.h"
#include "render/project/plane_cuts.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/manifest.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/picture_texts.h"

namespace curvisplat {

/// Options of what is drawn over a picture, as given; checked and parsed later.
struct AnnotationArguments {
  Annotations shown;
  bool no_bars = false;  // none by default
  std::vector<std::string> bar_titles, markers;
  std::optional<std::string> axis_titles, title, label, text_size;

  /// Shows what the titles need, in text of the size that is given.
  void showTitles();
  /// Gives the axes grid the longitudes, latitudes and heights of `box`, if it is given, and their titles.
  void put(const std::optional<AnnotatedScene::OnGlobe>& box, AnnotatedScene& scene) const;
  /// The scene's texts, with their fields filled in, and its markers.
  void fill(const TextFields& fields, AnnotatedScene& scene) const;
};

/// Adds --scalar-bar, --scalar-bar-title, --axes, --axes-grid, --axes-titles, --outline, --marker, --title, --label and --text-size under
/// the heading `group`.
void addAnnotationOptions(CLI::App& command, AnnotationArguments& arguments, const std::string& group);

/// Throws UsageError if options contradict each other.
void checkAnnotationArguments(const AnnotationArguments& arguments);

/// The titles of the axes grid: "x", "y" and "z" unless --axes-titles says otherwise.
std::array<std::string, 3> axisTitles(const AnnotationArguments& arguments);

/// The box that a picture has to show, after --scale: the data's, or what a clip box leaves of it; and the
/// whole data's with an outline or the axes grid, with space for its coordinates.
ShownBox shownBox(const Manifest& manifest, const glm::dvec3& scale, const std::optional<WorldBox>& clip_box,
                  const Annotations& annotations);

/// The functions that a picture shows, each once: of its colours where anything has them, of its opacities if these are another
/// scalar's, and of surfaces that are coloured by a scalar of their own, `surface_by`. They are borrowed
/// from `scalars` and `scene`, which may be null. Throws UsageError for more titles than that.
std::vector<ShownFunction> shownFunctions(const AnnotationArguments& arguments, const DrawnScalars& scalars,
                                          const Manifest& manifest, const SurfaceScene* scene,
                                          const std::string& surface_by);

}  // namespace curvisplat
