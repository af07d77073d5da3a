#include "render/project/splat_pieces.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

#include "stream/model/border_code.h"
#include "stream/model/fits.h"

namespace curvisplat {

OrthographicMap::OrthographicMap(const ScreenView& view, const glm::dvec3& origin) {
  const glm::dvec2 at = view.pixelFromView(view.viewFromData(origin));
  const glm::dvec3 across = view.focal_px * view.right * view.scale,
                   along = view.focal_px * view.down * view.scale;
  x = static_cast<float>(at.x);
  y = static_cast<float>(at.y);
  rows = {static_cast<float>(across.x), static_cast<float>(across.y), static_cast<float>(across.z),
          static_cast<float>(along.x),  static_cast<float>(along.y),  static_cast<float>(along.z)};
  depth = glm::vec3(view.forward * view.scale);
  focal_px = static_cast<float>(view.focal_px);
  volume = static_cast<float>(view.focal_px * view.focal_px * view.scale.x * view.scale.y * view.scale.z);
  low_pass = {static_cast<float>(view.low_pass_px2), static_cast<float>(view.slope_low_pass_px2)};
}

PerspectiveMap::PerspectiveMap(const ScreenView& view, const glm::dvec3& origin_, float coarseness)
    : origin(view.viewFromData(origin_)),
      right(view.right * view.scale),
      down(view.down * view.scale),
      forward(view.forward * view.scale),
      scale(view.scale),
      middle_x(0.5f * static_cast<float>(view.size.width)),
      middle_y(0.5f * static_cast<float>(view.size.height)),
      focal_px(static_cast<float>(view.focal_px)),
      volume(static_cast<float>(view.scale.x * view.scale.y * view.scale.z)),
      near(static_cast<float>(view.near) * coarseness),
      widest(static_cast<float>(view.widest) * coarseness),
      low_pass{static_cast<float>(view.low_pass_px2), static_cast<float>(view.slope_low_pass_px2)} {
  const double base = view.orderBase(origin_);
  order_base = static_cast<float>(base);
  from_base = static_cast<float>(view.viewFromData(origin_).z - base);
  const auto reach = static_cast<float>(kKernelSupport) * std::sqrt(low_pass.footprint_px2);
  tangent_x = (middle_x + reach) / focal_px;
  tangent_y = (middle_y + reach) / focal_px;
  slant_x = std::sqrt(1 + tangent_x * tangent_x);
  slant_y = std::sqrt(1 + tangent_y * tangent_y);
}

std::array<SplatPiece, 2> halve(const SplatPiece& piece, int column) {
  const Shape& s = piece.shape;
  const glm::vec3 columns[3] = {s.axis0 * glm::vec3(1, s.shear10, s.shear20),
                                s.axis1 * glm::vec3(0, 1, s.shear21), s.axis2 * glm::vec3(0, 0, 1)};
  const glm::vec3 step = 0.25f * columns[column];
  SplatPiece half = piece;
  half.weight *= 0.5f;
  half.growth.count = 0;
  half.across[column] *= 0.5f;
  float& axis = column == 0 ? half.shape.axis0 : column == 1 ? half.shape.axis1 : half.shape.axis2;
  float& slope = column == 0 ? half.slope.w0 : column == 1 ? half.slope.w1 : half.slope.w2;
  const float mean_step = 0.25f * slope;
  axis *= 0.5f;
  slope *= 0.5f;

  std::array<SplatPiece, 2> halves{half, half};
  halves[0].position -= step;
  halves[0].mean -= mean_step;
  halves[1].position += step;
  halves[1].mean += mean_step;
  for (int n = 0; n < piece.faces.count; ++n) {
    const CutFace& face = piece.faces.face[static_cast<size_t>(n)];
    glm::vec3 inward = face.inward;
    inward[column] *= 0.5f;
    const float inverse = 1 / glm::length(inward), step_inward = 0.25f * face.inward[column];
    halves[0].faces.face[static_cast<size_t>(n)] = {inverse * inward, inverse * (face.distance - step_inward),
                                                    face.edge_on};
    halves[1].faces.face[static_cast<size_t>(n)] = {inverse * inward, inverse * (face.distance + step_inward),
                                                    face.edge_on};
  }
  return halves;
}

namespace {

/// L of M = L Lᵀ.
struct Cholesky {
  float l00, l10, l11, l20, l21, l22;

  Cholesky(float m00, float m10, float m11, float m20, float m21, float m22) {
    l00 = std::sqrt(m00);
    l10 = m10 / l00;
    l20 = m20 / l00;
    l11 = std::sqrt(m11 - l10 * l10);
    l21 = (m21 - l20 * l10) / l11;
    l22 = std::sqrt(m22 - l20 * l20 - l21 * l21);
  }
};

/// Lᵀ u.
glm::vec3 transposed(const Cholesky& l, const glm::vec3& u) {
  return {l.l00 * u.x + l.l10 * u.y + l.l20 * u.z, l.l11 * u.y + l.l21 * u.z, l.l22 * u.z};
}

/// The piece whose S is A M Aᵀ: its A is A L, and the slope along its columns Lᵀ w.
void reshape(SplatPiece& piece, const Cholesky& l) {
  const Shape s = piece.shape;
  const glm::vec3 w = transposed(l, {piece.slope.w0, piece.slope.w1, piece.slope.w2});
  const float a0 = s.axis0 * l.l00, a1 = s.axis1 * l.l11;
  piece.shape = {a0,
                 a1,
                 s.axis2 * l.l22,
                 s.shear10 + s.axis1 * l.l10 / a0,
                 s.shear20 + (s.axis1 * s.shear21 * l.l10 + s.axis2 * l.l20) / a0,
                 s.shear21 + s.axis2 * l.l21 / a1};
  piece.slope = {w.x, w.y, w.z};
}

constexpr float kAlong = 0.5f;  // of the cosine: a lattice's axis that is this direction

/// `a` + g `b`.
BorderPart changed(const BorderPart& a, float g, const BorderPart& b) {
  return {a.offset + g * b.offset, a.size + g * b.size, a.share + g * b.share};
}

/// How a cell at a border is cut where cells grow from the border inwards by e^g. The slopes and reaches of
/// border_code.h allow for it.
BorderPart cutOfGrowing(const BorderPart& cut, float g) {
  if (g == 0) return cut;
  const bool half = cut.size == kHalfCellStyle.cut.size;
  g = std::max(g, -0.25f);
  if (half) return changed(cut, g, changed(kHalfCutByGrowth, std::min(g, 0.3f), kHalfCutByGrowth2));
  return changed(cut, g, g > 0 ? kWholeCutByGrowth : kWholeCutByShrinking);
}

/// Number `n`, 0 or 1, of the two splats that a whole cell at a face is cut as: the next cell beyond the face, as long as the
/// cells' growth makes it, and the cell itself. They are as in the middle of the grid: drifted (preprocess/splats/stretch.h).
BorderPart pairOfGrowing(size_t n, float g) {
  g = std::clamp(g, -0.5f, 0.5f);
  if (n != 0) return {kDrift * g, 1, 1};
  const float next = std::exp(-g);
  return {-0.5f - 0.5f * next + kDrift * g * next, next, next};
}

/// The growth along q.
float growthAlong(const GrowthAxes& growth, const glm::vec3& q) {
  float along = 0;
  for (size_t n = 0; n < growth.count; ++n) {
    const float share = glm::dot(growth.unit[n], q);
    if (std::abs(share) > kAlong) along += share < 0 ? -growth.growth[n] : growth.growth[n];
  }
  return along;
}

/// Lengthens what the growth's axes have along A q by the part's size. Half cells that are cut are skewed by less along
/// that axis; cells that are drawn in two parts are not skewed along it. `skew`: the
/// factor.
void resize(GrowthAxes& growth, const Shape& shape, const glm::vec3& q, const BorderPart& part, float skew) {
  const glm::vec3 along = inSpace(shape, q);
  for (size_t n = 0; n < growth.count; ++n) {
    const float share = glm::dot(growth.unit[n], q);
    growth.along[n] += (part.size - 1) * share * along;
    if (std::abs(share) > kAlong) growth.growth[n] *= skew;
  }
}

}  // namespace

size_t partsAtBorder(const SplatPiece& whole, uint32_t border_code, const BorderStyle& style,
                     BorderPieces& pieces) {
  return partsAtBorder(whole, inwardAxes(border_code), layersOf(border_code), style, pieces);
}

size_t partsAtBorder(const SplatPiece& whole, const InwardAxes& inward, uint32_t layers,
                     const BorderStyle& style, BorderPieces& pieces) {
  if (inward.behind) {
    pieces[0] = whole;
    pieces[0].faces.add({inward.axis[0], inward.distance, true});
    return 1;
  }
  if (inward.plate) {
    pieces[0] = whole;
    pieces[0].growth.count = 0;
    constexpr auto kLess = static_cast<float>(1 - kPlateThickness * kPlateThickness);
    const glm::vec3& q = inward.axis[0];
    const Cholesky l(1 - kLess * q.x * q.x, -kLess * q.y * q.x, 1 - kLess * q.y * q.y, -kLess * q.z * q.x,
                     -kLess * q.z * q.y, 1 - kLess * q.z * q.z);
    reshape(pieces[0], l);
    pieces[0].across = transposed(l, q);
    return 1;
  }
  const bool pairs = isOfPairs(style) && inward.ratio == 0;
  size_t count = 1;
  for (int a = 0; a < inward.count; ++a)
    if (pairs || !inward.hasFace(a)) count *= 2;
  for (size_t n = 0; n < count; ++n) {
    glm::vec3 offset(0.0f);
    GrowthAxes growth = whole.growth;
    float share = 1;
    float m00 = 1, m10 = 0, m11 = 1, m20 = 0, m21 = 0, m22 = 1;
    size_t choice = n;
    for (int a = 0; a < inward.count; ++a) {
      const bool cut = inward.hasFace(a);
      const glm::vec3& q = inward.axis[static_cast<size_t>(a)];
      const BorderPart part = !cut               ? style.parts[choice & 1]
                              : inward.ratio > 0 ? mergedPart(inward)
                              : pairs            ? pairOfGrowing(choice & 1, growthAlong(whole.growth, q))
                                                 : cutOfGrowing(style.cut, growthAlong(whole.growth, q));
      if (pairs || !cut) choice >>= 1;
      resize(growth, whole.shape, q, part, !cut ? 0 : pairs ? 1 : kSkewOfCut);
      offset += part.offset * q;
      share *= part.share;
      const float less = 1 - part.size * part.size;
      m00 -= less * q.x * q.x;
      m10 -= less * q.y * q.x;
      m11 -= less * q.y * q.y;
      m20 -= less * q.z * q.x;
      m21 -= less * q.z * q.y;
      m22 -= less * q.z * q.z;
    }
    SplatPiece& piece = pieces[n];
    piece = whole;
    piece.growth = growth;
    piece.position += inSpace(whole.shape, offset);
    piece.mean += whole.slope.w0 * offset.x + whole.slope.w1 * offset.y + whole.slope.w2 * offset.z;
    piece.weight *= share;
    const Cholesky l(m00, m10, m11, m20, m21, m22);
    reshape(piece, l);
    for (int a = 0; a < inward.count; ++a) {
      if (!inward.hasFace(a)) continue;
      // The face's normal is A⁻ᵀ q, and Lᵀ q in the new frame.
      const glm::vec3& q = inward.axis[static_cast<size_t>(a)];
      const glm::vec3 normal = transposed(l, q);
      const float inverse = 1 / glm::length(normal);
      piece.faces.add({inverse * normal, inverse * (inward.distance + glm::dot(q, offset))});
    }
    for (int a = 0; a < 3; ++a) {
      if ((layers >> a & 1) == 0) continue;
      const glm::vec3& q = inward.axis[static_cast<size_t>(a)];
      const glm::vec3 normal = transposed(l, q);
      const float inverse = 1 / glm::length(normal);
      const float distance = layerDistance(growthAlong(whole.growth, q));
      piece.faces.add({inverse * normal, inverse * (distance + glm::dot(q, offset)), true});
    }
  }
  return count;
}

}  // namespace curvisplat
