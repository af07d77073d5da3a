// Positions from longitude, latitude and height, and back.
#include "stream/model/globe.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

TEST(Globe, PlacesAreFoundAgain) {
  for (const auto shape : {Globe::Shape::kSphere, Globe::Shape::kFlat, Globe::Shape::kLengths})
    for (const double longitude : {-179.0, -30.5, 0.0, 100.0})
      for (const double latitude : {-89.0, 0.0, 52.25})
        for (const double height : {-5.5, 0.0, 12.0}) {
          const Globe globe{shape, 6371, 50, 0};
          const glm::dvec3 place(longitude, latitude, height), at = globe.placeAt(place);
          EXPECT_NEAR(glm::distance(globe.geographic(at), place), 0, 1e-9);
        }
}

TEST(Globe, AFlatMapStaysInOnePieceAroundItsMiddle) {
  const Globe globe{Globe::Shape::kFlat, 6371, 1, 170};
  EXPECT_NEAR(globe.geographic(globe.placeAt({-175, 0, 0})).x, 185, 1e-9);
}

TEST(Globe, HeightsAreAlongTheNormal) {
  const Globe globe{Globe::Shape::kSphere, 1000, 2, 0};
  EXPECT_NEAR(glm::distance(globe.placeAt({90, 0, 3}), glm::dvec3(0, 1006, 0)), 0, 1e-9);
  EXPECT_NEAR(glm::distance(globe.placeAt({0, 90, -3}), glm::dvec3(0, 0, 994)), 0, 1e-9);
}

}  // namespace
}  // namespace curvisplat
