// Which borders of a node's cell are still open once the parts that coincide there are merged: two halves of
// two blocks close the border between them, while a face that both of them end at stays one.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "stream/model/border_code.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Whether the border that `splat` lies behind is one of those of the splat `face` that are faces to be cut
/// at.
bool isOpen(const Splat& face, uint32_t border_code, const Splat& behind);

class OpenBorders {
 public:
  void add(const Splat& part, uint32_t border_code);
  /// The half cell of `merged`, the parts' splat. A direction inwards is closed by another part's opposite
  /// one, and several parts' similar ones are one, with a face to be cut at if all have; angles are measured
  /// in the merged cell's own frame, where thin cells are round.
  uint32_t of(const Splat& merged) const;

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
