#include "render/colour/control_points.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

using std::numbers::pi;

// Hue, saturation and value, each in 0..1.
glm::dvec3 hsvFromRgb(const glm::dvec3& rgb) {
  const double value = std::max({rgb.r, rgb.g, rgb.b});
  const double chroma = value - std::min({rgb.r, rgb.g, rgb.b});
  if (!(chroma > 0)) return {0, 0, value};
  double sextant;
  if (rgb.r == value)
    sextant = (rgb.g - rgb.b) / chroma;
  else if (rgb.g == value)
    sextant = 2 + (rgb.b - rgb.r) / chroma;
  else
    sextant = 4 + (rgb.r - rgb.g) / chroma;
  return {(sextant < 0 ? sextant + 6 : sextant) / 6, chroma / value, value};
}

glm::dvec3 rgbFromHsv(const glm::dvec3& hsv) {
  const double sextant = 6 * (hsv.x < 0 ? hsv.x + 1 : hsv.x);
  const glm::dvec3 hue(std::abs(sextant - 3) - 1, 2 - std::abs(sextant - 2), 2 - std::abs(sextant - 4));
  return hsv.z * glm::mix(glm::dvec3(1), glm::clamp(hue, 0.0, 1.0), hsv.y);
}

// sRGB (IEC 61966-2-1), and CIE L*a*b* with its white point, D65. The constants are rounded as VTK's are.
constexpr glm::dvec3 kWhiteXyz{0.9505, 1.0, 1.089};

glm::dvec3 labFromRgb(const glm::dvec3& rgb) {
  glm::dvec3 linear;
  for (int c = 0; c < 3; ++c)
    linear[c] = rgb[c] > 0.04045 ? std::pow((rgb[c] + 0.055) / 1.055, 2.4) : rgb[c] / 12.92;
  const glm::dmat3 xyz_from_linear(0.4124, 0.2126, 0.0193, 0.3576, 0.7152, 0.1192, 0.1805, 0.0722, 0.9505);
  glm::dvec3 f = xyz_from_linear * linear / kWhiteXyz;
  for (int c = 0; c < 3; ++c) f[c] = f[c] > 0.008856 ? std::cbrt(f[c]) : 7.787 * f[c] + 16.0 / 116.0;
  return {116 * f.y - 16, 500 * (f.x - f.y), 200 * (f.y - f.z)};
}

glm::dvec3 rgbFromLab(const glm::dvec3& lab) {
  const double fy = (lab.x + 16) / 116;
  glm::dvec3 xyz(fy + lab.y / 500, fy, fy - lab.z / 200);
  for (int c = 0; c < 3; ++c) {
    const double cube = xyz[c] * xyz[c] * xyz[c];
    xyz[c] = kWhiteXyz[c] * (cube > 0.008856 ? cube : (xyz[c] - 16.0 / 116.0) / 7.787);
  }
  const glm::dmat3 linear_from_xyz(3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415,
                                   1.0570);
  glm::dvec3 rgb = linear_from_xyz * xyz;
  for (int c = 0; c < 3; ++c)
    rgb[c] = rgb[c] > 0.0031308 ? 1.055 * std::pow(rgb[c], 1 / 2.4) - 0.055 : 12.92 * rgb[c];
  // Colours outside of the display's gamut are dimmed rather than clipped, which keeps their hue.
  const double largest = std::max({rgb.r, rgb.g, rgb.b, 1.0});
  return glm::max(rgb / largest, 0.0);
}

// Magnitude, saturation angle and hue angle: Moreland, "Diverging Color Maps for Scientific Visualization",
// 2009.
struct Msh {
  double magnitude, saturation, hue;

  static Msh fromRgb(const glm::dvec3& rgb) {
    const glm::dvec3 lab = labFromRgb(rgb);
    const double magnitude = glm::length(lab);
    const double saturation = magnitude > 0.001 ? std::acos(lab.x / magnitude) : 0;
    return {magnitude, saturation, saturation > 0.001 ? std::atan2(lab.z, lab.y) : 0};
  }
  bool saturated() const { return saturation > 0.05; }
  glm::dvec3 coordinates() const { return {magnitude, saturation, hue}; }
};

glm::dvec3 rgbFromMsh(const glm::dvec3& msh) {
  const double chroma = msh.x * std::sin(msh.y);
  return rgbFromLab({msh.x * std::cos(msh.y), chroma * std::cos(msh.z), chroma * std::sin(msh.z)});
}

double angleBetween(double a, double b) {
  const double difference = std::fmod(std::abs(a - b), 2 * pi);
  return difference > pi ? 2 * pi - difference : difference;
}

// Moreland's AdjustHue: the hue of an unsaturated colour, which has none of its own, at the end of a segment
// that begins at `saturated`. The hue is rotated so that the perceived rate of change is even.
double hueTowards(const Msh& saturated, double unsaturated_magnitude) {
  if (saturated.magnitude >= unsaturated_magnitude - 0.1) return saturated.hue;
  const double spin =
      saturated.saturation *
      std::sqrt(unsaturated_magnitude * unsaturated_magnitude - saturated.magnitude * saturated.magnitude) /
      (saturated.magnitude * std::sin(saturated.saturation));
  return saturated.hue > -0.3 * pi ? saturated.hue + spin : saturated.hue - spin;
}

}  // namespace

ColourMap::ColourMap(std::span<const ColourPoint> points, ColourSpace space) : space_(space) {
  CURVISPLAT_CHECK(!points.empty());
  first_ = points.front().rgb;
  last_ = points.back().rgb;
  for (size_t n = 1; n < points.size(); ++n)
    if (points[n - 1].x < points[n].x) addSegment(points[n - 1], points[n]);
}

void ColourMap::addSegment(const ColourPoint& from, const ColourPoint& to) {
  switch (space_) {
    case ColourSpace::kRgb:
      segments_.push_back({from.x, to.x, from.rgb, to.rgb});
      return;
    case ColourSpace::kStep:
      segments_.push_back({from.x, to.x, to.rgb, to.rgb});
      return;
    case ColourSpace::kLab:
      segments_.push_back({from.x, to.x, labFromRgb(from.rgb), labFromRgb(to.rgb)});
      return;
    case ColourSpace::kHsv:
    case ColourSpace::kHsvNoWrap: {
      glm::dvec3 a = hsvFromRgb(from.rgb), b = hsvFromRgb(to.rgb);
      if (space_ == ColourSpace::kHsv && std::abs(a.x - b.x) > 0.5) (a.x > b.x ? a : b).x -= 1;
      segments_.push_back({from.x, to.x, a, b});
      return;
    }
    case ColourSpace::kDiverging: {
      const auto add = [&](double begin, double end, Msh a, Msh b) {
        if (!a.saturated() && b.saturated()) a.hue = hueTowards(b, a.magnitude);
        if (!b.saturated() && a.saturated()) b.hue = hueTowards(a, b.magnitude);
        segments_.push_back({begin, end, a.coordinates(), b.coordinates()});
      };
      const Msh a = Msh::fromRgb(from.rgb), b = Msh::fromRgb(to.rgb);
      if (a.saturated() && b.saturated() && angleBetween(a.hue, b.hue) > 0.33 * pi) {
        const Msh white{std::max({a.magnitude, b.magnitude, 88.0}), 0, 0};
        const double middle = 0.5 * (from.x + to.x);
        add(from.x, middle, a, white);
        add(middle, to.x, white, b);
      } else {
        add(from.x, to.x, a, b);
      }
      return;
    }
  }
}

glm::dvec3 ColourMap::at(double x) const {
  if (segments_.empty() || !(x > segments_.front().begin)) return first_;
  if (x > segments_.back().end) return last_;
  const auto segment = std::lower_bound(segments_.begin(), segments_.end(), x,
                                        [](const Segment& s, double value) { return s.end < value; });
  const double part = (x - segment->begin) / (segment->end - segment->begin);
  const glm::dvec3 colour = glm::mix(segment->from, segment->to, part);
  glm::dvec3 rgb = colour;
  if (space_ == ColourSpace::kHsv || space_ == ColourSpace::kHsvNoWrap) rgb = rgbFromHsv(colour);
  if (space_ == ColourSpace::kLab) rgb = rgbFromLab(colour);
  if (space_ == ColourSpace::kDiverging) rgb = rgbFromMsh(colour);
  return glm::clamp(rgb, 0.0, 1.0);
}

namespace {

// The curve from the lower opacity (0) to the upper one (1), at the fraction `part` of the way in x.
double progress(double part, double midpoint, double sharpness) {
  midpoint = std::clamp(midpoint, 1e-5, 1 - 1e-5);
  double s = part < midpoint ? 0.5 * part / midpoint : 0.5 + 0.5 * (part - midpoint) / (1 - midpoint);
  // VTK's thresholds, beyond which the curve is a step or straight.
  if (sharpness > 0.99) return s < 0.5 ? 0 : 1;
  if (sharpness < 0.01) return s;
  const double power = 1 + 10 * sharpness;
  s = s < 0.5 ? 0.5 * std::pow(2 * s, power) : 1 - 0.5 * std::pow(2 * (1 - s), power);
  // A Hermite curve from 0 to 1 with the slope 1 - sharpness at both ends.
  const double rise = s * s * (3 - 2 * s);
  const double slopes = s * (1 - s) * (1 - 2 * s);
  return std::clamp(rise + slopes * (1 - sharpness), 0.0, 1.0);
}

}  // namespace

OpacityCurve::OpacityCurve(std::span<const OpacityPoint> points) : points_(points.begin(), points.end()) {
  CURVISPLAT_CHECK(!points_.empty());
}

double OpacityCurve::at(double x) const {
  const auto upper = std::lower_bound(points_.begin(), points_.end(), x,
                                      [](const OpacityPoint& p, double value) { return p.x < value; });
  if (upper == points_.begin()) return points_.front().opacity;
  if (upper == points_.end()) return points_.back().opacity;
  const OpacityPoint& lower = *(upper - 1);
  const double part = (x - lower.x) / (upper->x - lower.x);
  return std::lerp(lower.opacity, upper->opacity, progress(part, lower.midpoint, lower.sharpness));
}

}  // namespace curvisplat
