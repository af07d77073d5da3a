// The part of lines and points with times, such as trajectories, that a time shows. Any thread.
#pragma once

#include <memory>
#include <vector>

#include "render/surface/surface_scene.h"

namespace curvisplat {

/// The curves at a time: what it shows of those that have times.
std::vector<Curves> curvesAt(std::vector<Curves> curves, double time);
/// The scene with them; itself if none have times, or null.
std::shared_ptr<const SurfaceScene> sceneAtTime(std::shared_ptr<const SurfaceScene> scene, double time);

}  // namespace curvisplat
