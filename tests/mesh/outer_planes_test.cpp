#include "preprocess/gather/outer_planes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/trigonometric.hpp>

#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPoint = 3;

/// How many of the faces at a point splats end at.
size_t keptOf(const std::vector<OuterPlane>& faces) {
  const TemporaryFolder folder;
  OuterPlanes planes(1, 8, 1 << 20, folder.path());
  uint64_t face = 0;
  for (const OuterPlane& plane : faces) planes.add(kPoint, plane, face++);
  planes.close();
  planes.leaveOutClosed(Progress());
  std::vector<OuterPlane> scratch;
  return planes.load(0).of(kPoint, scratch).size();
}

/// The unit squares on both sides of a wedge, at a point of its edge.
std::vector<OuterPlane> wedge(double degrees) {
  const double sine = std::sin(glm::radians(degrees)), cosine = std::cos(glm::radians(degrees));
  return {{0.25 * glm::dvec3(0, 0, 1), {0.5, 0.5, 0}},
          {0.25 * glm::dvec3(sine, 0, -cosine), {0.5 * cosine, 0.5, 0.5 * sine}}};
}

TEST(OuterPlanes, OfASharpEdgeAreKept) {
  for (const double degrees : {90.0, 25.0, 15.0, 8.0}) EXPECT_EQ(keptOf(wedge(degrees)), 2u) << degrees;
}

TEST(OuterPlanes, AgainstEachOtherAreLeftOut) {
  // A unit square, one of four that lie against it, and a face at right angles.
  const OuterPlane coarse{0.25 * glm::dvec3(0, 0, 1), {0.5, 0.5, 0}};
  const OuterPlane fine{0.0625 * glm::dvec3(0, 0, -1), {0.25, 0.25, 0}};
  const OuterPlane across{0.25 * glm::dvec3(1, 0, 0), {0, 0.5, 0.5}};
  EXPECT_EQ(keptOf({coarse, fine, across}), 1u);
  OuterPlane beside = fine;
  beside.touches = false;
  EXPECT_EQ(keptOf({coarse, beside}), 2u);
}

TEST(OuterPlanes, WhereVeryManyMeetAreLeftOut) {
  // All pairs of these would be 2 x 10^10.
  EXPECT_EQ(keptOf(std::vector<OuterPlane>(200'000, wedge(90)[0])), 0u);
}

TEST(OuterPlanes, AreNotComparedAfterAStop) {
  const TemporaryFolder folder;
  OuterPlanes planes(1, 8, 1 << 20, folder.path());
  planes.add(kPoint, wedge(90)[0]);
  planes.close();
  Progress progress;
  progress.stop(2);
  EXPECT_THROW(planes.leaveOutClosed(progress), Interrupted);
}

}  // namespace
}  // namespace curvisplat
