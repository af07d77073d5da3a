#include "stream/splats.h"

namespace curvisplat {

void SplatGeometry::resize(size_t count) {
  for (auto* array : {&x, &y, &z, &axis0, &axis1, &axis2, &shear10, &shear20, &shear21, &weight})
    array->resize(count);
}

void SplatVariable::resize(size_t count) {
  for (auto* array : {&mean, &slope0, &slope1, &slope2, &variance}) array->resize(count);
}

}  // namespace curvisplat
