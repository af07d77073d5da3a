#include "tools/panels/time_bar.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "stream/base/calendar.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

enum class Sign { kFirst, kPrevious, kPlay, kStop, kNext, kLast };

void paint(Sign sign, const ImVec2& middle, float size, ImU32 colour) {
  ImDrawList* const list = ImGui::GetWindowDrawList();
  const float line = 0.32f * size;
  const auto bar = [&](float x) {
    list->AddLine({middle.x + x, middle.y - size}, {middle.x + x, middle.y + size}, colour, line);
  };
  // Its point is this far to the right of the middle, and its ends are as far to the left.
  const auto angle = [&](float point) {
    const ImVec2 corners[]{{middle.x - point, middle.y - size},
                           {middle.x + point, middle.y},
                           {middle.x - point, middle.y + size}};
    list->AddPolyline(corners, 3, colour, 0, line);
  };
  const float half = 0.5f * size;
  switch (sign) {
    case Sign::kFirst:
      bar(-2 * half);
      return angle(-half);
    case Sign::kPrevious:
      return angle(-half);
    case Sign::kNext:
      return angle(half);
    case Sign::kLast:
      bar(2 * half);
      return angle(half);
    case Sign::kPlay:
      return list->AddTriangleFilled({middle.x + size, middle.y}, {middle.x - 0.7f * size, middle.y + size},
                                     {middle.x - 0.7f * size, middle.y - size}, colour);
    case Sign::kStop:
      return list->AddRectFilled({middle.x - 0.8f * size, middle.y - 0.8f * size},
                                 {middle.x + 0.8f * size, middle.y + 0.8f * size}, colour);
  }
}

void signButton(Command command, Sign sign, PanelActions& actions) {
  const CommandInfo& info = infoOf(command);
  const float side = ImGui::GetFrameHeight();
  const ImVec2 from = ImGui::GetCursorScreenPos();
  if (ImGui::Button(fmt::format("##{}", info.label).c_str(), {1.5f * side, side})) actions.run(command);
  nameWidget(info.label);
  hint(fmt::format("{} ({})", sign == Sign::kStop ? "Stop" : info.label, info.key_name).c_str());
  paint(sign, {from.x + 0.75f * side, from.y + 0.5f * side}, 0.24f * side, ImGui::GetColorU32(ImGuiCol_Text));
  ImGui::SameLine(0, 0.15f * side);
}

/// Stops between steps only where the series is interpolated.
void slider(const Playback& playback, float right, PanelActions& actions) {
  const StepPosition at = playback.position();
  const double first = 0, last = static_cast<double>(playback.steps() - 1);
  double place = static_cast<double>(at.step) + at.part;
  ImGui::SetNextItemWidth(std::max(1.0f, right - ImGui::GetCursorPosX()));
  if (ImGui::SliderScalar("##step", ImGuiDataType_Double, &place, &first, &last, "",
                          ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_NoInput)) {
    if (!playback.interpolates()) place = std::round(place);
    const double whole = std::floor(place);
    actions.time = StepPosition{static_cast<uint64_t>(whole), place - whole};
  }
  nameWithoutTab("step");
  actions.dragging |= ImGui::IsItemActive();
}

}  // namespace

std::string textOf(const StepPosition& position, uint64_t steps) {
  if (position.part == 0) return fmt::format("{} of {}", position.step + 1, steps);
  return fmt::format("{:.2f} of {}", static_cast<double>(position.step + 1) + position.part, steps);
}

void drawTimeBar(const CacheReader& cache, const Playback& playback, const Rectangle& place,
                 PanelActions& actions) {
  ImGui::SetNextWindowPos({static_cast<float>(place.x), static_cast<float>(place.y)});
  ImGui::SetNextWindowSize({static_cast<float>(place.width), static_cast<float>(place.height)});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, ImVec2(1, 1));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(ImGui::GetStyle().FramePadding.x * 2, 0));
  ImGui::Begin("time", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav);
  signButton(Command::kFirstStep, Sign::kFirst, actions);
  signButton(Command::kPreviousStep, Sign::kPrevious, actions);
  signButton(Command::kPlay, playback.isPlaying() ? Sign::kStop : Sign::kPlay, actions);
  signButton(Command::kNextStep, Sign::kNext, actions);
  signButton(Command::kLastStep, Sign::kLast, actions);

  const Manifest& series = cache.seriesManifest();
  const double time = cache.series().timeAt(playback.position());
  const std::string date = dateOf(time, {series.time_unit, series.calendar}).value_or("");
  const std::string step = textOf(playback.position(), playback.steps());
  const std::string when = date.empty() ? fmt::format("t = {:.6g}{}{}", time,
                                                      series.time_unit.empty() ? "" : " ", series.time_unit)
                                        : date;
  // The field is as wide as the longest text, so that nothing moves while it plays.
  const float unit = ImGui::GetFontSize();
  const float of_step = ImGui::CalcTextSize(fmt::format("{0}.00 of {0}", playback.steps()).c_str()).x;
  const float of_time = std::max(11 * unit, ImGui::CalcTextSize(when.c_str()).x);
  const float end = ImGui::GetContentRegionMax().x, gap = 0.8f * unit;
  const bool has_room = end > 30 * unit + of_step + of_time;
  const float texts = of_step + gap + (has_room ? of_time + gap : 0);
  slider(playback, end - texts - gap, actions);
  ImGui::SameLine(end - texts);
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(step.c_str());
  nameWidget("step " + step);
  if (has_room) {
    ImGui::SameLine(end - of_time);
    ImGui::TextDisabled("%s", when.c_str());
    nameWidget("time " + when);
  }
  ImGui::End();
  ImGui::PopStyleVar(3);
}

}  // namespace curvisplat
