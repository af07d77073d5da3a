#include "tools/window/widgets.h"

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_internal.h>  // GetItemID(), MarkItemEdited(), ImGuiWindow

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/plugin.h"
#include "tools/window/keyboard_focus.h"

namespace curvisplat {
namespace {

template <class T>
void addVector(Checksum& sum, const ImVector<T>& values) {
  sum.add(std::as_bytes(std::span(values.Data, static_cast<size_t>(values.Size))));
}

}  // namespace

uint64_t appearanceOf(const ImDrawData& frame) {
  Checksum sum;
  const auto add = [&](const auto& value) { sum.add(std::as_bytes(std::span(&value, 1))); };
  add(frame.DisplayPos);
  add(frame.DisplaySize);
  add(frame.FramebufferScale);
  for (const ImDrawList* list : std::span(frame.CmdLists, static_cast<size_t>(frame.CmdListsCount))) {
    for (const ImDrawCmd& command : list->CmdBuffer) {
      add(command.ClipRect);
      add(command.TextureId);
      add(command.VtxOffset);
      add(command.IdxOffset);
      add(command.ElemCount);
    }
    addVector(sum, list->VtxBuffer);
    addVector(sum, list->IdxBuffer);
  }
  return sum.value();
}

namespace {

// The places where distributions put DejaVu Sans; the first is where the build found it.
constexpr std::array kSystemFiles{CURVISPLAT_FONT, "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
                                  "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
                                  "/usr/share/fonts/dejavu/DejaVuSans.ttf",
                                  "/usr/share/fonts/TTF/DejaVuSans.ttf"};
// Latin, Greek, super- and subscripts, arrows, mathematical and geometric signs.
constexpr ImWchar kLetters[] = {0x20,   0x17f,  0x370,  0x3ff,  0x2010, 0x2027, 0x2030, 0x205e, 0x2070,
                                0x209f, 0x2190, 0x21ff, 0x2200, 0x22ff, 0x25a0, 0x25ff, 0};
constexpr float kBuiltInPixels = 13;

}  // namespace

bool loadFont(float pixels, float pixels_per_unit) {
  ImGuiIO& io = ImGui::GetIO();
  io.Fonts->Clear();
  std::vector<std::filesystem::path> files{bundledFile("DejaVuSans.ttf")};
  files.insert(files.end(), kSystemFiles.begin(), kSystemFiles.end());
  for (const std::filesystem::path& file : files) {
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) continue;
    if (!io.Fonts->AddFontFromFileTTF(file.c_str(), pixels, nullptr, kLetters)) continue;
    io.FontGlobalScale = 1 / pixels_per_unit;
    return true;
  }
  io.Fonts->AddFontDefault();
  io.FontGlobalScale = pixels / kBuiltInPixels / pixels_per_unit;
  return false;
}

namespace {

/// Lets Tab stop at the item that Dear ImGui drew last, and says where the focus is.
void letTabReach(const std::string& name, ImGuiID part = 0) {
  if (!keyboardFocus().offer(part)) return;
  const ImVec2 at = ImGui::GetItemRectMin(), size = ImGui::GetItemRectSize();
  nameArea("focus " + name, static_cast<double>(at.x), static_cast<double>(at.y), static_cast<double>(size.x),
           static_cast<double>(size.y));
}

/// Draws several fields beside each other, as Dear ImGui's do that have more than one number, but so that Tab stops at each.
/// Returns whether any says that it has changed. `label` begins with ##.
bool drawBeside(const char* label, size_t count, const std::function<bool(size_t)>& field) {
  bool changed = false;
  ImGui::BeginGroup();
  ImGui::PushID(label);
  ImGui::PushMultiItemsWidths(static_cast<int>(count), ImGui::CalcItemWidth());
  for (size_t n = 0; n < count; ++n) {
    ImGui::PushID(static_cast<int>(n));
    if (n > 0) ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
    changed |= field(n);
    letTabReach(fmt::format("{} {}", label + 2, n + 1));
    ImGui::PopID();
    ImGui::PopItemWidth();
  }
  ImGui::PopID();
  ImGui::EndGroup();
  return changed;
}

}  // namespace

bool colourSwatch(const char* label, float* rgb, const std::string& name) {
  const bool changed = ImGui::ColorEdit3(label, rgb, ImGuiColorEditFlags_NoInputs);
  ImGui::PushID(label);
  letTabReach(name, ImGui::GetID("##ColorButton"));
  ImGui::PopID();
  nameWithoutTab(name);
  return changed;
}

bool isDragged() {
  return ImGui::IsItemActive() && !ImGui::GetIO().WantTextInput;
}

namespace {

/// Dear ImGui opens sliders for typing where Ctrl is down, and fields that are dragged by a double click, too.
template <typename T>
bool typedSlider(const char* label, ImGuiDataType type, T& value, const T ends[2], const char* format,
                 int flags) {
  static std::pair<ImGuiID, T> pressed;  // the slider that was clicked last, and its value then
  ImGuiIO& io = ImGui::GetIO();
  const ImGuiID id = ImGui::GetID(label);
  const bool clicked = GImGui->HoveredIdPreviousFrame == id && io.MouseClicked[0];
  const bool again = clicked && io.MouseDoubleClicked[0] && pressed.first == id;
  const bool restored = again && value != pressed.second;
  if (again)
    value = pressed.second;
  else if (clicked)
    pressed = {id, value};
  const bool held = std::exchange(io.KeyCtrl, io.KeyCtrl || again);
  const bool changed = ImGui::SliderScalar(label, type, &value, &ends[0], &ends[1], format, flags);
  io.KeyCtrl = held;
  if (restored) ImGui::MarkItemEdited(id);
  return changed || restored;
}

}  // namespace

bool slider(const char* label, float& value, float lowest, float highest, const char* format, int flags) {
  const float ends[2] = {lowest, highest};
  return typedSlider(label, ImGuiDataType_Float, value, ends, format, flags);
}
bool slider(const char* label, double& value, double lowest, double highest, const char* format, int flags) {
  const double ends[2] = {lowest, highest};
  return typedSlider(label, ImGuiDataType_Double, value, ends, format, flags);
}
bool slider(const char* label, int& value, int lowest, int highest, const char* format, int flags) {
  const int ends[2] = {lowest, highest};
  return typedSlider(label, ImGuiDataType_S32, value, ends, format, flags);
}

bool dragEnds(const char* label, float& low, float& high, const DraggedEnds& ends) {
  const bool changed = drawBeside(label, 2, [&](size_t n) {
    return n == 0 ? ImGui::DragFloat("", &low, ends.speed, ends.lowest, std::min(ends.highest, high),
                                     ends.low_format, ImGuiSliderFlags_AlwaysClamp)
                  : ImGui::DragFloat("", &high, ends.speed, std::max(ends.lowest, low), ends.highest,
                                     ends.high_format, ImGuiSliderFlags_AlwaysClamp);
  });
  if (changed) {  // Dear ImGui does not clamp where both bounds are equal
    low = std::clamp(low, ends.lowest, ends.highest);
    high = std::clamp(high, low, ends.highest);
  }
  return changed;
}

std::optional<std::array<double, TypedNumbers::kMax>> TypedNumbers::draw(const char* label,
                                                                         std::span<const double> values,
                                                                         const char* format) {
  CURVISPLAT_CHECK_OP(values.size(), <=, kMax);
  const ImGuiID id = ImGui::GetID(label);
  std::array<double, kMax> numbers = typed_;
  if (field_ != id) std::ranges::copy(values, numbers.begin());
  const auto field = [&](size_t n) {
    return ImGui::InputScalar("", ImGuiDataType_Double, &numbers[n], nullptr, nullptr, format,
                              ImGuiInputTextFlags_CharsScientific);
  };
  if (drawBeside(label, values.size(), field)) {
    field_ = id;
    typed_ = numbers;
  }
  if (field_ != id) return std::nullopt;
  // Tab leaves one field in a frame, perhaps that after the key, and enters the next in another.
  constexpr int kFramesOfTab = 2;
  const bool is_active = ImGui::IsItemActive();
  if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Tab), false))
    frames_ = kFramesOfTab + 1;
  else if (is_active)
    frames_ = 0;
  if (is_active || (frames_ > 0 && --frames_ > 0)) return std::nullopt;
  field_ = 0;
  if (std::ranges::equal(values, std::span(typed_).first(values.size()))) return std::nullopt;
  return typed_;
}

namespace {

struct Places {
  const char* const file = std::getenv("CURVISPLAT_WIDGETS");
  std::string now, written;
  std::map<ImGuiID, std::pair<std::string, ImVec2>> widgets;  // of this frame: name and place
};

Places& places() {
  static Places places;
  return places;
}

}  // namespace

void nameWidget(const std::string& name) {
  letTabReach(name);
  nameWithoutTab(name);
}

void nameWithoutTab(const std::string& name) {
  if (!places().file) return;
  const ImVec2 at = ImGui::GetItemRectMin(), size = ImGui::GetItemRectSize();
  // A list that has just opened, or become longer, does not know its size yet, and a click there would close it.
  const ImGuiWindow& window = *ImGui::GetCurrentWindow();
  const bool is_list = (window.Flags & ImGuiWindowFlags_Popup) != 0;
  const ImVec2 centre(at.x + 0.5f * size.x, at.y + 0.5f * size.y);
  if (window.Appearing || (is_list && !window.ClipRect.Contains(centre))) return;
  nameArea(name, static_cast<double>(at.x), static_cast<double>(at.y), static_cast<double>(size.x),
           static_cast<double>(size.y));
  const ImGuiID id = ImGui::GetItemID();
  const auto [first, is_new] = places().widgets.try_emplace(id, name, at);
  const auto& [other, place] = first->second;
  if (id != 0 && !is_new && (place.x != at.x || place.y != at.y))
    nameArea(fmt::format("twins: {} and {}", other, name), 0, 0, 0, 0);
}

void drawKeyTable(std::span<const KeyRow> rows) {
  if (!ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit | ImGuiTableFlags_RowBg)) return;
  ImGui::TableSetupColumn("key or mouse");
  ImGui::TableSetupColumn("what it does");
  ImGui::TableHeadersRow();
  for (const KeyRow& row : rows)
    for (const char* const text : {row.key, row.what}) {
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(text);
    }
  ImGui::EndTable();
}

void nameArea(const std::string& name, double x, double y, double width, double height) {
  if (places().file)
    places().now += fmt::format("{:.0f} {:.0f} {:.0f} {:.0f} {}\n", x, y, width, height, name);
}

void writeWidgetPlaces() {
  const char* const file = places().file;
  const std::string now = std::exchange(places().now, {});
  places().widgets.clear();
  if (!file || now == places().written) return;
  const std::string part = std::string(file) + ".part";
  std::ofstream(part) << now;
  std::error_code ignored;
  std::filesystem::rename(part, file, ignored);
  places().written = now;
}

}  // namespace curvisplat
