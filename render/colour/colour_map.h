// Colours between control points, in the colour spaces that ParaView's colour maps are written in.
//
// Whatever depends on a pair of points alone (the shorter way round the hue circle, the white that a
// diverging map puts between two saturated colours) is settled when the map is built: afterwards each segment
// is linear in its space, and a look-up is a search, an interpolation and a conversion to RGB.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace curvisplat {

/// ParaView's names: RGB, HSV (the shorter way round the circle of hues), HSVNoWrap, Lab (CIE L*a*b*, D65),
/// Diverging (Moreland's Msh: Lab in polar form, white between distinct hues), Step (a segment has the colour
/// of its upper end).
enum class ColourSpace { kRgb, kHsv, kHsvNoWrap, kLab, kDiverging, kStep };

struct ColourPoint {
  double x;
  glm::dvec3 rgb;  // 0..1, display values
};

/// Immutable; any thread may ask.
class ColourMap {
 public:
  ColourMap() = default;
  /// `points`: at least one, in the order of x. Points of equal x are a jump; the first holds at x itself.
  ColourMap(std::span<const ColourPoint> points, ColourSpace space);

  /// Below and above the points their ends' colours. Each channel in 0..1.
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
