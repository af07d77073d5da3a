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
  EXPECT_EQ(closestTo("of", std::vector<std::string>{"on", "off"}), "off");
  EXPECT_EQ(closestTo(std::string(10'000, 'x'), names), "");
}

TEST(Suggestion, OfNamesThatBeginAlikeTheShortest) {
  const std::vector<std::string> names{"mach_number", "mach_number_of_the_frame", "iso", "--frame-rate"};
  EXPECT_EQ(closestTo("mach", names), "mach_number");
  EXPECT_EQ(closestTo("isometric", names), "iso");
  EXPECT_EQ(closestTo("--frame", names), "--frame-rate");
  EXPECT_EQ(closestTo("ma", names), "");
  EXPECT_EQ(didYouMean("mach", names), " (did you mean mach_number?)");
  EXPECT_EQ(didYouMean("density", names), "");
}

}  // namespace
}  // namespace curvisplat
