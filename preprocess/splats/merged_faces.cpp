#include "preprocess/splats/merged_faces.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "stream/model/border_code.h"
#include "stream/model/layers_code.h"

namespace curvisplat {
namespace {

constexpr double kSimilar = 0.7;  // cosine: of one plane
// Of two that close one another, or of a layer thinner than a voxel. Beyond the -0.5 of the sides of a regular hexagon or a
// triangle, which rounding would decide.
constexpr double kOpposite = -0.55;
constexpr double kEven = 0.9;  // the length of a mean of unit vectors that are about the same
// How far a splat's middle is from a face that it ends at, in its lengths: a box's is 1/2, a wedge's 0.41 or 0.82.
constexpr double kNearest = 0.37, kFarthest = 0.85;
constexpr double kTouching = 0.3;  // what part of its section has to

}  // namespace

bool isClosed(const VoxelPlanes::Plane& plane, std::span<const VoxelPlanes::Plane> all) {
  return !plane.face || std::any_of(all.begin(), all.end(), [&](const VoxelPlanes::Plane& other) {
    return glm::dot(other.inward, plane.inward) < kOpposite;
  });
}

void MergedFaces::clear() {
  std::fill(first_.begin(), first_.end(), kNone);
  sums_.clear();
}

void MergedFaces::add(size_t voxel, const glm::dvec3& position, const Splat& splat, uint32_t border_code) {
  const InwardAxes inward = inwardAxes(border_code);
  const uint32_t layers = layersOf(border_code);
  for (int a = 0; a < 3; ++a) {
    const bool is_layer = (layers >> a & 1) != 0;
    if (a >= inward.count && !is_layer) continue;
    const glm::dvec3 q(inward.axis[static_cast<size_t>(a)]);
    const glm::dvec3 per_length = gradientOf(splat, q);
    const double thickness = 1 / glm::length(per_length);
    if (!(thickness > 0 && std::isfinite(thickness))) continue;
    const glm::dvec3 normal = thickness * per_length;
    const double section = splat.weight / thickness;
    Sums* sums = nullptr;
    size_t count = 0;
    for (uint32_t n = first_[voxel]; n != kNone && !sums; n = sums_[n].next, ++count)
      if (glm::dot(sums_[n].inward, normal) > kSimilar * glm::length(sums_[n].inward)) sums = &sums_[n];
    if (!sums) {
      if (count == VoxelPlanes::kMax) continue;
      sums = &sums_.emplace_back();
      sums->next = first_[voxel];
      first_[voxel] = static_cast<uint32_t>(sums_.size() - 1);
    }
    sums->inward += section * normal;
    const double distance = is_layer ? layerDistance(0) : inward.distance;
    sums->point += section * (position - distance * (splat.factor() * q));
    sums->section += section;
    sums->face &= is_layer || inward.hasFace(a);
    if (is_layer || inward.behind) continue;
    sums->area += section;
    sums->thickest = std::max(sums->thickest, thickness);
  }
}

VoxelPlanes MergedFaces::of(size_t voxel) const {
  VoxelPlanes found;
  for (uint32_t n = first_[voxel]; n != kNone; n = sums_[n].next) {
    const Sums& sums = sums_[n];
    const double length = glm::length(sums.inward);
    if (!(length > 0)) continue;
    found.planes[found.count++] = {sums.inward / length, sums.point / sums.section, sums.area, sums.thickest,
                                   sums.face && length > kEven * sums.section};
  }
  return found;
}

uint32_t mergedBorderCode(const VoxelPlanes& planes, const glm::dvec3& position, const Splat& merged,
                          double voxel_size) {
  struct Face {
    glm::dvec3 q;  // in the splat's frame
    double distance, area, ratio;
    bool touched;
  };
  std::array<Face, VoxelPlanes::kMax> faces;
  size_t count = 0;
  for (size_t n = 0; n < planes.count; ++n) {
    const auto& plane = planes.planes[n];
    if (isClosed(plane, std::span(planes.planes).first(planes.count))) continue;
    const glm::dvec3 in_frame = plane.inward * merged.factor();
    const double length = glm::length(in_frame), middle = glm::dot(plane.inward, position - plane.point);
    if (!(middle > kNearest * length)) continue;
    const double behind = std::max(voxel_size, 2 * plane.thickest);
    const bool touched = 2 * middle * plane.area > kTouching * merged.weight && middle < kFarthest * length;
    const Face face{in_frame / length, middle / length, plane.area, behind / (2 * middle), touched};
    size_t at = count++;  // the most important first
    for (; at > 0 && std::pair(touched, face.area) > std::pair(faces[at - 1].touched, faces[at - 1].area);
         --at)
      faces[at] = faces[at - 1];
    faces[at] = face;
  }
  if (count == 0) return kNoBorder;
  std::array<glm::dvec3, 3> axes;
  size_t touched = 0;
  for (size_t n = 0; n < count && touched < 3; ++n) {
    if (!faces[n].touched) break;
    glm::dvec3 axis = faces[n].q;
    for (size_t m = 0; m < touched; ++m) axis -= glm::dot(axis, axes[m]) * axes[m];
    if (glm::length(axis) > kSimilar) axes[touched++] = glm::normalize(axis);
  }
  if (touched > 1) return packBorderCode({axes.data(), touched}, (1u << touched) - 1);
  const Face& face = faces[0];
  if (face.touched) return packMergedCode(face.q, face.distance, face.ratio);
  return packLayerCode(face.q, face.distance);
}

}  // namespace curvisplat
