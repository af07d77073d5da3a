// The image of a map of the whole Earth, and where it lies: on the globe of the data, as a surface of its own, or on other
// surfaces that have no values.
//
// Equirectangular: the first row begins at 90 degrees north, the first column at 180 degrees west. Colours are filtered
// between pixels, and over as many as a pixel of the picture sees: levels of half the size each, as of textures (mip maps).
// Three bytes a pixel and a third more. Immutable; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "render/image/image.h"
#include "render/mesh/triangle_mesh.h"
#include "stream/model/globe.h"

namespace curvisplat {

class MapImage {
 public:
  /// The image is at least 2 pixels wide and 1 high. What is transparent shows white.
  explicit MapImage(const Image& image);

  /// The colour at a place, in degrees east and north, seen by a pixel that is `degrees` wide there.
  glm::vec3 at(double longitude, double latitude, double degrees) const;
  uint64_t bytes() const;

 private:
  struct Level {
    int width, height;
    std::vector<uint8_t> rgb;
  };
  static Level halved(const Level& level);
  static glm::vec3 between(const Level& level, double longitude, double latitude);

  std::vector<Level> levels_;  // from the finest on
};

/// A map where the data's globe has it.
struct PlacedMap {
  MapImage image;
  Globe globe;  // of degrees

  /// The colour at a point of the data, seen by a pixel that is `pixel` wide there, in kilometres.
  glm::vec3 at(const glm::dvec3& point, double pixel) const;
};

/// Reads a map from an image file (readImage() in render/image/image_file.h). Throws Error if it is none, is not twice as wide
/// as high, or has more than 2^26 pixels.
MapImage readMapImage(const std::filesystem::path& path);

/// The globe, or the flat map of all longitudes and latitudes, at a height in kilometres, as a mesh of quads of one degree,
/// whose corners lie there. The globe has degrees, and its radius there is positive.
TriangleMesh meshOfGlobe(const Globe& globe, double height_km);

}  // namespace curvisplat
