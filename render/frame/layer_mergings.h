// How layers of thin cells are merged in the pictures of one transfer function (stream/paging/layer_merger.h): within voxels of
// about a pixel, and within bins of the scalar in which the function shows nearly the same. DESIGN.md, "Thin cells".
//
// Lengths of voxels go in steps, so that a camera that moves a little finds bricks as it left them. One thread at a time.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <map>
#include <memory>

#include "render/colour/classification.h"
#include "stream/paging/layer_merger.h"

namespace curvisplat {

class LayerMergings {
 public:
  struct Functions {
    const ClassificationTable& table;
    const ClassificationTable* colours;  // of pictures of two scalars; otherwise null
    glm::dvec3 scale;                    // the stretching of the data
  };

  /// The merging where this length may be lost, after stretching: for voxels of 1.37 to 1.64 times it. Null if the length is not
  /// a positive finite number. The same object, and number, while the functions and the step of the length are the same; after
  /// a change of the functions' tables a new LayerMergings is needed.
  std::shared_ptr<const LayerMerging> of(double length, const Functions& functions);

 private:
  glm::dvec3 scale_{0.0};
  std::map<int, std::shared_ptr<const LayerMerging>> steps_;
};

}  // namespace curvisplat
