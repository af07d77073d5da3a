// The window's colours can be read: contrasts by WCAG 2.1, relative luminance and contrast ratio.
#include "tools/window/theme.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace curvisplat {
namespace {

double luminance(const std::array<double, 3>& rgb) {
  const auto linear = [](double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); };
  return 0.2126 * linear(rgb[0]) + 0.7152 * linear(rgb[1]) + 0.0722 * linear(rgb[2]);
}

double contrast(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  const auto [darker, lighter] = std::minmax({luminance(a), luminance(b)});
  return (lighter + 0.05) / (darker + 0.05);
}

TEST(Theme, EveryTextCanBeReadAndTheFocusSeen) {
  EXPECT_NEAR(contrast({1, 1, 1}, {0, 0, 0}), 21, 1e-9);
  for (const bool light : {false, true}) {
    const std::vector<TextOnPaper> texts = textsOf(light);
    EXPECT_GT(texts.size(), 40u);
    for (const TextOnPaper& one : texts)
      EXPECT_GE(contrast(one.text, one.paper), one.least) << (light ? "light: " : "dark: ") << one.name;
  }
}

}  // namespace
}  // namespace curvisplat
