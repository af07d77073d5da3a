// Interpolates between control points: colours in the colour spaces of ParaView's colour maps, and opacities
// as VTK's vtkPiecewiseFunction does. A transfer function is made of one of each.
//
// Both take one or more points, sorted by x. Points with equal x are a jump, at which the first of them
// holds; outside of the points, the nearest one holds. A look-up is a binary search and an interpolation,
// for colours a conversion to RGB as well. Immutable; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <span>
#include <vector>

namespace curvisplat {

/// Colour spaces as ParaView names them: RGB; HSV, the shorter way round the circle of hues; HSVNoWrap; Lab,
/// CIE L*a*b* with D65; Diverging, Moreland's Msh (Lab in polar form, with white between distinct hues);
/// Step, where a segment has the colour of its upper end.
enum class ColourSpace { kRgb, kHsv, kHsvNoWrap, kLab, kDiverging, kStep };

/// A control point of a colour map.
struct ColourPoint {
  double x;
  glm::dvec3 rgb;  // 0..1, display values
};

/// A map of colours. What depends only on a pair of neighbouring points is resolved when the map is built:
/// the shorter way round the circle of hues, and the white that a diverging map inserts between two saturated
/// colours. After that each segment is linear in its space.
class ColourMap {
 public:
  ColourMap() = default;
  ColourMap(std::span<const ColourPoint> points, ColourSpace space);

  /// The colour at x, each channel in 0..1.
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

/// Midpoint and sharpness of a point shape the curve up to the next point. At the midpoint, a fraction of
/// the way, the curve has the mean of the two opacities. Sharpness 0 gives two straight lines, 1 a step at
/// the midpoint, and values between them a Hermite curve over a compressed parameter.
struct OpacityPoint {
  double x;
  double opacity;          // 0..1
  double midpoint = 0.5;   // 0..1, between this point and the next
  double sharpness = 0.0;  // 0..1
};

/// Opacities between control points, as VTK's piecewise function.
class OpacityCurve {
 public:
  OpacityCurve() = default;
  explicit OpacityCurve(std::span<const OpacityPoint> points);

  /// The opacity at x, 0..1.
  double at(double x) const;

 private:
  std::vector<OpacityPoint> points_;
};

}  // namespace curvisplat
