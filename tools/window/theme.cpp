#include "tools/window/theme.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <initializer_list>

namespace curvisplat {

void setTheme(ImGuiStyle& style, bool light) {
  light ? ImGui::StyleColorsLight(&style) : ImGui::StyleColorsDark(&style);
  const auto set = [&](ImGuiCol colour, float r, float g, float b, float a) {
    style.Colors[colour] = {r, g, b, a};
  };
  // Dear ImGui's own greys and blues have contrasts of 2.5 to 3.5 : 1.
  if (light) {
    set(ImGuiCol_TextDisabled, 0.33f, 0.33f, 0.33f, 1);
    for (const ImGuiCol chosen : {ImGuiCol_HeaderHovered, ImGuiCol_TabHovered})
      set(chosen, 0.26f, 0.59f, 0.98f, 0.35f);
    set(ImGuiCol_HeaderActive, 0.26f, 0.59f, 0.98f, 0.5f);
    set(ImGuiCol_NavHighlight, 0.0f, 0.1f, 0.4f, 1);
  } else {
    set(ImGuiCol_TextDisabled, 0.7f, 0.7f, 0.7f, 1);
    for (const ImGuiCol hovered : {ImGuiCol_ButtonHovered, ImGuiCol_TabHovered})
      set(hovered, 0.2f, 0.45f, 0.75f, 1);
    for (const ImGuiCol active : {ImGuiCol_ButtonActive, ImGuiCol_TabActive})
      set(active, 0.1f, 0.4f, 0.7f, 1);
    set(ImGuiCol_HeaderHovered, 0.2f, 0.45f, 0.75f, 0.5f);
    set(ImGuiCol_HeaderActive, 0.2f, 0.45f, 0.75f, 0.6f);
    set(ImGuiCol_FrameBgActive, 0.2f, 0.45f, 0.75f, 0.67f);
    set(ImGuiCol_NavHighlight, 1.0f, 0.8f, 0.3f, 1);
  }
  // What lies behind a dialog gets darker in both themes, and numbers are legible through what moves along a slider.
  set(ImGuiCol_ModalWindowDimBg, 0, 0, 0, 0.45f);
  for (const ImGuiCol grab : {ImGuiCol_SliderGrab, ImGuiCol_SliderGrabActive})
    style.Colors[grab].w = std::min(style.Colors[grab].w, 0.5f);
  style.Colors[ImGuiCol_PopupBg].w = style.Colors[ImGuiCol_WindowBg].w = 1;
}

std::vector<TextOnPaper> textsOf(bool light) {
  ImGuiStyle style;
  setTheme(style, light);
  using Rgb = std::array<double, 3>;
  const auto over = [](const ImVec4& colour, double alpha, const Rgb& behind) {
    const double part = alpha * static_cast<double>(colour.w);
    const Rgb own{static_cast<double>(colour.x), static_cast<double>(colour.y),
                  static_cast<double>(colour.z)};
    Rgb mixed;
    for (size_t c = 0; c < 3; ++c) mixed[c] = part * own[c] + (1 - part) * behind[c];
    return mixed;
  };
  std::vector<TextOnPaper> texts;
  const auto add = [&](ImGuiCol text, ImGuiCol window, ImGuiCol widget, double alpha) {
    const Rgb behind = over(style.Colors[window], 1, {});
    const Rgb paper = widget == window ? behind : over(style.Colors[widget], alpha, behind);
    texts.push_back(
        {fmt::format("{} on {} in {}{}", ImGui::GetStyleColorName(text), ImGui::GetStyleColorName(widget),
                     ImGui::GetStyleColorName(window), alpha < 1 ? ", disabled" : ""),
         over(style.Colors[text], alpha, paper), paper});
  };
  for (const ImGuiCol window : {ImGuiCol_WindowBg, ImGuiCol_PopupBg}) {
    for (const ImGuiCol widget : std::initializer_list<ImGuiCol>{
             window, ImGuiCol_MenuBarBg, ImGuiCol_TitleBg, ImGuiCol_TitleBgActive, ImGuiCol_TableHeaderBg,
             ImGuiCol_FrameBg, ImGuiCol_FrameBgHovered, ImGuiCol_FrameBgActive, ImGuiCol_Button,
             ImGuiCol_ButtonHovered, ImGuiCol_ButtonActive, ImGuiCol_Header, ImGuiCol_HeaderHovered,
             ImGuiCol_HeaderActive, ImGuiCol_Tab, ImGuiCol_TabHovered, ImGuiCol_TabActive})
      add(ImGuiCol_Text, window, widget, 1);
    // The ring of the keyboard's focus, around widgets as they are and as the mouse finds them.
    for (const ImGuiCol widget : std::initializer_list<ImGuiCol>{
             window, ImGuiCol_MenuBarBg, ImGuiCol_FrameBg, ImGuiCol_FrameBgHovered, ImGuiCol_FrameBgActive,
             ImGuiCol_Button, ImGuiCol_ButtonHovered, ImGuiCol_Header, ImGuiCol_HeaderHovered, ImGuiCol_Tab,
             ImGuiCol_TabActive}) {
      add(ImGuiCol_NavHighlight, window, widget, 1);
      texts.back().least = 3;
    }
    // Notes, and at the right of a list's entries.
    for (const ImGuiCol widget :
         std::initializer_list<ImGuiCol>{window, ImGuiCol_FrameBg, ImGuiCol_Header, ImGuiCol_HeaderHovered})
      add(ImGuiCol_TextDisabled, window, widget, 1);
    for (const ImGuiCol widget :
         std::initializer_list<ImGuiCol>{window, ImGuiCol_FrameBg, ImGuiCol_Button, ImGuiCol_Header})
      add(ImGuiCol_Text, window, widget, static_cast<double>(style.DisabledAlpha));
  }
  return texts;
}

}  // namespace curvisplat
