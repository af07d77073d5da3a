#include "tools/panels/function_painting.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "render/colour/transfer_function.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

constexpr float kPointRadius = 0.38f;  // in lines of text
constexpr ImU32 kMark = IM_COL32(235, 140, 30, 255);
constexpr double kHeights[] = {0.05, 0.25, 0.5, 1};  // opacities at the left of the curve

ImU32 imGuiColour(const glm::dvec3& rgb) {
  return ImGui::ColorConvertFloat4ToU32(
      {static_cast<float>(rgb.x), static_cast<float>(rgb.y), static_cast<float>(rgb.z), 1});
}

/// The colours of a plot: on white paper in the light theme.
struct PlotColours {
  ImU32 paper, bars, line, grid, edge;  // `edge`: around points
};

PlotColours plotColours() {
  const bool is_light = ImGui::GetStyleColorVec4(ImGuiCol_Text).x < 0.5f;
  if (is_light)
    return {IM_COL32(255, 255, 255, 255), IM_COL32(176, 184, 198, 255), IM_COL32(25, 25, 28, 255),
            IM_COL32(0, 0, 0, 30), IM_COL32(25, 25, 28, 255)};
  return {IM_COL32(30, 30, 34, 255), IM_COL32(96, 104, 120, 255), IM_COL32(250, 250, 250, 255),
          IM_COL32(255, 255, 255, 28), IM_COL32(255, 255, 255, 255)};
}

}  // namespace

float heightOf(double opacity) {
  return static_cast<float>(std::sqrt(opacity));
}
double opacityAt(float height) {
  return static_cast<double>(height) * static_cast<double>(height);
}

void paintHistogram(const std::vector<double>& histogram, const CurveCanvas& canvas) {
  ImDrawList* const list = ImGui::GetWindowDrawList();
  const ImVec2 end(canvas.lower.x + canvas.size.x, canvas.lower.y + canvas.size.y);
  const PlotColours colours = plotColours();
  list->AddRectFilled(canvas.lower, end, colours.paper);
  const double most = histogram.empty() ? 0 : *std::max_element(histogram.begin(), histogram.end());
  for (size_t n = 0; most > 0 && n < histogram.size(); ++n) {
    const double part = std::clamp(1 + std::log10(std::max(histogram[n] / most, 1e-9)) / 4, 0.0, 1.0);
    const double x = static_cast<double>(n) / static_cast<double>(histogram.size());
    list->AddRectFilled(canvas.at(x, static_cast<float>(part)),
                        canvas.at(x + 1.0 / static_cast<double>(histogram.size()), 0), colours.bars);
  }
}

void paintLine(const CurveCanvas& canvas, const std::function<float(double)>& height) {
  const ImU32 colour = plotColours().line;
  ImVec2 before = canvas.at(0, height(0));
  for (float x = 1; x <= canvas.size.x; ++x) {
    const double part = x / canvas.size.x;
    const ImVec2 now = canvas.at(part, height(part));
    ImGui::GetWindowDrawList()->AddLine(before, now, colour, 0.11f * ImGui::GetFontSize());
    before = now;
  }
}

void paintCurve(const EditedFunction& function, const std::vector<double>& histogram,
                std::span<const double> marked, const CurveCanvas& canvas, bool has_colours) {
  paintHistogram(histogram, canvas);
  const OpacityCurve curve(function.points());
  paintLine(canvas, [&](double x) { return heightOf(curve.at(x)); });
  ImDrawList* const list = ImGui::GetWindowDrawList();
  const float unit = ImGui::GetFontSize();
  const auto [low, high] = function.range();
  for (const double scalar : marked) {
    if (scalar < low || scalar > high) continue;
    const double part = function.coordinateOf(scalar);
    const ImVec2 foot = canvas.at(part, 0), head = canvas.at(part, 1);
    list->AddLine(foot, head, kMark, 0.11f * unit);
    nameArea(fmt::format("mark at {:.4g}", scalar), static_cast<double>(head.x), static_cast<double>(head.y),
             1, static_cast<double>(foot.y - head.y));
  }
  for (const OpacityPoint& point : function.points()) {
    const ImVec2 at = canvas.at(point.x, heightOf(point.opacity));
    list->AddCircleFilled(at, kPointRadius * unit,
                          has_colours ? imGuiColour(function.colourAt(point.x)) : plotColours().bars);
    list->AddCircle(at, kPointRadius * unit, plotColours().edge, 0, 0.08f * unit);
  }
}

void paintStrip(const ImVec2& lower, const ImVec2& size, const std::function<glm::dvec3(double)>& at) {
  ImDrawList* const list = ImGui::GetWindowDrawList();
  for (float x = 0; x < size.x; x += 2)
    list->AddRectFilled({lower.x + x, lower.y},
                        {std::min(lower.x + x + 2, lower.x + size.x), lower.y + size.y},
                        imGuiColour(at(static_cast<double>(x / size.x))));
}

float availableWidth() {
  return ImGui::GetContentRegionAvail().x - kPointRadius * ImGui::GetFontSize();
}

void paintColours(const EditedFunction& function) {
  const ImVec2 size(availableWidth(), ImGui::GetTextLineHeight());
  paintStrip(ImGui::GetCursorScreenPos(), size, [&](double x) { return function.colourAt(x); });
  ImGui::Dummy(size);
}

void paintNumbers(const EditedFunction& function) {
  const ImVec2 lower = ImGui::GetCursorScreenPos();
  const float width = availableWidth();
  constexpr int kIntervals = 4;
  const auto scalar = [&](int n) { return function.scalarAt(static_cast<double>(n) / kIntervals); };
  // The numbers have as many digits as tell neighbours apart: 0.999, 1.001 and not 0.999, 1.
  double closest = std::abs(scalar(1) - scalar(0)), largest = 0;
  for (int n = 0; n <= kIntervals; ++n) {
    largest = std::max(largest, std::abs(scalar(n)));
    if (n > 0) closest = std::min(closest, std::abs(scalar(n) - scalar(n - 1)));
  }
  const double ratio = closest > 0 ? std::min(largest / closest, 1e6) : 1;
  const int digits = std::clamp(static_cast<int>(std::ceil(std::log10(ratio))) + 1, 3, 5);
  const auto textOf = [&](int n) { return fmt::format("{:.{}g}", scalar(n), digits); };
  const auto leftOf = [&](int n) {
    return static_cast<float>(n) / kIntervals * (width - ImGui::CalcTextSize(textOf(n).c_str()).x);
  };
  // Long numbers, as those of logarithmic scales, stand at every second place.
  const float gap = 0.4f * ImGui::GetFontSize();
  bool fits = true;
  for (int n = 0; n < kIntervals; ++n)
    fits &= leftOf(n) + ImGui::CalcTextSize(textOf(n).c_str()).x + gap <= leftOf(n + 1);
  for (int n = 0; n <= kIntervals; n += fits ? 1 : 2) {
    ImGui::GetWindowDrawList()->AddText({lower.x + leftOf(n), lower.y}, ImGui::GetColorU32(ImGuiCol_Text),
                                        textOf(n).c_str());
    nameArea("number " + textOf(n), static_cast<double>(lower.x + leftOf(n)), static_cast<double>(lower.y),
             static_cast<double>(ImGui::CalcTextSize(textOf(n).c_str()).x),
             static_cast<double>(ImGui::GetTextLineHeight()));
  }
  ImGui::Dummy({width, ImGui::GetTextLineHeight()});
}

float widthOfHeights() {
  float width = 0;
  for (const double opacity : kHeights)
    width = std::max(width, ImGui::CalcTextSize(fmt::format("{:g}", opacity).c_str()).x);
  return width + 2 * kPointRadius * ImGui::GetFontSize();
}

void paintHeights(const CurveCanvas& canvas) {
  const float down = 0.5f * ImGui::GetFontSize(), away = 1.5f * kPointRadius * ImGui::GetFontSize();
  for (const double opacity : kHeights) {
    const ImVec2 at = canvas.at(0, heightOf(opacity));
    ImDrawList* const list = ImGui::GetWindowDrawList();
    list->AddLine(at, {at.x + canvas.size.x, at.y}, plotColours().grid);
    const std::string text = fmt::format("{:g}", opacity);
    const float y = std::clamp(at.y - down, canvas.lower.y, canvas.lower.y + canvas.size.y - 2 * down);
    list->AddText({at.x - away - ImGui::CalcTextSize(text.c_str()).x, y},
                  ImGui::GetColorU32(ImGuiCol_Text, 0.7f), text.c_str());
  }
}

}  // namespace curvisplat
