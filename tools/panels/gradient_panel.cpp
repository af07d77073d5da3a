#include "tools/panels/gradient_panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <chrono>

#include "stream/base/error.h"
#include "tools/panels/function_painting.h"
#include "tools/panels/labels.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

constexpr size_t kGradientBins = 64;
constexpr float kHeight = 5;  // in lines of text

/// Opacities that are 0 up to a share of the volume that is less steep, and 1 from another on.
std::vector<OpacityPoint> rampBetween(double from, double to) {
  return {{0, 0}, {from, 0}, {to, 1}, {1, 1}};
}

}  // namespace

std::string GradientPanel::updateMagnitudes(const MagnitudesOf& of) {
  std::string failure;
  if (pending_.valid()) {
    if (pending_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return failure;
    try {
      magnitudes_ = pending_.get();
    } catch (const Error& error) {
      failure = error.what();
    }
  }
  if (magnitudes_of_ == of) return failure;
  magnitudes_of_ = of;
  magnitudes_.reset();
  pending_ = std::async(std::launch::async, [&cache = cache_, of] {
    const GradientPercentiles percentiles(cache, of.variable, of.scale);
    return std::make_unique<const Magnitudes>(
        Magnitudes{percentiles, GradientHistogram(percentiles, kGradientBins)});
  });
  return failure;
}

void GradientPanel::drawHistogram(const std::vector<OpacityPoint>& points, size_t variable) const {
  const CurveCanvas canvas{ImGui::GetCursorScreenPos(),
                           {availableWidth(), kHeight * ImGui::GetTextLineHeight()}};
  ImGui::InvisibleButton("##gradient histogram", canvas.size);
  const bool is_empty = !magnitudes_ || magnitudes_->histogram.shares().empty();
  nameWithoutTab(is_empty ? "empty gradient histogram" : "gradient histogram");
  paintHistogram(is_empty ? std::vector<double>{} : magnitudes_->histogram.shares(), canvas);
  if (is_empty) return;
  const GradientHistogram& histogram = magnitudes_->histogram;
  const GradientOpacity opacity(points, magnitudes_->percentiles);
  const auto factorAt = [&](double x) { return opacity.of(static_cast<float>(histogram.magnitudeAt(x))); };
  paintLine(canvas, factorAt);
  if (!ImGui::IsItemHovered()) return;
  const double x = canvas.xOf(ImGui::GetIO().MousePos), magnitude = histogram.magnitudeAt(x);
  const std::string text = fmt::format(
      "{}: {:.1f} % of the volume is less steep; opacity x {:.2f}",
      gradientText(magnitude, cache_.manifest().variables[variable], cache_.manifest().globe.has_value()),
      100 * magnitudes_->percentiles.shareBelow(magnitude), factorAt(x));
  ImGui::SetTooltip("%s", text.c_str());
  nameArea("gradient of " + text, 0, 0, 1, 1);
}

GradientPanel::Result GradientPanel::draw(std::vector<OpacityPoint>& points, size_t variable,
                                          const glm::dvec3& scale) {
  Result result;
  bool on = !points.empty();
  result.changed = ImGui::Checkbox("opacity by gradient", &on);
  nameWidget("gradient opacity");
  hint(
      "Hides where the scalar hardly changes. Boundary layers stay, which are steepest:\n"
      "for a shock alone choose the magnitude of a gradient at \"opacity by\".");
  if (result.changed && on) points = rampBetween(0.5, 0.8);
  if (!on) points.clear();
  if (points.empty()) return result;
  result.error = updateMagnitudes({variable, scale});
  drawHistogram(points, variable);
  float from = 0, to = 1;  // then in per cent
  for (const OpacityPoint& point : points)
    if (point.opacity <= points.front().opacity) from = static_cast<float>(point.x);
  for (size_t n = points.size(); n-- > 0;)
    if (points[n].opacity >= points.back().opacity) to = static_cast<float>(points[n].x);
  label("flattest part");
  from *= 100, to *= 100;
  if (dragEnds("##gradient", from, to, {0.3f, 0, 100, "hidden: %.0f %%", "faint: to %.0f %%"})) {
    const auto share = [](float percent) { return std::clamp(static_cast<double>(percent) / 100, 0.0, 1.0); };
    points = rampBetween(share(from), share(std::max(from, to)));
    result.changed = true;
  }
  result.dragging = isDragged();
  nameWidget("gradient shares");
  hint(
      "Shares of the volume, beginning where the scalar changes least: up to the first it is hidden,\n"
      "up to the second fainter, and beyond as opaque as the curve above says.\n"
      "Drag to change, Ctrl + click to type a number.");
  return result;
}

}  // namespace curvisplat
