// The globe on which the grid of a cache lies, as the cache or --globe says; and what options say in longitude, latitude and
// height: cameras, the box of the axes grid. The functions keep no state: any thread may call them.
#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

#include "render/annotate/annotated_scene.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/globe.h"
#include "tools/options/frame_sequence.h"

namespace curvisplat {

/// Adds --globe.
void addGlobeOption(CLI::App& command, std::optional<std::string>& text, const std::string& group);

/// The globe of the option RADIUS[,SCALE] if it is given, else the cache's. Throws UsageError.
std::optional<Globe> globeOf(const std::optional<std::string>& text, const Manifest& manifest);

/// Adds --look-at and --from-height.
void addLookAtOptions(CLI::App& command, CameraArguments& arguments, const std::string& group);

/// The camera of --look-at, if it is given, by its position. `scale`: that of the data. Throws UsageError if it is wrong, or
/// the cache has no globe.
CameraArguments placedAbove(const CameraArguments& arguments, const std::optional<Globe>& globe,
                            const glm::dvec3& scale);

/// The scale of a picture with --vertical-scale: heights are exaggerated by that factor, whatever the cache has been converted
/// with. Without `text` it is `scale`. Throws UsageError on a sphere, or where `scale` stretches z as well.
glm::dvec3 verticallyScaled(const glm::dvec3& scale, const std::optional<std::string>& text,
                            const std::optional<Globe>& globe);

/// The box that a picture has to show, after --scale, with the axes grid of `on_globe`.
ShownBox withGrid(const ShownBox& shown, const std::optional<AnnotatedScene::OnGlobe>& on_globe,
                  const glm::dvec3& scale);

}  // namespace curvisplat
