// Points to probe a grid at, as text. What is read is written and read again as the same.
#include <fmt/format.h>

#include <cmath>
#include <string>

#include "preprocess/probe/point_list.h"
#include "stream/base/error.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzPointList(std::span<const std::byte> bytes) {
  const std::vector<glm::dvec3> points = parsePointList(textOf(bytes), "a.csv");
  CURVISPLAT_CHECK(!points.empty());
  std::string text;
  for (const glm::dvec3& point : points) {
    CURVISPLAT_CHECK(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z));
    text += fmt::format("{},{},{}\n", point.x, point.y, point.z);
  }
  CURVISPLAT_CHECK(parsePointList(text, "again.csv") == points);
}

const RegisteredFuzzTarget point_list_target("point_list", fuzzPointList);

}  // namespace
}  // namespace curvisplat
