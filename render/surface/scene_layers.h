// Puts surfaces, slices and isosurfaces together as the layers of a picture: what the samples of its pixels
// see of triangles, and where their rays cross planes and isosurfaces, in the order of depth.
//
// The same bits for any number of threads. Parallel on the caller's TBB arena, a tile of samples at a time.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/light.h"
#include "render/project/pixel_layers.h"
#include "render/project/screen_view.h"
#include "render/project/shadow_grid.h"
#include "render/surface/iso_layers.h"
#include "render/surface/scene_triangles.h"
#include "render/surface/slice_sampler.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

/// Whether anything in a picture of this scene has the colours of the picture's function.
bool usesColours(const SurfaceScene& scene);

/// Translucent surfaces that are seen through one another at a sample, at most: more than a pixel has layers, whose last one
/// takes what lies behind it.
inline constexpr size_t kMaxPeels = 8;

struct SceneLook {
  const ColourTable& colours;              // of scalars
  std::optional<Light> light;              // of surfaces; none: a light at the viewer
  std::span<const ClipPlane> clip_planes;  // of slices
  double depth_origin = 0;
  // The picture's function, if slices or surfaces take their opacities from it; and, where it is of another
  // scalar, that scalar's samples of slices.
  const ColourTable* opacities = nullptr;
  std::span<const std::unique_ptr<SliceSampler>> opacity_slices = {};
  std::span<const IsoLayers> isosurfaces = {};  // of one scalar each
  std::span<const double> isovalues = {};       // of the scene's last surfaces, which are isosurfaces
  const ShadowGrid* shadows = nullptr;          // of the volume, on surfaces and isosurfaces
  std::function<void()> throw_if_stopped = {};  // any thread
};

/// The layers of a picture. `slices`: those of the scene that were sampled, complete. Takes 256 KiB a thread
/// (with translucent surfaces 2 MiB), and 12 bytes a vertex and at most some 8 a triangle of surfaces; the
/// vertices' stay in `memory`, if there is one, for the next picture.
PixelLayers layersOf(const SurfaceScene& scene, const ScreenView& view,
                     std::span<const std::unique_ptr<SliceSampler>> slices, const SceneLook& look,
                     ScreenVertices* memory = nullptr);

}  // namespace curvisplat
