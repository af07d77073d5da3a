#include "render/project/splat_cutter.h"

#include <glm/geometric.hpp>

namespace curvisplat {

std::array<SplatPiece, 2> halve(const SplatPiece& piece, int column) {
  const Shape& s = piece.shape;
  const glm::vec3 columns[3] = {s.axis0 * glm::vec3(1, s.shear10, s.shear20),
                                s.axis1 * glm::vec3(0, 1, s.shear21), s.axis2 * glm::vec3(0, 0, 1)};
  const glm::vec3 step = 0.25f * columns[column];
  SplatPiece half = piece;
  half.weight *= 0.5f;
  half.growth.count = 0;
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

}  // namespace curvisplat
