// The grids and the views of curvisplat_real_grids.
#pragma once

#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "render/camera/camera.h"

namespace curvisplat {

/// A grid to draw.
struct RealGrid {
  std::string name;
  std::function<std::unique_ptr<GridSource>()> open;
  std::string scalar;
};

/// Generated grids that have the troubles of real ones; and every grid of `data`, the folder of real grids,
/// that is there. Empty: the generated ones alone.
std::vector<RealGrid> realGrids(const std::filesystem::path& data);

struct NamedView {
  std::string name;
  Camera camera;
};

/// +x, +y and +z; each turned by 0.1, 1 and 3 degrees; and iso. All of the box is in the picture.
std::vector<NamedView> viewsOf(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

}  // namespace curvisplat
