#include "tools/viewer/function_panel.h"

#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "tools/viewer/first_view.h"
#include "tools/viewer/histogram.h"
#include "tools/viewer/widget_places.h"

namespace curvisplat {
namespace {

constexpr size_t kBins = 128;
constexpr ImGuiInputTextFlags kNumber =
    ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_CharsScientific;
constexpr float kGrabRadius = 8;  // pixels around a point
constexpr float kCurveLines = 9;  // height in lines of text

ImU32 toImGui(const glm::dvec3& rgb) {
  return ImGui::ColorConvertFloat4ToU32(
      {static_cast<float>(rgb.x), static_cast<float>(rgb.y), static_cast<float>(rgb.z), 1});
}

// Most opacities are small, so the curve shows the square root of the opacity.
float heightOf(double opacity) {
  return static_cast<float>(std::sqrt(opacity));
}
double opacityAt(float height) {
  return static_cast<double>(height) * static_cast<double>(height);
}

std::vector<std::string> presets() {
  std::vector<std::string> names;
  std::istringstream list(presetNames());
  for (std::string name; std::getline(list, name, ',');)
    names.push_back(name.substr(name.find_first_not_of(' ')));
  return names;
}

/// The rectangle of the curve.
struct Canvas {
  ImVec2 lower, size;  // upper left corner

  ImVec2 at(double x, float height) const {
    return {lower.x + static_cast<float>(x) * size.x, lower.y + (1 - height) * size.y};
  }
  double xOf(const ImVec2& mouse) const { return std::clamp((mouse.x - lower.x) / size.x, 0.0f, 1.0f); }
  float heightAt(const ImVec2& mouse) const {
    return std::clamp(1 - (mouse.y - lower.y) / size.y, 0.0f, 1.0f);
  }
};

std::optional<size_t> pointNear(const EditedFunction& function, const Canvas& canvas, const ImVec2& mouse) {
  std::optional<size_t> nearest;
  float least = kGrabRadius;
  for (size_t n = 0; n < function.points().size(); ++n) {
    const ImVec2 at = canvas.at(function.points()[n].x, heightOf(function.points()[n].opacity));
    const float distance = std::hypot(at.x - mouse.x, at.y - mouse.y);
    if (distance >= least) continue;
    least = distance;
    nearest = n;
  }
  return nearest;
}

void paintCurve(const EditedFunction& function, const std::vector<double>& histogram, const Canvas& canvas) {
  ImDrawList* const list = ImGui::GetWindowDrawList();
  const ImVec2 end(canvas.lower.x + canvas.size.x, canvas.lower.y + canvas.size.y);
  list->AddRectFilled(canvas.lower, end, IM_COL32(30, 30, 34, 255));
  const double most = histogram.empty() ? 0 : *std::max_element(histogram.begin(), histogram.end());
  for (size_t n = 0; most > 0 && n < histogram.size(); ++n) {
    // Logarithmic over four decades, so that thin layers stay visible beside the far field.
    const double part = std::clamp(1 + std::log10(std::max(histogram[n] / most, 1e-9)) / 4, 0.0, 1.0);
    const double x = static_cast<double>(n) / static_cast<double>(histogram.size());
    list->AddRectFilled(canvas.at(x, static_cast<float>(part)),
                        canvas.at(x + 1.0 / static_cast<double>(histogram.size()), 0),
                        IM_COL32(96, 104, 120, 255));
  }
  const OpacityCurve curve(function.points());
  ImVec2 before = canvas.at(0, heightOf(curve.at(0)));
  for (float x = 1; x <= canvas.size.x; ++x) {
    const double part = x / canvas.size.x;
    const ImVec2 now = canvas.at(part, heightOf(curve.at(part)));
    list->AddLine(before, now, IM_COL32(250, 250, 250, 255), 1.5f);
    before = now;
  }
  for (const OpacityPoint& point : function.points()) {
    const ImVec2 at = canvas.at(point.x, heightOf(point.opacity));
    list->AddCircleFilled(at, 5, toImGui(function.colourAt(point.x)));
    list->AddCircle(at, 5, IM_COL32(255, 255, 255, 255));
  }
}

void paintColours(const EditedFunction& function) {
  const ImVec2 lower = ImGui::GetCursorScreenPos();
  const ImVec2 size(ImGui::GetContentRegionAvail().x, ImGui::GetTextLineHeight());
  ImDrawList* const list = ImGui::GetWindowDrawList();
  for (float x = 0; x < size.x; x += 2)
    list->AddRectFilled({lower.x + x, lower.y},
                        {std::min(lower.x + x + 2, lower.x + size.x), lower.y + size.y},
                        toImGui(function.colourAt(x / size.x)));
  ImGui::Dummy(size);
}

}  // namespace

void FunctionPanel::updateHistogram(const EditedFunction& function, size_t variable) {
  if (pending_histogram_.valid()) {
    if (pending_histogram_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    histogram_ = pending_histogram_.get();
  }
  const HistogramOf of{variable, function.range(), function.logScale()};
  if (histogram_of_ == of) return;
  histogram_of_ = of;
  pending_histogram_ = std::async(std::launch::async, [&cache = cache_, of] {
    return histogramOf(cache, of.variable, of.range.first, of.range.second, of.log_scale, kBins);
  });
}

bool FunctionPanel::draw(EditedFunction& function, size_t variable) {
  updateHistogram(function, variable);
  bool changed = drawCurve(function);
  paintColours(function);
  changed |= drawRange(function, cache_.manifest().variables[variable]);
  return drawFile(function) || changed;
}

bool FunctionPanel::drawCurve(EditedFunction& function) {
  const Canvas canvas{ImGui::GetCursorScreenPos(),
                      {ImGui::GetContentRegionAvail().x, kCurveLines * ImGui::GetTextLineHeight()}};
  ImGui::InvisibleButton("curve", canvas.size,
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
  nameWidget("curve");
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const bool over = ImGui::IsItemHovered();
  const std::optional<size_t> near = over ? pointNear(function, canvas, mouse) : std::nullopt;
  bool changed = false;
  if (over && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
    if (!near) changed = true;
    dragged_ = near ? *near : function.addPoint(canvas.xOf(mouse), opacityAt(canvas.heightAt(mouse)));
  }
  if (over && near && ImGui::IsMouseClicked(ImGuiMouseButton_Right)) {
    function.removePoint(*near);
    dragged_.reset();
    changed = true;
  }
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) dragged_.reset();
  const bool mouse_moved = ImGui::GetIO().MouseDelta.x != 0 || ImGui::GetIO().MouseDelta.y != 0;
  if (dragged_ && mouse_moved) {
    function.movePoint(*dragged_, canvas.xOf(mouse), opacityAt(canvas.heightAt(mouse)));
    changed = true;
  }
  paintCurve(function, histogram_, canvas);
  if (const auto shown = dragged_ ? dragged_ : near) {
    const auto& points = function.points();
    const TransferFunctionDefinition definition = function.definition();
    ImGui::SetTooltip("%.6g: opacity %.4g\nright click to remove", definition.opacities[*shown].x,
                      points[*shown].opacity);
  }
  return changed;
}

bool FunctionPanel::drawRange(EditedFunction& function, const VariableInfo& variable) {
  bool changed = false;
  if (ImGui::BeginCombo("colours", function.preset().empty() ? "(edited)" : function.preset().c_str())) {
    if (ImGui::Selectable(EditedFunction::kAutomatic)) {
      function = automaticFunction(cache_, variable.name);
      changed = true;
    }
    for (const std::string& name : presets()) {
      if (!ImGui::Selectable(name.c_str())) continue;
      if (!function.isPreset())
        function.setColours(name);  // keep the edited opacities
      else
        function =
            EditedFunction(name, function.range().first, function.range().second, function.opacityUnit());
      changed = true;
    }
    ImGui::EndCombo();
  }
  double ends[2] = {function.range().first, function.range().second};
  if (ImGui::InputScalarN("range", ImGuiDataType_Double, ends, 2, nullptr, nullptr, "%.6g", kNumber))
    changed |= function.setRange(ends[0], ends[1]);
  nameWidget("range");
  bool log_scale = function.logScale();
  if (ImGui::Checkbox("log scale", &log_scale)) changed |= function.setLogScale(log_scale);
  nameWidget("log scale");
  ImGui::SameLine();
  if (ImGui::Button("full range")) changed |= function.setRange(variable.min, variable.max);
  ImGui::SameLine();
  const bool resets = ImGui::Button("reset points");
  nameWidget("reset points");
  if (resets) {
    const std::string name = function.isPreset() ? function.preset() : function.definition().name;
    try {
      function =
          EditedFunction(name, function.range().first, function.range().second, function.opacityUnit());
      changed = true;
    } catch (const UsageError& error) {
      message_ = error.what();
    }
  }
  double unit = function.opacityUnit();
  if (ImGui::InputScalar("opacity unit", ImGuiDataType_Double, &unit, nullptr, nullptr, "%.4g", kNumber)) {
    function.setOpacityUnit(unit);
    changed = true;
  }
  return changed;
}

bool FunctionPanel::drawFile(EditedFunction& function) {
  bool changed = false;
  ImGui::InputText("file", &file_);
  try {
    const bool loads = ImGui::Button("load");
    nameWidget("load");
    if (loads) {
      function = EditedFunction(readParaViewPreset(file_), function.opacityUnit());
      message_ = "loaded";
      changed = true;
    }
    ImGui::SameLine();
    const bool saves = ImGui::Button("save");
    nameWidget("save");
    if (saves) {
      writeFileDurably(file_, toParaViewPreset(function.definition()));
      message_ = "saved; draw with it: render --tf " + file_;
    }
  } catch (const Error& error) {
    message_ = error.what();
  }
  if (!message_.empty()) ImGui::TextWrapped("%s", message_.c_str());
  return changed;
}

}  // namespace curvisplat
