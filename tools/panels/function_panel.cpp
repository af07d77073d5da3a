#include "tools/panels/function_panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <span>

#include "render/colour/transfer_function.h"
#include "stream/base/error.h"
#include "stream/cache/value_histogram.h"
#include "tools/panels/function_painting.h"
#include "tools/panels/labels.h"
#include "tools/view/edited_function.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

constexpr size_t kBins = 128;
constexpr float kGrabRadius = 0.6f;  // around a point, in lines of text
constexpr float kCurveLines = 9;     // height in lines of text
constexpr OpacityPoint kBand[] = {{0, 0}, {0.4, 0}, {0.5, 0.5}, {0.6, 0}, {1, 0}};
constexpr OpacityPoint kHigh[] = {{0, 0}, {0.7, 0}, {1, 1}};
constexpr OpacityPoint kClear[] = {{0, 0}, {1, 0}};

/// The definitions of the colour maps, each made once.
const TransferFunctionDefinition& definitionOf(const std::string& map) {
  static std::map<std::string, TransferFunctionDefinition> made;
  const auto found = made.find(map);
  return found != made.end() ? found->second : made.emplace(map, presetDefinition(map)).first->second;
}

/// Draws the heading of a column of this width; the last one, of width 0, ends the line.
void columnHeading(const char* text, float width) {
  const float next = ImGui::GetCursorPosX() + width + ImGui::GetStyle().ItemSpacing.x;
  ImGui::TextDisabled("%s", text);
  if (width > 0) ImGui::SameLine(next);
}

std::optional<size_t> pointNear(const EditedFunction& function, const CurveCanvas& canvas,
                                const ImVec2& mouse) {
  std::optional<size_t> nearest;
  float least = kGrabRadius * ImGui::GetFontSize();
  for (size_t n = 0; n < function.points().size(); ++n) {
    const ImVec2 at = canvas.at(function.points()[n].x, heightOf(function.points()[n].opacity));
    const float distance = std::hypot(at.x - mouse.x, at.y - mouse.y);
    if (distance >= least) continue;
    least = distance;
    nearest = n;
  }
  return nearest;
}

/// Returns the share of the volume between a coordinate of the function and its upper end.
double shareAbove(const std::vector<double>& histogram, double x) {
  const double at = std::clamp(x, 0.0, 1.0) * static_cast<double>(histogram.size());
  double share = 0;
  for (size_t n = 0; n < histogram.size(); ++n)
    share += histogram[n] * std::clamp(static_cast<double>(n + 1) - at, 0.0, 1.0);
  return share;
}

/// Draws the button that takes the mouse for the curve, and returns whether the mouse is over it. It reaches beyond the
/// canvas, so that points on the canvas's edge can be taken by their outer halves, too.
bool isReached(const CurveCanvas& canvas) {
  const float margin = kGrabRadius * ImGui::GetFontSize();
  ImGui::SetCursorScreenPos({canvas.lower.x - margin, canvas.lower.y - margin});
  ImGui::InvisibleButton("curve reach", {canvas.size.x + 2 * margin, canvas.size.y + 2 * margin},
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
  const bool reached = ImGui::IsItemHovered();
  ImGui::SetCursorScreenPos(canvas.lower);
  ImGui::Dummy(canvas.size);
  nameWithoutTab("curve");
  return reached;
}

}  // namespace

std::string FunctionPanel::updateHistogram(const EditedFunction& function, size_t variable) {
  std::string failure;
  if (pending_histogram_.valid()) {
    if (pending_histogram_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return failure;
    try {
      histogram_ = pending_histogram_.get();
    } catch (const Error& error) {
      failure = error.what();
    }
  }
  const HistogramOf of{variable, function.range(), function.logScale(), function.asinhScale()};
  if (histogram_of_ == of) return failure;
  histogram_of_ = of;
  pending_histogram_ = std::async(std::launch::async, [&cache = cache_, variable, function] {
    return histogramOf(cache, variable, function, kBins);
  });
  return failure;
}

FunctionPanel::Result FunctionPanel::draw(EditedFunction& function, size_t variable, Shows shows,
                                          uint64_t step, std::span<const double> marked) {
  Result result;
  ImGui::PushID(this);
  result.error = updateHistogram(function, variable);
  const float left = shows == Shows::kColours ? 0 : widthOfHeights();
  if (left > 0) ImGui::Indent(left);
  if (shows != Shows::kColours) result.changed |= drawCurve(function, marked, shows == Shows::kAll);
  if (shows != Shows::kOpacities) paintColours(function);
  paintNumbers(function);
  if (left > 0) ImGui::Unindent(left);
  if (shows != Shows::kOpacities) result.changed |= drawMaps(function, result);
  drawRange(function, variable, step, result);
  if (shows != Shows::kColours) {
    drawOpacities(function, result);
    drawUnit(function, result);
  }
  if (shows != Shows::kColours && ImGui::TreeNode("opacity points")) {
    nameWidget("opacity points");
    result.changed |= drawPoints(function);
    ImGui::TreePop();
  } else if (shows != Shows::kColours) {
    nameWidget("opacity points");
  }
  if (shows != Shows::kOpacities && ImGui::TreeNode("colour points")) {
    nameWidget("colour points");
    result.changed |= drawColours(function);
    ImGui::TreePop();
  } else if (shows != Shows::kOpacities) {
    nameWidget("colour points");
  }
  if (shows != Shows::kOpacities) {
    result.load = ImGui::Button("Load from file...");
    nameWidget("load");
    hint("colours and opacities from a ParaView preset, .json");
    ImGui::SameLine();
    result.save = ImGui::Button("Save to file...");
    nameWidget("save");
    hint("as a ParaView preset, .json");
  }
  result.dragging = dragged_.has_value();
  ImGui::PopID();
  return result;
}

bool FunctionPanel::drawCurve(EditedFunction& function, std::span<const double> marked, bool has_colours) {
  const CurveCanvas canvas{ImGui::GetCursorScreenPos(),
                           {availableWidth(), kCurveLines * ImGui::GetTextLineHeight()}};
  const bool reached = isReached(canvas);
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const std::optional<size_t> near = reached ? pointNear(function, canvas, mouse) : std::nullopt;
  const bool over = near || (reached && ImGui::IsMouseHoveringRect(canvas.lower, canvas.at(1, 0)));
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
    if (ImGui::GetIO().KeyShift) {
      // The ends stay where they are.
      const bool is_end = *dragged_ == 0 || *dragged_ + 1 == function.points().size();
      const auto from = is_end ? canvas.xOf({mouse.x - ImGui::GetIO().MouseDelta.x, mouse.y})
                               : function.points()[*dragged_].x;
      function.movePointsTogether(canvas.xOf(mouse) - from);
    } else
      function.movePoint(*dragged_, canvas.xOf(mouse), opacityAt(canvas.heightAt(mouse)));
    changed = true;
  }
  paintCurve(function, histogram_, marked, canvas, has_colours);
  paintHeights(canvas);
  if (const auto shown = dragged_ ? dragged_ : near) {
    const OpacityPoint& point = function.points()[*shown];
    const std::string opacity =
        fmt::format("{:.6g}: opacity {:.4g}", function.scalarAt(point.x), point.opacity);
    const std::string above = histogram_.empty() ? ""  // it is being computed
                                                 : fmt::format("\n{:.3g} % of the volume above",
                                                               100 * shareAbove(histogram_, point.x));
    ImGui::SetTooltip("%s%s\nright click to remove\nShift + drag moves all", opacity.c_str(), above.c_str());
    nameWithoutTab("point: " + opacity);
  } else if (over) {
    const double x = static_cast<double>(canvas.xOf(mouse));
    const auto bin = static_cast<size_t>(x * static_cast<double>(histogram_.size()));
    const double share = histogram_.empty() ? 0 : histogram_[std::min(bin, histogram_.size() - 1)];
    ImGui::SetTooltip("%.6g: opacity %.4g, %.3g %% of the volume\nclick to add a point", function.scalarAt(x),
                      OpacityCurve(function.points()).at(x), 100 * share);
  }
  return changed;
}

bool FunctionPanel::drawPoints(EditedFunction& function) {
  bool changed = false;
  size_t removed = 0;
  const float half = 0.38f * ImGui::GetContentRegionAvail().x;
  columnHeading("scalar", half);
  columnHeading("opacity", 0);
  for (size_t n = 0; n < function.points().size(); ++n) {
    const OpacityPoint point = function.points()[n];
    const bool end = n == 0 || n + 1 == function.points().size();
    ImGui::PushID(static_cast<int>(n));
    const double scalar = function.scalarAt(point.x), opacity = point.opacity;
    ImGui::SetNextItemWidth(half);
    ImGui::BeginDisabled(end);
    const auto typed_scalar = typed_.draw("##x", {&scalar, 1}, "%.5g");
    nameWidget(fmt::format("point {} scalar", n + 1));
    ImGui::EndDisabled();
    ImGui::SameLine();
    ImGui::SetNextItemWidth(half);
    const auto typed_opacity = typed_.draw("##opacity", {&opacity, 1}, "%.4g");
    nameWidget(fmt::format("point {} opacity", n + 1));
    if (typed_scalar || typed_opacity) {
      function.movePoint(n, typed_scalar && !end ? function.coordinateOf(typed_scalar->front()) : point.x,
                         typed_opacity ? typed_opacity->front() : opacity);
      changed = true;
    }
    ImGui::SameLine();
    ImGui::BeginDisabled(end);
    if (ImGui::Button("x")) removed = n;
    nameWidget(fmt::format("remove point {}", n + 1));
    ImGui::EndDisabled();
    ImGui::PopID();
  }
  if (removed == 0) return changed;
  function.removePoint(removed);
  return true;
}

bool FunctionPanel::drawMaps(EditedFunction& function, Result& result) {
  bool changed = false;
  label("colours");
  const std::string& map = function.map();
  const std::string shown =
      map.empty() ? "(edited)"
                  : map + (function.isAutomatic() ? fmt::format(" ({})", EditedFunction::kAutomatic) : "");
  if (!combo("##colours", shown, ImGuiComboFlags_HeightLarge,
             "of the scalar's values along the range; opacities that were edited stay")) {
    nameWidget("colours");
    return false;
  }
  const float swatch = 7 * ImGui::GetFontSize();
  float width = ImGui::GetContentRegionAvail().x;  // of the longest name, for which the list becomes wide
  for (const PublishedMap& one : builtInMaps())
    width = std::max(width, swatch + 8 + ImGui::CalcTextSize(std::string(one.name).c_str()).x);
  if (ImGui::Selectable(EditedFunction::kAutomatic, function.isAutomatic())) result.automatic = true;
  nameWidget("colours chosen from the data");
  for (const auto& [category, title] : {std::pair(MapCategory::kSequential, "sequential"),
                                        {MapCategory::kDiverging, "diverging"},
                                        {MapCategory::kCyclic, "cyclic"}}) {
    ImGui::TextDisabled("%s", title);
    for (const PublishedMap& one : builtInMaps()) {
      if (one.category != category) continue;
      const std::string name(one.name);
      const ImVec2 at = ImGui::GetCursorScreenPos();
      const bool chosen =
          ImGui::Selectable(("##" + name).c_str(), !function.isAutomatic() && name == map, 0, {width, 0});
      nameWidget("colours " + name);
      const TransferFunctionDefinition& preset = definitionOf(name);
      const ColourMap colours(preset.colours, preset.colour_space);
      paintStrip({at.x, at.y + 1}, {swatch, ImGui::GetTextLineHeight() - 2},
                 [&](double x) { return colours.at(x); });
      ImGui::GetWindowDrawList()->AddText({at.x + swatch + 8, at.y}, ImGui::GetColorU32(ImGuiCol_Text),
                                          name.c_str());
      if (!chosen) continue;
      if (!function.isPreset())
        function.setColours(name);  // keep the edited opacities
      else
        function =
            EditedFunction(name, function.range().first, function.range().second, function.opacityUnit());
      changed = true;
    }
  }
  ImGui::EndCombo();
  return changed;
}

bool FunctionPanel::drawColours(EditedFunction& function) {
  constexpr size_t kMany = 12;
  if (function.colours().size() > kMany) {
    const bool thins = ImGui::Button("Edit these colours");
    nameWidget("edit these colours");
    hint("nine points in place of the colour map");
    if (thins) function.thinColours();
    return thins;
  }
  bool changed = false;
  size_t removed = 0;
  columnHeading("colour", ImGui::CalcTextSize("colour").x);
  columnHeading("scalar", 0);
  for (size_t n = 0; n < function.colours().size(); ++n) {
    const ColourPoint point = function.colours()[n];
    const bool end = n == 0 || n + 1 == function.colours().size();
    ImGui::PushID(static_cast<int>(n));
    float rgb[3] = {static_cast<float>(point.rgb.x), static_cast<float>(point.rgb.y),
                    static_cast<float>(point.rgb.z)};
    if (colourSwatch("##colour", rgb, fmt::format("colour {}", n + 1))) {
      function.setColour(n, {double{rgb[0]}, double{rgb[1]}, double{rgb[2]}});
      changed = true;
    }
    ImGui::SameLine(
        0, ImGui::CalcTextSize("colour").x - ImGui::GetFrameHeight() + ImGui::GetStyle().ItemSpacing.x);
    const double scalar = function.scalarAt(point.x);
    ImGui::SetNextItemWidth(0.4f * ImGui::GetContentRegionAvail().x);
    ImGui::BeginDisabled(end);
    if (const auto typed = typed_.draw("##colour's x", {&scalar, 1}, "%.5g")) {
      function.moveColour(n, function.coordinateOf(typed->front()));
      changed = true;
    }
    ImGui::SameLine();
    if (ImGui::Button("x")) removed = n;
    nameWidget(fmt::format("remove colour {}", n + 1));
    ImGui::EndDisabled();
    if (!end || n == 0) {
      ImGui::SameLine();
      const bool adds = ImGui::Button("+");
      nameWidget(fmt::format("add colour {}", n + 1));
      if (adds) {
        function.addColour(0.5 * (point.x + function.colours()[n + 1].x));
        changed = true;
      }
      hint("a colour between this one and the next");
    }
    ImGui::PopID();
  }
  if (removed > 0) {
    function.removeColour(removed);
    changed = true;
  }
  return changed;
}

void FunctionPanel::drawRange(EditedFunction& function, size_t variable, uint64_t step, Result& result) {
  const std::array ends{function.range().first, function.range().second};
  const auto set = [&](double low, double high) {
    if (function.setRange(low, high))
      result.changed = true;
    else
      result.error = fmt::format("range {:.6g} to {:.6g}: expected a lower end below the upper one{}", low,
                                 high, function.logScale() ? ", and above zero on a logarithmic scale" : "");
  };
  label("range");
  if (const auto typed = typed_.draw("##range", ends, "%.6g")) set((*typed)[0], (*typed)[1]);
  nameWidget("range");
  bool log_scale = function.logScale();
  if (option("log scale", log_scale)) {
    if (function.setLogScale(log_scale))
      result.changed = true;
    else
      result.error = fmt::format("log scale: the range begins at {:.6g}; expected above zero", ends[0]);
  }
  const VariableInfo& all = cache_.seriesManifest().variables[variable];
  const std::vector<SeriesStep>& steps = cache_.series().steps;
  ImGui::SameLine();
  if (ImGui::Button("Full range")) set(all.min, all.max);
  nameWidget("full range");
  const std::string extremes =
      fmt::format("from the lowest to the highest value: {:.6g} to {:.6g}", all.min, all.max);
  hint(extremes.c_str());
  ImGui::SameLine();
  if (ImGui::Button("1-99 %")) try {
      if (const auto histogram = stepHistogram(cache_, variable))
        set(histogram->percentile(0.01), histogram->percentile(0.99));
      else
        result.error = "percentiles are known neither between two time steps nor in caches of early versions";
    } catch (const Error& error) {
      result.error = error.what();
    }
  nameWidget("percentile range");
  hint("without the lowest and the highest values, which fill 1 % of the volume each");
  if (all.min < 0 && all.max > 0) {
    if (ImGui::Button("Symmetric")) {
      const double reach = std::max(std::abs(ends[0]), std::abs(ends[1]));
      set(-reach, reach);
    }
    nameWidget("symmetric range");
    hint("the range, widened until zero is in its middle: white, in most diverging maps");
  }
  if (steps.size() > 1) {
    ImGui::SameLine();
    const StepValues& of = steps[step].values[variable];
    if (ImGui::Button("This step")) set(of.min, of.max);
    nameWidget("range of this step");
    hint(fmt::format("from the lowest to the highest value of this time step: {:.6g} to {:.6g}\n"
                     "(of all steps: the tab Time)",
                     of.min, of.max)
             .c_str());
  }
  bool asinh_scale = function.asinhScale();
  if (asinh_scale) {
    ImGui::SameLine();
    if (option("asinh scale", asinh_scale)) {
      function.setLinear();
      result.changed = true;
    }
    hint("chosen from the data: linear around their middle, logarithmic further out");
  }
  nameWidget(fmt::format("scale {}", function.asinhScale() ? "asinh"
                                     : function.logScale() ? "logarithmic"
                                                           : "linear"));
}

void FunctionPanel::drawOpacities(EditedFunction& function, Result& result) {
  // Five buttons fill the line behind the word alone, not behind the column of labels.
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted("opacities");
  ImGui::SameLine();
  const auto button = [](const char* name, const char* text, const char* what) {
    const bool pressed = ImGui::Button(text);
    nameWidget(name);
    hint(what);
    return pressed;
  };
  result.automatic_opacities |=
      button("automatic", "Automatic",
             "range and opacities chosen from the data; a colour map that you chose stays");
  const float gap = ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SameLine(0, gap);
  if (button(
          "ramp", "Ramp",
          "the colour map with its own opacities: rising with the values, or on both sides of its middle")) {
    const std::string name = function.map().empty() ? kMapsOnDark.sequential : function.map();
    const bool log_scale = function.logScale();
    function = EditedFunction(name, function.range().first, function.range().second, function.opacityUnit());
    function.setLogScale(log_scale);
    result.changed = true;
  }
  const auto set = [&](const char* name, const char* text, const char* what,
                       std::span<const OpacityPoint> points) {
    ImGui::SameLine(0, gap);
    if (!button(name, text, what)) return;
    function.setOpacities({points.begin(), points.end()});
    result.changed = true;
  };
  set("band", "Band", "values in the middle of the range alone; Shift + drag moves its points together",
      kBand);
  set("high", "High", "high values alone; drag the point where they begin to another value", kHigh);
  set("clear", "Clear", "everything transparent; then click into the curve where values are to be seen",
      kClear);
}

void FunctionPanel::drawUnit(EditedFunction& function, Result& result) {
  const Manifest& manifest = cache_.manifest();
  const double size = std::max(glm::distance(manifest.lower, manifest.upper), 1e-300);
  constexpr double kThinnest = 1, kDensest = 1e-6;  // of the size
  double unit = function.opacityUnit();
  label("opacity unit");
  if (slider("##opacity unit", unit, kThinnest * size, kDensest * size, "%.4g",
             ImGuiSliderFlags_Logarithmic)) {
    function.setOpacityUnit(unit);
    result.changed = true;
  }
  result.dragging |= isDragged();
  nameWidget("opacity unit");
  hint(
      "the length over which the opacity accumulates; to the right it is smaller, and all is more opaque\n"
      "double click to type a number");
}

}  // namespace curvisplat
