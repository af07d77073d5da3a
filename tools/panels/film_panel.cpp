#include "tools/panels/film_panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr int kPicturesInRow = 4;

std::string nameOf(size_t key) {
  return fmt::format("key frame {}", key + 1);
}

ImU32 accent() {
  return ImGui::GetColorU32(ImGuiCol_CheckMark);
}

/// A button of the film's; `id` names it for tests.
bool filmButton(const char* text, const char* id, bool enabled, const char* help) {
  ImGui::BeginDisabled(!enabled);
  const bool pressed = ImGui::Button(fmt::format("{}##film", text).c_str());
  ImGui::EndDisabled();
  nameWidget(id);
  if (help) hint(help);
  return pressed;
}

}  // namespace

/// The line of a film's seconds on the screen, in pixels.
struct FilmPanel::TimeScale {
  float left, width, y;
  float half_mark;
  double extent;  // seconds of the whole line

  float placeOf(double time) const { return left + width * static_cast<float>(time / extent); }
  double timeUnderMouse() const {
    const double share = static_cast<double>((ImGui::GetIO().MousePos.x - left) / width);
    return std::clamp(share, 0.0, 1.0) * extent;
  }
};

void FilmPanel::draw(const FilmEdit& film, const FilmPictures& pictures, PanelActions& actions) {
  FilmActions& does = actions.film;
  const bool has_keys = !film.keys().empty(), selects = film.selected().has_value();
  // The buttons stay where they are when the first key frame is added: "add" is pressed again and again.
  does.add |= filmButton("Add key frame", "add key frame", true,
                         "of what is shown now, after the one that is selected");
  ImGui::SameLine();
  does.replace |=
      filmButton("Update", "update key frame", selects, "the selected one shows what is shown now");
  ImGui::SameLine();
  does.remove |= filmButton("Delete", "delete key frame", selects, "the selected one");
  ImGui::SameLine();
  does.play |=
      filmButton(film.isPlaying() ? "Stop" : "Play", "play film", film.end() > film.begin(), nullptr);
  does.open |= filmButton("Open...", "open film", true, "a file of key frames, as render --path draws it");
  ImGui::SameLine();
  does.save |= filmButton("Save keys...", "save film", has_keys,
                          "the key frames, for render --path and for the next time");
  ImGui::BeginDisabled(!has_keys);
  commandButton(Command::kSaveFilmMovie, actions, "Save film...");
  ImGui::SameLine();
  commandButton(Command::kCopyFilmCommand, actions, "Copy command");
  ImGui::EndDisabled();
  if (has_keys) {
    drawPictures(film, pictures, does);
    drawTimeLine(film, actions);
    drawTime(film, does);
  } else {
    ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
    ImGui::TextWrapped(
        "A key frame keeps the camera, the colours, the cuts and the time step. Add one, change the picture, "
        "add the next.");
    ImGui::PopStyleColor();
  }
}

void FilmPanel::drawPictures(const FilmEdit& film, const FilmPictures& pictures, FilmActions& actions) {
  const float gap = 0.4f * ImGui::GetFontSize();
  const float width =
      std::floor((ImGui::GetContentRegionAvail().x - (kPicturesInRow - 1) * gap) / kPicturesInRow);
  const float height = std::floor(static_cast<float>(kShape) * width);
  const float rounding = ImGui::GetStyle().FrameRounding;
  const auto selected = film.selected();
  ImDrawList* const list = ImGui::GetWindowDrawList();
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
  for (size_t n = 0; n < film.keys().size(); ++n) {
    const FilmEdit::Key& key = film.keys()[n];
    if (n % kPicturesInRow != 0) ImGui::SameLine();
    const ImVec2 from = ImGui::GetCursorScreenPos(), to{from.x + width, from.y + height};
    ImGui::PushID(static_cast<int>(key.picture));
    const std::string time = fmt::format("{:.4g} s", key.frame.time);
    if (ImGui::InvisibleButton("picture", {width, height + ImGui::GetTextLineHeight()})) actions.select = n;
    ImGui::PopID();
    nameWidget(nameOf(n));
    void* const texture = pictures(key.picture);
    if (texture) {
      list->AddImageRounded(texture, from, to, {0, 0}, {1, 1}, 0xffffffff, rounding);
      nameArea(nameOf(n) + " drawn", static_cast<double>(from.x), static_cast<double>(from.y),
               static_cast<double>(width), static_cast<double>(height));
    } else {
      list->AddRectFilled(from, to, ImGui::GetColorU32(ImGuiCol_FrameBg), rounding);
    }
    const bool marked = n == selected;
    const ImU32 edge = marked                   ? accent()
                       : ImGui::IsItemHovered() ? ImGui::GetColorU32(ImGuiCol_TextDisabled)
                                                : ImGui::GetColorU32(ImGuiCol_Border);
    list->AddRect(from, to, edge, rounding, 0, marked ? 2.0f : 1.0f);
    const float text = ImGui::CalcTextSize(time.c_str()).x;
    list->AddText({from.x + 0.5f * (width - text), to.y},
                  ImGui::GetColorU32(marked ? ImGuiCol_Text : ImGuiCol_TextDisabled), time.c_str());
  }
  ImGui::PopStyleVar();
}

bool FilmPanel::drawMark(const FilmEdit& film, size_t n, const TimeScale& scale, FilmActions& actions) {
  const float half = scale.half_mark, x = scale.placeOf(film.keys()[n].frame.time), y = scale.y;
  ImGui::SetCursorScreenPos({x - half, y - half});
  ImGui::PushID(static_cast<int>(film.keys()[n].picture));
  ImGui::InvisibleButton("mark", {2 * half, 2 * half});
  ImGui::PopID();
  nameWithoutTab("mark of " + nameOf(n));
  const float mouse = ImGui::GetIO().MousePos.x;
  if (ImGui::IsItemActivated()) {
    actions.select = n;
    pressed_x_ = mouse;
    moves_ = false;
  }
  const bool dragging = ImGui::IsItemActive();
  // The button may have been pressed, moved and released between two frames.
  if (dragging || ImGui::IsItemDeactivated()) {
    moves_ |= std::abs(mouse - pressed_x_) >= ImGui::GetIO().MouseDragThreshold;
    const double frame = std::round(scale.timeUnderMouse() * kFramesPerSecond);
    if (moves_) actions.move = {n, frame / kFramesPerSecond};
  }
  const bool marked = n == film.selected() || ImGui::IsItemHovered();
  ImGui::GetWindowDrawList()->AddQuadFilled({x - half, y}, {x, y - half}, {x + half, y}, {x, y + half},
                                            marked ? accent() : ImGui::GetColorU32(ImGuiCol_Text));
  return dragging;
}

void FilmPanel::drawTimeLine(const FilmEdit& film, PanelActions& actions) {
  const float unit = ImGui::GetFontSize(), half = 0.45f * unit;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  // There is space to move the last one; the scale stays while it is moved.
  const double extent = extent_s_.value_or(std::max(2 * FilmEdit::kApart, 1.25 * film.end()));
  const TimeScale scale{corner.x + half, ImGui::GetContentRegionAvail().x - 2 * half, corner.y + unit, half,
                        extent};
  ImDrawList* const list = ImGui::GetWindowDrawList();
  const float line = std::max(1.0f, 0.12f * unit), y = scale.y;
  list->AddLine({scale.left, y}, {scale.left + scale.width, y}, ImGui::GetColorU32(ImGuiCol_FrameBgHovered),
                line);
  list->AddLine({scale.left, y}, {scale.placeOf(film.end()), y}, ImGui::GetColorU32(ImGuiCol_TextDisabled),
                line);
  const float now = scale.placeOf(film.time());
  list->AddLine({now, y - 0.8f * unit}, {now, y + 0.8f * unit}, accent(), line);
  bool dragging = false;
  for (size_t n = 0; n < film.keys().size(); ++n) dragging |= drawMark(film, n, scale, actions.film);
  ImGui::SetCursorScreenPos(corner);
  ImGui::InvisibleButton("time line", {scale.width + 2 * half, 2 * unit});
  nameWithoutTab("film time line");
  if (ImGui::IsItemActive()) {
    dragging = true;
    actions.film.go_to = scale.timeUnderMouse();
  }
  extent_s_ = dragging ? std::optional(extent) : std::nullopt;
  actions.dragging |= dragging;
}

void FilmPanel::drawTime(const FilmEdit& film, FilmActions& actions) {
  const auto selected = film.selected();
  label("at second");
  ImGui::BeginDisabled(!selected);
  const std::array<double, 1> shown{film.time()};
  ImGui::SetNextItemWidth(5 * ImGui::GetFontSize());
  if (const auto typed = typed_.draw("##film time", shown, "%.2f"); typed && selected)
    actions.move = {*selected, (*typed)[0]};
  nameWidget("film time");
  ImGui::EndDisabled();
  ImGui::SameLine();
  const std::string length =
      fmt::format("of {:.4g} s, {}", film.end() - film.begin(), countText(film.frames(), "picture"));
  ImGui::TextDisabled("%s", length.c_str());
  nameWidget("film length " + length);
}

}  // namespace curvisplat
