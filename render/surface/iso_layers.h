// Isosurfaces as layers of the pixels. A ray through the middle of each pixel; four through those at outlines and
// folds, where a neighbour sees something else.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/light.h"
#include "render/project/pixel_layers.h"
#include "render/surface/iso_rays.h"

namespace curvisplat {

class IsoLayers {
 public:
  struct Look {
    const ColourTable& colours;
    std::optional<Light> light;  // none: a light at the viewer
    IsoOpacity opacity = {};
    bool colours_of_other = false;                               // of the other scalar
    std::span<const std::optional<glm::vec3>> own_colours = {};  // as IsoGroup::own_colours
  };
  explicit IsoLayers(ImageSize size);

  size_t tiles() const { return tiles_.size(); }
  /// Traces the tiles of the splats, which have to be complete and sorted. Parallel on the caller's TBB arena, with as
  /// many threads as `bytes` allow. Throws UsageError if they do not allow one. The same bits for any threads, bytes
  /// and ranges of tiles.
  void draw(const IsoSplats& splats, const Look& look, uint64_t bytes);

  /// The layers of a pixel, from the nearest on.
  std::span<const PixelLayer> at(int x, int y) const;

 private:
  struct Tile {
    std::vector<uint32_t> begins;  // [pixels of a whole tile + 1], or empty: nothing
    std::vector<PixelLayer> layers;
  };
  class Tracer;

  void drawTile(Tracer& tracer, size_t number);
  [[noreturn]] void throwTooLarge(size_t number, uint64_t taken, uint64_t bytes) const;

  ImageSize size_;
  size_t columns_;
  std::vector<Tile> tiles_;
};

}  // namespace curvisplat
