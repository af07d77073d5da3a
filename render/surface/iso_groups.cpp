#include "render/surface/iso_groups.h"

namespace curvisplat {
namespace {

IsoGroup groupOf(size_t variable, const SheetOpacity& opacity, const PictureScalars& scalars) {
  const size_t colours = scalars.colours.value_or(scalars.opacities);
  IsoGroup group{variable};
  group.opacity = opacity;
  if (variable != colours) {
    group.other = colours;
    group.colours_of_other = true;
    group.opacities_of_other = colours == scalars.opacities;
    group.opacity.by_function &= group.opacities_of_other || variable == scalars.opacities;
  } else if (opacity.by_function && variable != scalars.opacities) {
    group.other = scalars.opacities;
    group.opacities_of_other = true;
  }
  return group;
}

}  // namespace

std::vector<IsoGroup> isoGroups(const SurfaceScene& scene, const PictureScalars& scalars) {
  std::vector<IsoGroup> groups;
  const auto add = [&](size_t variable, const std::vector<double>& values,
                       const std::vector<std::optional<glm::vec3>>& own_colours) {
    if (values.empty()) return;
    IsoGroup& group = groups.emplace_back(groupOf(variable, scene.iso_opacity, scalars));
    group.values = values;
    group.own_colours = own_colours;
  };
  add(scalars.opacities, scene.isovalues, scene.iso_colours);
  for (const FurtherIsosurfaces& further : scene.further_isosurfaces)
    add(further.variable, further.values, further.own_colours);
  return groups;
}

}  // namespace curvisplat
