#include "render/project/border_parts.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace curvisplat {
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

/// A u.
glm::vec3 inSpace(const Shape& s, const glm::vec3& u) {
  return {s.axis0 * u.x, s.axis0 * s.shear10 * u.x + s.axis1 * u.y,
          s.axis0 * s.shear20 * u.x + s.axis1 * s.shear21 * u.y + s.axis2 * u.z};
}

/// The piece whose S is A M Aᵀ: its A is A L, and the slope along its columns Lᵀ w.
void reshape(SplatPiece& piece, const Cholesky& l) {
  const Shape s = piece.shape;
  const Slope w = piece.slope;
  const float a0 = s.axis0 * l.l00, a1 = s.axis1 * l.l11;
  piece.shape = {a0,
                 a1,
                 s.axis2 * l.l22,
                 s.shear10 + s.axis1 * l.l10 / a0,
                 s.shear20 + (s.axis1 * s.shear21 * l.l10 + s.axis2 * l.l20) / a0,
                 s.shear21 + s.axis2 * l.l21 / a1};
  piece.slope = {l.l00 * w.w0 + l.l10 * w.w1 + l.l20 * w.w2, l.l11 * w.w1 + l.l21 * w.w2, l.l22 * w.w2};
}

}  // namespace

size_t partsAtBorder(const SplatPiece& whole, uint32_t border_code, const BorderParts& parts,
                     BorderPieces& pieces) {
  const InwardAxes inward = inwardAxes(border_code);
  const size_t count = size_t{1} << inward.count;
  for (size_t n = 0; n < count; ++n) {
    glm::vec3 offset(0.0f);
    float share = 1;
    float m00 = 1, m10 = 0, m11 = 1, m20 = 0, m21 = 0, m22 = 1;
    for (int a = 0; a < inward.count; ++a) {
      const BorderPart& part = parts[n >> a & 1];
      const glm::vec3& q = inward.axis[a];
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
    piece.position += inSpace(whole.shape, offset);
    piece.mean += whole.slope.w0 * offset.x + whole.slope.w1 * offset.y + whole.slope.w2 * offset.z;
    piece.weight *= share;
    reshape(piece, Cholesky(m00, m10, m11, m20, m21, m22));
  }
  return count;
}

}  // namespace curvisplat
