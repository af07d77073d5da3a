#include "render/surface/curve_times.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "render/mesh/curve_set.h"

namespace curvisplat {

std::vector<Curves> curvesAt(std::vector<Curves> curves, double time) {
  constexpr double kBefore = -std::numeric_limits<double>::infinity();
  for (Curves& one : curves)
    if (one.whole)
      one.set = std::make_shared<CurveSet>(
          one.places ? placesAt(*one.whole, time)
                     : partBetween(*one.whole, one.tail ? time - *one.tail : kBefore, time));
  return curves;
}

std::shared_ptr<const SurfaceScene> sceneAtTime(std::shared_ptr<const SurfaceScene> scene, double time) {
  const auto has_times = [](const Curves& one) { return one.whole != nullptr; };
  if (!scene || std::none_of(scene->curves.begin(), scene->curves.end(), has_times)) return scene;
  auto timed = std::make_shared<SurfaceScene>(*scene);
  timed->curves = curvesAt(std::move(timed->curves), time);
  return timed;
}

}  // namespace curvisplat
