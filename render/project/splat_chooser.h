// Decides for each projected splat whether it can be seen. A part of projection.cpp: everything is inline, in the
// loop over a brick's splats.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/kernel.h"
#include "render/project/light.h"
#include "render/project/painter.h"
#include "render/project/screen_splat.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// Decides for each projected splat whether it can be seen, and keeps those that can.
class SplatChooser {
 public:
  enum class Fate { kOffScreen, kTransparent, kKept };

  /// The vectors get what is kept. `reach`: largestReach().
  struct Kept {
    std::vector<ScreenSplat>& splats;
    std::vector<float>& depths;
  };
  SplatChooser(const ScreenView& view, double reach, PixelShading shading, const ClassificationTable& table,
               const Kept& kept)
      : table_(table),
        width_(static_cast<float>(view.size.width)),
        height_(static_cast<float>(view.size.height)),
        reach_(1.001f * static_cast<float>(reach)),
        largest_scalar_(kLargestCells /
                        std::max(table.logScale() ? 1.0f : std::abs(table.scale()), kMinScale)),
        per_pixel_(shading.per_pixel),
        lit_(shading.lit),
        splats_(kept.splats),
        depths_(kept.depths) {}

  /// Inline: handed over through memory, a splat that has just been put together stalls on its way into the
  /// vector, which takes as long as all the rest. `widening`: how much farther than half_width a mean can be.
  [[gnu::always_inline]] Fate choose(ScreenSplat splat, float depth, const Lit& lit, float widening = 1) {
    const float reach_x = kSupport * splat.l11;
    const float reach_y = kSupport * (std::abs(splat.l21) + splat.l22);
    const bool on_screen = splat.x + reach_x > 0 && splat.x - reach_x < width_ && splat.y + reach_y > 0 &&
                           splat.y - reach_y < height_;
    if (!on_screen) return Fate::kOffScreen;
    if (!per_pixel_) splat.slope0 = splat.slope1 = splat.half_width = 0;
    float spread = kSupport * (std::abs(splat.slope0) + std::abs(splat.slope1)) + widening * splat.half_width;
    if (!(std::abs(splat.mean) + spread <= largest_scalar_)) {
      splat.slope0 = splat.slope1 = splat.half_width = spread = 0;
      splat.mean = std::clamp(splat.mean, -largest_scalar_, largest_scalar_);
    }
    splat.amplitude = std::min(splat.amplitude, kLargestAmplitude);
    if (!(splat.amplitude > 0) || table_.fullyTransparent(splat.mean - spread, splat.mean + spread))
      return Fate::kTransparent;
    if (lit_) splat.half_width = packLit(splat.half_width, lit);
    splats_.push_back(splat);
    depths_.push_back(depth);
    return Fate::kKept;
  }

  /// What a splat has besides itself; null: none.
  struct Records {
    const ScreenCut* cut = nullptr;
    const ScreenDepth* along_ray = nullptr;
    const ScreenColour* colour = nullptr;
  };
  /// Of a splat with records, which come first.
  Fate chooseWith(const Records& records, const ScreenSplat& splat, float depth, const Lit& lit) {
    const size_t before = splats_.size();
    const bool is_cut = records.cut || records.along_ray;
    // A truncated distribution's mean moves by up to kReach deviations; half_width is √3.
    const Fate fate =
        choose(splat, depth, lit, is_cut ? ScreenCut::kReach / std::numbers::sqrt3_v<float> : 1.0f);
    if (splats_.size() == before) return fate;
    ScreenSplat kept = splats_.back();
    if (is_cut) kept.amplitude = -kept.amplitude;
    splats_.pop_back();
    if (records.cut) splats_.push_back(records.cut->record());
    if (records.along_ray) splats_.push_back(records.along_ray->record());
    if (records.colour) splats_.push_back(inBounds(*records.colour).record());
    splats_.push_back(kept);
    depths_.resize(splats_.size(), depth);
    return fate;
  }

  /// Whether every piece of a splat is transparent, wherever the piece lies. `slope` is the slope as drawn.
  bool transparentThroughout(float mean, float slope, float variance) const {
    const float spread = reach_ * slope + ScreenCut::kReach * std::sqrt(slope * slope + variance);
    return table_.fullyTransparent(mean - spread, mean + spread);
  }

 private:
  /// As splats themselves are kept finite.
  ScreenColour inBounds(ScreenColour colour) const {
    const float spread =
        kSupport * (std::abs(colour.slope[0]) + std::abs(colour.slope[1])) + colour.half_width;
    if (!(std::abs(colour.mean) + spread <= kLargestColour)) {
      colour.slope = {};
      colour.half_width = 0;
      colour.mean = std::clamp(colour.mean, -kLargestColour, kLargestColour);
    }
    return colour;
  }

  static constexpr auto kSupport = static_cast<float>(kKernelSupport);
  // Painters compute places in the table and depths in float. Beyond these limits that gives infinities, whose
  // difference is NaN. A splat beyond them is drawn flat, with a scalar far outside of the table.
  static constexpr float kLargestCells = 1e30f, kMinScale = 1e-7f, kLargestAmplitude = 1e30f,
                         kLargestColour = 1e22f;

  const ClassificationTable& table_;
  const float width_, height_;
  const float reach_;
  const float largest_scalar_;
  const bool per_pixel_, lit_;
  std::vector<ScreenSplat>& splats_;
  std::vector<float>& depths_;
};

}  // namespace curvisplat
