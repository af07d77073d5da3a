// Lines and points as meshes: the sides of tubes and spheres that a viewer sees, with the normals of the round ones.
//
//   Curves --a view--> columns of quads along lines, discs at their ends and of points --> Surface
//
// They depend on the view. Points nearer to the last one than half a pixel are left out. A line is a tube of 4 quads round
// (16 if it is wide). Where it turns by more than 60 degrees, two tubes meet in a sphere. Takes up to some 300 bytes a
// point. Parallel over lines, on the caller's TBB arena; the same bits for any number of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

/// The curves of a scene as surfaces, each in data coordinates.
std::vector<Surface> curveSurfaces(const SurfaceScene& scene, const ScreenView& view);

/// The curves at a time: what it shows of those that have times.
std::vector<Curves> curvesAt(std::vector<Curves> curves, double time);
/// The scene with them; itself if none have times, or null.
std::shared_ptr<const SurfaceScene> sceneAtTime(std::shared_ptr<const SurfaceScene> scene, double time);

/// Memory, at most, of curveSurfaces().
uint64_t curveBytes(const SurfaceScene& scene);

}  // namespace curvisplat
