// The name that a misspelled one is taken for.
#include "stream/base/suggestion.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace curvisplat {
namespace {

TEST(Suggestion, IsTheClosestNameOrNone) {
  const std::vector<std::string> names{"--size", "--scale", "--scalar", "--opacity-unit"};
  EXPECT_EQ(closestTo("--sise", names), "--size");
  EXPECT_EQ(closestTo("--SIZE", names), "--size");
  EXPECT_EQ(closestTo("--isze", names), "--size");  // swapped letters
  EXPECT_EQ(closestTo("--sclar", names), "--scalar");
  EXPECT_EQ(closestTo("--opacityunit", names), "--opacity-unit");
  EXPECT_EQ(closestTo("--background", names), "");
  EXPECT_EQ(closestTo("", names), "");
  EXPECT_EQ(closestTo(std::string(10'000, 'x'), names), "");
}

}  // namespace
}  // namespace curvisplat
