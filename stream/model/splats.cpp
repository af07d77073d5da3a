#include "stream/model/splats.h"

namespace curvisplat {

void SplatGeometry::resize(size_t count) {
  forEachArrayOfGeometry(*this, [&](auto& array) { array.resize(count); });
}

void SplatVariable::resize(size_t count) {
  forEachArrayOfVariable(*this, [&](auto& array) { array.resize(count); });
}

GeometryArrays<float> arraysOf(SplatGeometry& g) {
  return {g.x.data(),           g.y.data(),           g.z.data(),       g.axis0.data(),   g.axis1.data(),
          g.axis2.data(),       g.shear10.data(),     g.shear20.data(), g.shear21.data(), g.weight.data(),
          g.border_code.data(), g.growth_code.data(), g.size()};
}

VariableArrays<float> arraysOf(SplatVariable& v) {
  return {v.mean.data(), v.slope0.data(), v.slope1.data(), v.slope2.data(), v.variance.data(), v.size()};
}

GeometryArrays<const float> arraysOf(const SplatGeometry& g) {
  return {g.x.data(),           g.y.data(),           g.z.data(),       g.axis0.data(),   g.axis1.data(),
          g.axis2.data(),       g.shear10.data(),     g.shear20.data(), g.shear21.data(), g.weight.data(),
          g.border_code.data(), g.growth_code.data(), g.size()};
}

VariableArrays<const float> arraysOf(const SplatVariable& v) {
  return {v.mean.data(), v.slope0.data(), v.slope1.data(), v.slope2.data(), v.variance.data(), v.size()};
}

}  // namespace curvisplat
