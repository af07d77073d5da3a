#include "preprocess/probe/point_list.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

std::optional<glm::dvec3> pointOf(const std::string& line) {
  glm::dvec3 point(0.0);
  const char* at = line.c_str();
  for (int axis = 0; axis < 3; ++axis) {
    at += std::strspn(at, " \t,;");
    char* end = nullptr;
    point[axis] = std::strtod(at, &end);
    if (end == at || !std::isfinite(point[axis])) return std::nullopt;
    at = end;
  }
  return point;
}

}  // namespace

std::vector<glm::dvec3> parsePointList(std::string_view text, const std::string& name) {
  std::vector<glm::dvec3> points;
  for (size_t number = 1, begin = 0; begin < text.size(); ++number) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line(text.substr(begin, end - begin));
    begin = end + 1;
    if (line.find_first_not_of(" \t\r,;") == std::string::npos) continue;
    if (const auto point = pointOf(line))
      points.push_back(*point);
    else if (number > 1)
      throw Error("{}: line {} does not begin with three numbers x,y,z", name, number);
  }
  if (points.empty()) throw Error("{}: has no points; expected lines of x,y,z", name);
  return points;
}

}  // namespace curvisplat
