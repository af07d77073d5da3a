#include "tools/window/window_commands.h"

#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>
#include <vector>

#include "stream/base/error.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

// A letter alone never writes a file and never ends the window: typing beside a text field must not.
constexpr bool kShift = true, kControl = true, kGroup = true;
constexpr std::array kCommands{
    CommandInfo{Command::kOpen, "File", "Open...", GLFW_KEY_O, !kShift, kControl, "Ctrl+O"},
    CommandInfo{Command::kSavePicture, "File", "Save picture", GLFW_KEY_S, !kShift, kControl, "Ctrl+S",
                kGroup},
    CommandInfo{Command::kSavePictureAs, "File", "Save picture as...", GLFW_KEY_S, kShift, kControl,
                "Ctrl+Shift+S"},
    CommandInfo{Command::kSaveTurnMovie, "File", "Save film: once around...", GLFW_KEY_M, !kShift, kControl,
                "Ctrl+M", kGroup},
    CommandInfo{Command::kSaveStepsMovie, "File", "Save film: all time steps...", GLFW_KEY_M, kShift,
                kControl, "Ctrl+Shift+M"},
    CommandInfo{Command::kSaveFilmMovie, "File", "Save film: key frames..."},
    CommandInfo{Command::kCopyCommand, "File", "Copy command for this picture", GLFW_KEY_C, !kShift, kControl,
                "Ctrl+C", kGroup},
    CommandInfo{Command::kCopyMovieCommand, "File", "Copy command for a film once around", GLFW_KEY_C, kShift,
                kControl, "Ctrl+Shift+C"},
    CommandInfo{Command::kCopyFilmCommand, "File", "Copy command for the key frames"},
    CommandInfo{Command::kQuit, "File", "Quit", GLFW_KEY_Q, !kShift, kControl, "Ctrl+Q", kGroup},
    CommandInfo{Command::kUndo, "Edit", "Undo", GLFW_KEY_Z, !kShift, kControl, "Ctrl+Z"},
    CommandInfo{Command::kRedo, "Edit", "Redo", GLFW_KEY_Z, kShift, kControl, "Ctrl+Shift+Z"},
    CommandInfo{Command::kResetFunction, "Edit", "Colours and opacities as at first", 0, false, false, "",
                kGroup},
    CommandInfo{Command::kRemoveMarkers, "Edit", "Remove all markers"},
    CommandInfo{Command::kFit, "View", "Fit data into the picture", GLFW_KEY_R, !kShift, !kControl, "R"},
    CommandInfo{Command::kFirstView, "View", "First view", GLFW_KEY_R, kShift, !kControl, "Shift+R"},
    CommandInfo{Command::kLookPlusX, "View", "From +x", GLFW_KEY_X, !kShift, !kControl, "X", kGroup},
    CommandInfo{Command::kLookMinusX, "View", "From -x", GLFW_KEY_X, kShift, !kControl, "Shift+X"},
    CommandInfo{Command::kLookPlusY, "View", "From +y", GLFW_KEY_Y, !kShift, !kControl, "Y"},
    CommandInfo{Command::kLookMinusY, "View", "From -y", GLFW_KEY_Y, kShift, !kControl, "Shift+Y"},
    CommandInfo{Command::kLookPlusZ, "View", "From +z", GLFW_KEY_Z, !kShift, !kControl, "Z"},
    CommandInfo{Command::kLookMinusZ, "View", "From -z", GLFW_KEY_Z, kShift, !kControl, "Shift+Z"},
    CommandInfo{Command::kLookIsometric, "View", "Isometric", GLFW_KEY_I, !kShift, !kControl, "I"},
    CommandInfo{Command::kTurnRight, "View", "Turn the camera to its right, by 15°", GLFW_KEY_RIGHT, !kShift,
                !kControl, "Right", kGroup},
    CommandInfo{Command::kTurnLeft, "View", "Turn it to its left", GLFW_KEY_LEFT, !kShift, !kControl, "Left"},
    CommandInfo{Command::kTurnUp, "View", "Raise it", GLFW_KEY_UP, !kShift, !kControl, "Up"},
    CommandInfo{Command::kTurnDown, "View", "Lower it", GLFW_KEY_DOWN, !kShift, !kControl, "Down"},
    CommandInfo{Command::kRollLeft, "View", "Roll the picture anticlockwise", GLFW_KEY_LEFT, kShift,
                !kControl, "Shift+Left"},
    CommandInfo{Command::kRollRight, "View", "Roll it clockwise", GLFW_KEY_RIGHT, kShift, !kControl,
                "Shift+Right"},
    CommandInfo{Command::kZoomIn, "View", "Larger, by a fifth", GLFW_KEY_UP, kShift, !kControl, "Shift+Up"},
    CommandInfo{Command::kZoomOut, "View", "Smaller", GLFW_KEY_DOWN, kShift, !kControl, "Shift+Down"},
    CommandInfo{Command::kOtherProjection, "View", "Perspective", GLFW_KEY_O, !kShift, !kControl, "O",
                kGroup},
    CommandInfo{Command::kFly, "View", "Fly (W S A D Q E move)", GLFW_KEY_F, !kShift, !kControl, "F"},
    CommandInfo{Command::kSaveView, "View", "Save this view", 0, false, false, "", kGroup},
    CommandInfo{Command::kLight, "Picture", "Lighting", GLFW_KEY_L, !kShift, !kControl, "L"},
    CommandInfo{Command::kDarkBackground, "Picture", "Dark background, else white", GLFW_KEY_B, !kShift,
                !kControl, "B"},
    CommandInfo{Command::kScalarBar, "Picture", "Scalar bar", 0, false, false, "", kGroup},
    CommandInfo{Command::kAxes, "Picture", "Axes"},
    CommandInfo{Command::kAxesGrid, "Picture", "Axes with numbers"},
    CommandInfo{Command::kOutline, "Picture", "Outline"},
    CommandInfo{Command::kPlaneFrames, "Picture", "Frames of cuts"},
    CommandInfo{Command::kAddClipPlane, "Picture", "Add a clip plane", 0, false, false, "", kGroup},
    CommandInfo{Command::kAddSlice, "Picture", "Add a slice"},
    CommandInfo{Command::kAddIsosurface, "Picture", "Add an isosurface"},
    CommandInfo{Command::kAddSurfaceFile, "Picture", "Add a surface from a file..."},
    CommandInfo{Command::kPlay, "Time", "Play", GLFW_KEY_SPACE, !kShift, !kControl, "Space"},
    CommandInfo{Command::kNextStep, "Time", "Next step", GLFW_KEY_PERIOD, !kShift, !kControl, "."},
    CommandInfo{Command::kPreviousStep, "Time", "Previous step", GLFW_KEY_COMMA, !kShift, !kControl, ","},
    CommandInfo{Command::kFirstStep, "Time", "First step", GLFW_KEY_HOME, !kShift, !kControl, "Home"},
    CommandInfo{Command::kLastStep, "Time", "Last step", GLFW_KEY_END, !kShift, !kControl, "End"},
    CommandInfo{Command::kPanels, "Window", "Panels", GLFW_KEY_H, !kShift, !kControl, "H"},
    CommandInfo{Command::kLightTheme, "Window", "Light theme"},
    CommandInfo{Command::kLargerText, "Window", "Larger text", GLFW_KEY_EQUAL, !kShift, kControl, "Ctrl++",
                kGroup},
    CommandInfo{Command::kSmallerText, "Window", "Smaller text", GLFW_KEY_MINUS, !kShift, kControl, "Ctrl+-"},
    CommandInfo{Command::kMessages, "Window", "Messages", 0, false, false, "", kGroup},
    CommandInfo{Command::kDismissMessages, "Window", "Dismiss messages", GLFW_KEY_ESCAPE, !kShift, !kControl,
                "Esc"},
    CommandInfo{Command::kKeys, "Help", "Keys and mouse", GLFW_KEY_F1, !kShift, !kControl, "F1 or ?"},
};

/// Keys that are the same to people.
Window::Key usual(Window::Key key) {
  if (key.control && (key.code == GLFW_KEY_KP_ADD || key.code == GLFW_KEY_EQUAL))
    return {GLFW_KEY_EQUAL, false, true};
  if (key.control && key.code == GLFW_KEY_KP_SUBTRACT) return {GLFW_KEY_MINUS, false, true};
  if (key.control && key.code == GLFW_KEY_Y) return {GLFW_KEY_Z, true, true};
  if (key.code == Window::kQuestionMark) return {GLFW_KEY_F1};
  return key;
}

}  // namespace

std::span<const CommandInfo> commands() {
  return kCommands;
}

const CommandInfo& infoOf(Command command) {
  const auto found = std::find_if(kCommands.begin(), kCommands.end(),
                                  [command](const CommandInfo& info) { return info.command == command; });
  CURVISPLAT_CHECK(found != kCommands.end());
  return *found;
}

std::optional<Command> commandOf(const Window::Key& pressed_key) {
  const Window::Key key = usual(pressed_key);
  for (const CommandInfo& info : kCommands)
    if (info.key != 0 && info.key == key.code && info.shift == key.shift && info.control == key.control)
      return info.command;
  return std::nullopt;
}

namespace {

/// "grid.xyz q.bin", without folders.
std::string shortNames(const std::vector<std::string>& files) {
  std::string text;
  for (const std::string& file : files) {
    if (!text.empty()) text += ' ';
    text += std::filesystem::path(file).filename().string();
  }
  return text;
}

void listNames(const char* title, const std::vector<std::string>& names, const std::string& now,
               std::optional<std::string>& choice) {
  for (const std::string& name : names) {
    if (ImGui::MenuItem(name.c_str(), nullptr, name == now)) choice = name;
    nameWidget(fmt::format("item {} {}", title, name));
  }
}

void chooseOne(const char* title, const std::vector<std::string>& names, const std::string& now,
               std::optional<std::string>& choice, Window& window) {
  const bool open = ImGui::BeginMenu(title, !names.empty());
  if (!open) {
    nameWidget(fmt::format("menu {}", title));
    return;
  }
  window.coverCurrent();
  listNames(title, names, now, choice);
  ImGui::EndMenu();
}

/// Lists scalars of the cache's sources that it lacks.
void listFurther(const FurtherScalars& further, const char* title, std::optional<std::string>& chosen,
                 MenuChoice& choice) {
  choice.looks_for_scalars = true;
  if (further.is_looking) ImGui::TextDisabled("looking into %s ...", further.from.c_str());
  if (!further.error.empty()) ImGui::TextDisabled("%s", further.error.c_str());
  for (const SourceScalar& one : further.scalars) {
    if (ImGui::MenuItem(one.name.c_str(), one.derived ? "computed" : nullptr)) chosen = one.name;
    nameWidget(fmt::format("item {} {}", title, one.name));
  }
}

void chooseFurther(const FurtherScalars& further, MenuChoice& choice, Window& window) {
  if (!ImGui::BeginMenu("Add scalar", !further.from.empty() && !further.is_busy)) {
    nameWidget("menu Add scalar");
    return;
  }
  window.coverCurrent();
  listFurther(further, "Add scalar", choice.add_scalar, choice);
  ImGui::EndMenu();
}

void chooseOpacityScalar(const MenuFacts& facts, MenuChoice& choice, Window& window) {
  if (!ImGui::BeginMenu("Opacity by", !facts.opacity_scalars.empty())) {
    nameWidget("menu Opacity by");
    return;
  }
  window.coverCurrent();
  listNames("Opacity by", facts.opacity_scalars, facts.opacity_scalar, choice.opacity_scalar);
  if (!facts.further.from.empty() && !facts.further.is_busy) {
    ImGui::Separator();
    ImGui::TextDisabled("more, added when chosen:");
    listFurther(facts.further, "Opacity by", choice.add_opacity_scalar, choice);
  }
  ImGui::EndMenu();
}

void chooseRecent(const MenuFacts& facts, MenuChoice& choice, Window& window) {
  if (!ImGui::BeginMenu("Open recent", !facts.recent.empty())) {
    nameWidget("menu Open recent");
    return;
  }
  window.coverCurrent();
  for (size_t n = 0; n < facts.recent.size(); ++n) {
    const std::string label = fmt::format("{}##{}", shortNames(facts.recent[n]), n);
    if (ImGui::MenuItem(label.c_str())) choice.open = facts.recent[n];
    nameWidget(fmt::format("item Open recent {}", n + 1));
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", facts.recent[n].front().c_str());
  }
  ImGui::EndMenu();
}

void drawMenu(std::string_view menu, const MenuFacts& facts, MenuChoice& choice, Window& window) {
  for (const CommandInfo& info : commands()) {
    if (menu != info.menu) continue;
    if (info.begins_group) ImGui::Separator();
    const bool enabled = facts.is_enabled(info.command);
    if (ImGui::MenuItem(info.label, info.key_name, facts.is_checked(info.command), enabled))
      choice.commands.push_back(info.command);
    nameWidget(fmt::format("item {}", info.label));
    if (info.command == Command::kOpen) chooseRecent(facts, choice, window);
  }
  if (menu == "Picture") chooseOne("Add a face of the grid", facts.faces, "", choice.faces, window);
  if (menu == "View") chooseOne("Saved views", facts.views, "", choice.view, window);
}

/// A window in the middle of the screen.
bool beginWindow(const char* title, bool& open, Window& window) {
  const ImVec2 whole = ImGui::GetIO().DisplaySize;
  const float unit = ImGui::GetFontSize();
  ImGui::SetNextWindowSize({std::min(40 * unit, whole.x), std::min(38 * unit, whole.y)}, ImGuiCond_Appearing);
  ImGui::SetNextWindowPos({0.5f * whole.x, 0.5f * whole.y}, ImGuiCond_Appearing, {0.5f, 0.5f});
  const bool shown =
      ImGui::Begin(title, &open, ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoCollapse);
  window.coverCurrent();
  nameArea(fmt::format("window {}", title), static_cast<double>(ImGui::GetWindowPos().x),
           static_cast<double>(ImGui::GetWindowPos().y), static_cast<double>(ImGui::GetWindowSize().x),
           static_cast<double>(ImGui::GetWindowSize().y));
  if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape))) open = false;
  return shown;
}

}  // namespace

MenuChoice drawMenus(const MenuFacts& facts, Window& window) {
  MenuChoice choice;
  if (!ImGui::BeginMainMenuBar()) return choice;
  window.coverCurrent();
  for (const char* menu : {"File", "Edit", "View", "Picture", "Data", "Time", "Window", "Help"}) {
    const bool open = ImGui::BeginMenu(menu);
    if (open) {
      window.coverCurrent();
      drawMenu(menu, facts, choice, window);
      if (std::string_view(menu) == "Data") {
        chooseOne("Scalar", facts.scalars, facts.scalar, choice.scalar, window);
        chooseOpacityScalar(facts, choice, window);
        chooseFurther(facts.further, choice, window);
      }
      ImGui::EndMenu();
    }
    // The item of a menu that is open is no longer the last one.
    if (!open) nameWidget(fmt::format("menu {}", menu));
  }
  ImGui::EndMainMenuBar();
  return choice;
}

/// Dear ImGui closes them by Escape only together with its own keyboard navigation, whose keys are others
/// than ours.
bool closeLists() {
  if (!ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup)) return false;
  ImGui::ClosePopupToLevel(0, true);
  return true;
}

void drawToasts(Toasts& toasts, const Rectangle& picture, double now_s, Window& window) {
  const auto unit = static_cast<double>(ImGui::GetFontSize());
  const auto& shown = toasts.shown(now_s);
  double bottom = picture.y + picture.height - 0.7 * unit;
  std::optional<size_t> removed;
  for (size_t n = shown.size(); n-- > 0;) {
    const Toast& toast = shown[n];
    const double width = std::min(44 * unit, picture.width - 1.4 * unit);
    const ImVec2 text =
        ImGui::CalcTextSize(toast.text.c_str(), nullptr, false, static_cast<float>(width - unit));
    const double height = static_cast<double>(text.y) + unit;
    const double used = std::min(width, static_cast<double>(text.x) + 1.2 * unit);
    bottom -= height;
    if (bottom < picture.y) break;
    ImGui::SetNextWindowPos(
        {static_cast<float>(picture.x + picture.width - used - 0.7 * unit), static_cast<float>(bottom)});
    ImGui::SetNextWindowSize({static_cast<float>(used), static_cast<float>(height)});
    ImGui::PushStyleColor(ImGuiCol_WindowBg,
                          toast.is_error ? IM_COL32(110, 25, 25, 240) : IM_COL32(35, 40, 48, 235));
    ImGui::PushStyleColor(ImGuiCol_Text, IM_COL32(245, 245, 245, 255));
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding,
                        ImVec2(ImGui::GetFontSize() / 2, ImGui::GetFontSize() / 2));
    ImGui::Begin(fmt::format("toast {}", n).c_str(), nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav);
    window.coverCurrent();
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(toast.text.c_str());
    ImGui::PopTextWrapPos();
    nameArea(fmt::format("message {}", toast.text), picture.x + picture.width - used - 0.7 * unit, bottom,
             used, height);
    if (ImGui::IsWindowHovered() && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) removed = n;
    ImGui::End();
    ImGui::PopStyleVar();
    ImGui::PopStyleColor(2);
    bottom -= 0.4 * unit;
  }
  if (removed) toasts.remove(*removed);
}

void drawKeys(bool& open, Window& window) {
  if (!open) return;
  std::vector<KeyRow> rows{
      {"left drag", "rotate; while flying, look around"},
      {"wheel", "zoom to what is under the mouse"},
      {"right drag", "zoom"},
      {"middle drag, Shift + left drag", "move the picture"},
      {"click", "keep the value there as a marker"},
      {"click an arrow of the axes", "look from its end, against it; again: from its other end"},
      {"drag a round handle", "move a clip plane or a slice; the ring turns it"},
      {"click into the curve", "add an opacity point; drag it; right click removes it"},
      {"Shift + drag in the curve", "move all points but the first and the last sideways"},
      {"drop files", "open them"},
      {"Tab, Shift + Tab", "go to the next button, field or slider, and back"},
      {"Space, Return", "press it; Esc leaves it"},
  };
  if (beginWindow("Keys and mouse", open, window)) {
    for (const CommandInfo& info : commands())
      if (*info.key_name) rows.push_back({info.key_name, info.label});
    drawKeyTable(rows);
  }
  ImGui::End();
}

void drawMessages(const Toasts& toasts, bool& open, Window& window) {
  if (!open) return;
  if (beginWindow("Messages", open, window)) {
    if (toasts.log().empty()) ImGui::TextDisabled("There were none.");
    for (const std::string& text : toasts.log()) {
      ImGui::TextWrapped("%s", text.c_str());
      ImGui::Separator();
    }
  }
  ImGui::End();
}

}  // namespace curvisplat
