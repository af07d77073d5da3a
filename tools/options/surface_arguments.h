// Options that put surfaces and slices into a picture, shared by the subcommands that draw.
#pragma once

#include <CLI/CLI.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "render/surface/surface_scene.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct SurfaceArguments {
  std::vector<std::string> surfaces, colours, slices;
  std::string slice_opacity = "1", volume = "on";

  bool given() const { return !surfaces.empty() || !slices.empty() || volume != "on"; }
};

/// Adds --surface, --surface-colour, --slice, --slice-opacity and --volume under the heading `group`.
void addSurfaceOptions(CLI::App& command, SurfaceArguments& arguments, const std::string& group);

/// Throws UsageError for what cannot be: without a look at any file.
void checkSurfaceArguments(const SurfaceArguments& arguments);

/// Reads the surfaces. Null where none of the options is given. Throws Error for a file that is no surface.
std::shared_ptr<const SurfaceScene> sceneOf(const SurfaceArguments& arguments);

/// One line for each slice that does not meet the data's box.
std::vector<std::string> slicesThatMiss(const SurfaceArguments& arguments, const glm::dvec3& lower,
                                        const glm::dvec3& upper);

}  // namespace curvisplat
