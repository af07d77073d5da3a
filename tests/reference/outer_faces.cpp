#include "tests/reference/outer_faces.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace curvisplat {
namespace {

constexpr uint32_t kFacesOfLeaf = 4;
constexpr double kOutside = 1e-9;  // of a face: how far beyond its edges a line still meets it

/// A line, and points as seen along it: two coordinates across it, one along it.
class Line {
 public:
  Line(const glm::dvec3& origin, const glm::dvec3& direction) : origin_(origin), along_(direction) {
    const glm::dvec3 other = std::abs(direction.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    across_ = glm::normalize(glm::cross(direction, other));
    up_ = glm::cross(direction, across_);
  }

  glm::dvec3 seen(const glm::dvec3& world) const {
    const glm::dvec3 d = world - origin_;
    return {glm::dot(d, across_), glm::dot(d, up_), glm::dot(d, along_)};
  }

  bool meets(const glm::dvec3& lower, const glm::dvec3& upper) const {
    double begin = -std::numeric_limits<double>::infinity(), end = -begin;
    for (int axis = 0; axis < 3; ++axis) {
      if (along_[axis] == 0) {
        if (origin_[axis] < lower[axis] || origin_[axis] > upper[axis]) return false;
        continue;
      }
      const double a = (lower[axis] - origin_[axis]) / along_[axis];
      const double b = (upper[axis] - origin_[axis]) / along_[axis];
      begin = std::max(begin, std::min(a, b));
      end = std::min(end, std::max(a, b));
    }
    return begin <= end;
  }

 private:
  glm::dvec3 origin_, along_, across_, up_;
};

double cross(const glm::dvec3& a, const glm::dvec3& b) {
  return a.x * b.y - a.y * b.x;
}
double dot(const glm::dvec3& a, const glm::dvec3& b) {
  return a.x * b.x + a.y * b.y;
}

bool inUnit(double t) {
  return t >= -kOutside && t <= 1 + kOutside;
}

/// a + u b + v c + uv e = 0 across the line, by the quadratic equation for u.
void meet(const Line& line, const OuterFaces::Face& face, std::vector<double>& distances) {
  glm::dvec3 p[4], least, most;
  for (int n = 0; n < 4; ++n) {
    p[n] = line.seen(face[n]);
    least = n ? glm::min(least, p[n]) : p[n];
    most = n ? glm::max(most, p[n]) : p[n];
  }
  const double margin = 2 * kOutside * ((most.x - least.x) + (most.y - least.y));
  if (least.x > margin || least.y > margin || most.x < -margin || most.y < -margin) return;

  const glm::dvec3 a = p[0], b = p[1] - p[0], c = p[2] - p[0], e = p[3] - p[1] - p[2] + p[0];
  const double square = cross(b, e), linear = cross(a, e) + cross(b, c), constant = cross(a, c);
  const double discriminant = linear * linear - 4 * square * constant;
  if (discriminant < 0) return;
  const double q = -0.5 * (linear + std::copysign(std::sqrt(discriminant), linear));
  const double roots[2] = {q / square, constant / q};
  for (const double u : roots) {
    if (!inUnit(u)) continue;  // also where it is infinite or not a number
    const glm::dvec3 along_v = c + u * e, rest = a + u * b;
    const double v = -dot(rest, along_v) / dot(along_v, along_v);
    if (inUnit(v)) distances.push_back(rest.z + v * along_v.z);
  }
}

}  // namespace

OuterFaces::OuterFaces(std::vector<Face> faces) : faces_(std::move(faces)) {
  if (faces_.empty()) return;
  glm::dvec3 lower = faces_.front()[0], upper = lower;
  for (const Face& face : faces_)
    for (const glm::dvec3& p : face) {
      lower = glm::min(lower, p);
      upper = glm::max(upper, p);
    }
  build(0, static_cast<uint32_t>(faces_.size()), 1e-9 * glm::length(upper - lower));
}

void OuterFaces::build(uint32_t begin, uint32_t end, double margin) {
  const size_t self = boxes_.size();
  boxes_.push_back({});
  Box box;
  box.lower = box.upper = faces_[begin][0];
  for (uint32_t n = begin; n < end; ++n)
    for (const glm::dvec3& p : faces_[n]) {
      box.lower = glm::min(box.lower, p);
      box.upper = glm::max(box.upper, p);
    }
  if (end - begin <= kFacesOfLeaf) {
    box.begin = begin;
    box.end = end;
  } else {
    const glm::dvec3 size = box.upper - box.lower;
    const int axis = size.x >= std::max(size.y, size.z) ? 0 : size.y >= size.z ? 1 : 2;
    const uint32_t middle = begin + (end - begin) / 2;
    const auto position = [axis](const Face& face) {
      return face[0][axis] + face[1][axis] + face[2][axis] + face[3][axis];
    };
    std::nth_element(faces_.begin() + begin, faces_.begin() + middle, faces_.begin() + end,
                     [&](const Face& a, const Face& b) { return position(a) < position(b); });
    build(begin, middle, margin);
    build(middle, end, margin);
  }
  box.lower -= margin;
  box.upper += margin;
  box.skip = static_cast<uint32_t>(boxes_.size());
  boxes_[self] = box;
}

void OuterFaces::crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                           std::vector<double>& distances) const {
  const Line line(origin, direction);
  for (uint32_t n = 0; n < boxes_.size();) {
    const Box& box = boxes_[n];
    if (!line.meets(box.lower, box.upper)) {
      n = box.skip;
      continue;
    }
    ++n;
    for (uint32_t face = box.begin; face < box.end; ++face) meet(line, faces_[face], distances);
  }
}

}  // namespace curvisplat
