// Finds the walls of a grid without boundary conditions by its flow: parts of its outer faces where nothing moves. Reads
// the values that the cache keeps on its faces. Keeps no state: any thread may call it.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/surface/surface_scene.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

/// Reads the faces with the values of a scalar; throws Error if they lack them.
using FacesWith = std::function<std::shared_ptr<const FacesReader>(const std::string& scalar)>;

/// The rectangles of `faces` in which the velocity (or the momentum) is zero at the nodes: of each
/// outer face one at most, nine tenths of whose cells are so. Empty if the cache has not all components, or its faces lack them.
/// Takes a byte a node of a face. Throws Error if reading fails.
std::vector<GridSurface::Part> stillParts(const Manifest& manifest, const FacesReader& faces,
                                          const FacesWith& faces_with);

}  // namespace curvisplat
