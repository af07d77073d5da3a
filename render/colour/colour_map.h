// Interpolates colours between control points, in the colour spaces of ParaView's colour maps.
//
// What depends only on a pair of neighbouring points is resolved when the map is built: the shorter way round
// the circle of hues, and the white that a diverging map inserts between two saturated colours. After that
// each segment is linear in its space, and a look-up is a search, an interpolation and a conversion to RGB.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace curvisplat {

/// As ParaView names them: RGB; HSV, the shorter way round the circle of hues; HSVNoWrap; Lab, CIE L*a*b*
/// with D65; Diverging, Moreland's Msh (Lab in polar form, with white between distinct hues); Step, where a
/// segment has the colour of its upper end.
enum class ColourSpace { kRgb, kHsv, kHsvNoWrap, kLab, kDiverging, kStep };

struct ColourPoint {
  double x;
  glm::dvec3 rgb;  // 0..1, display values
};

/// Immutable; any thread may ask.
class ColourMap {
 public:
  ColourMap() = default;
  /// `points`: one or more, sorted by x. Points with equal x are a jump; the first of them holds at x itself.
  ColourMap(std::span<const ColourPoint> points, ColourSpace space);

  /// The colour at x, each channel in 0..1. Outside of the points, the colour of the nearest one.
  glm::dvec3 at(double x) const;

 private:
  struct Segment {
    double begin, end;    // begin < end
    glm::dvec3 from, to;  // coordinates of the colour space, at begin and end
  };
  void addSegment(const ColourPoint& from, const ColourPoint& to);

  ColourSpace space_ = ColourSpace::kRgb;
  std::vector<Segment> segments_;
  glm::dvec3 first_{0.0}, last_{0.0};
};

}  // namespace curvisplat
