// Which borders of a node's cell are still open once the parts that coincide there are merged: two halves of
// two blocks close the border between them, while a face that both of them end at stays one.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/splats/face_layers.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Whether the border that `splat` lies behind is one of those of the splat `face` that are faces to be cut
/// at.
bool isOpen(const Splat& face, uint32_t border_code, const Splat& behind);

class OpenBorders {
 public:
  void clear() {
    inward_.clear();
    parts_ = 0;
  }
  void add(const Splat& part, uint32_t border_code);
  /// The half cell of `merged`, the parts' splat. A direction inwards is closed by another part's opposite
  /// one, and several parts' similar ones are one, with a face to be cut at if all have; angles are measured
  /// in the merged cell's own frame, where thin cells are round.
  uint32_t of(const Splat& merged) const { return of(merged, {}).code; }

  /// A face that one of the parts lies in the layer behind of.
  struct Layer {
    glm::dvec3 inward{0.0};  // world units, as long as the cell
    glm::dvec3 face{0.0};    // a point of it
    uint8_t axis = 0;        // LayerAxis'
  };
  /// The same with such faces, but for those across directions in which any of the parts ends.
  LayeredBorder of(const Splat& merged, std::span<const Layer> layers) const;

 private:
  struct Inward {
    glm::dvec3 along;  // world units, as long as the part's cell
    size_t part;
    bool face;
  };
  std::vector<Inward> inward_;
  size_t parts_ = 0;
};

}  // namespace curvisplat
