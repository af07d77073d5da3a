// The longitudes, latitudes and heights that the data of a cache covers: the box of its axes grid. Pure; any thread.
#pragma once

#include <optional>

#include "render/annotate/annotated_scene.h"
#include "render/camera/camera.h"
#include "render/image/image.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/globe.h"

namespace curvisplat {

/// The longitudes, latitudes and heights of the data, from a coarse level of the cache; all around the Earth from -180 degrees.
/// nullopt if the globe has no degrees. Reads some 100,000 splats; throws Error if that fails.
std::optional<AnnotatedScene::OnGlobe> boxOnGlobe(const CacheReader& cache,
                                                  const std::optional<Globe>& globe);

/// A camera in perspective that looks down at the middle of data on a sphere, at the Earth's middle, north up. A picture of `size`
/// shows the data whole, or the half of the Earth that is seen. `scale`: of the data.
Camera cameraAbove(const AnnotatedScene::OnGlobe& box, const glm::dvec3& scale, ImageSize size);

/// Gives the axes grid of a scene this box, if there is one, and the titles of its axes.
void showOnGlobe(const std::optional<AnnotatedScene::OnGlobe>& box, AnnotatedScene& scene);

}  // namespace curvisplat
