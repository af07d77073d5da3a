#include "tools/panels/panels.h"

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <optional>
#include <string>
#include <utility>

#include "render/project/light.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "tools/panels/labels.h"
#include "tools/panels/picture_signs.h"
#include "tools/window/reports.h"
#include "tools/window/widgets.h"

namespace curvisplat {

namespace {

constexpr const char* kTabs[] = {"Colour", "Objects", "View", "Time"};

/// Draws the first `number` tabs, and returns the one that is shown; `select`: one to show from now on, or -1. Each is named
/// "tab NAME". Dear ImGui's own tabs miss a click that comes in the first frame in which the mouse is over them.
int drawTabs(int number, int select) {
  const float unit = ImGui::GetFontSize();
  int* const stored = ImGui::GetStateStorage()->GetIntRef(ImGui::GetID("tab"), 0);
  if (select >= 0) *stored = select;
  const int shown = *stored < number ? *stored : 0;
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {0.9f * unit, 0.4f * unit});
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {0.3f * unit, 0});
  const ImVec4 chosen = ImGui::GetStyleColorVec4(ImGuiCol_TabActive),
               other = ImGui::GetStyleColorVec4(ImGuiCol_Tab);
  // One under the mouse does not look more chosen than the one that is.
  const ImVec4 hovered(0.5f * (chosen.x + other.x), 0.5f * (chosen.y + other.y), 0.5f * (chosen.z + other.z),
                       0.5f * (chosen.w + other.w));
  for (int n = 0; n < number; ++n) {
    if (n > 0) ImGui::SameLine();
    ImGui::PushStyleColor(ImGuiCol_Button, n == shown ? chosen : other);
    ImGui::PushStyleColor(ImGuiCol_ButtonHovered, n == shown ? chosen : hovered);
    if (ImGui::Button(kTabs[n])) *stored = n;
    ImGui::PopStyleColor(2);
    nameWidget(std::string("tab ") + kTabs[n]);
  }
  ImGui::Separator();
  ImGui::PopStyleVar(2);
  return shown;
}

void drawFooter(PanelActions& actions) {
  ImGui::Separator();
  commandButton(Command::kSavePictureAs, actions, "Save picture...");
  ImGui::SameLine();
  commandButton(Command::kSaveTurnMovie, actions, "Film once around...");
  ImGui::SameLine();
  commandButton(Command::kCopyCommand, actions, "Copy command");
}

}  // namespace

PanelActions Panels::draw(ViewState& state, const PanelFacts& facts) {
  PanelActions actions;
  ImGui::SetNextWindowPos({static_cast<float>(facts.place.x), static_cast<float>(facts.place.y)});
  ImGui::SetNextWindowSize({static_cast<float>(facts.place.width), static_cast<float>(facts.place.height)});
  constexpr ImGuiWindowFlags kFixed = ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize |
                                      ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoSavedSettings |
                                      ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoScrollbar |
                                      ImGuiWindowFlags_NoScrollWithMouse;
  ImGui::Begin("panels", nullptr, kFixed);
  const ImGuiStyle& style = ImGui::GetStyle();
  const float footer = ImGui::GetFrameHeight() + 2 * style.ItemSpacing.y + 1;
  // Before the lists are drawn, which notice what is new when they are shown.
  const bool has_more = hasMoreObjects(state);
  const bool is_series = facts.playback && facts.playback->steps() > 1;
  const int shown = drawTabs(is_series ? 4 : 3, has_more ? 1 : -1);
  // Each tab scrolls by itself. The scroll bar always has its place, so that widgets keep their width.
  const ImVec4 clear(0, 0, 0, 0);
  if (!scrolls_)
    for (const ImGuiCol part : {ImGuiCol_ScrollbarBg, ImGuiCol_ScrollbarGrab, ImGuiCol_ScrollbarGrabHovered,
                                ImGuiCol_ScrollbarGrabActive})
      ImGui::PushStyleColor(part, clear);
  ImGui::BeginChild(kTabs[shown], {0, -footer}, false, ImGuiWindowFlags_AlwaysVerticalScrollbar);
  if (!scrolls_) ImGui::PopStyleColor(4);
  scrolls_ = ImGui::GetScrollMaxY() > 0;
  ImGui::Spacing();
  if (shown == 0) drawColour(state, facts, actions);
  if (shown == 1) drawObjects(state, facts, actions);
  if (shown == 2) drawView(state, actions, facts);
  if (shown == 3) drawTime(state, actions, *facts.playback);
  ImGui::EndChild();
  actions.changed |= actions.function_changed;
  drawFooter(actions);
  ImGui::End();
  return actions;
}

/// Whether something has been added since the frame before, by a menu or undo.
bool Panels::hasMoreObjects(const ViewState& state) {
  const size_t now = state.surfaces.size() + state.faces.size() + state.isosurfaces.size() +
                     state.slices.size() + state.clip_planes.size();
  return now > std::exchange(objects_seen_, now).value_or(now);
}

void Panels::drawObjects(ViewState& state, const PanelFacts& facts, PanelActions& actions) {
  bool draws_volume = state.drawsVolume();
  // Without anything else there would be nothing to see. The eye is not greyed then, which would read as hidden.
  if (eye(draws_volume, "volume") && state.hasSheets()) {
    state.volume = draws_volume;
    actions.changed = true;
  }
  const auto explain = [&] {
    if (!state.hasSheets())
      hint("It can be hidden once something else is shown: a surface, an isosurface or a slice.");
  };
  explain();
  ImGui::SameLine();
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted("volume");
  nameWithoutTab("volume");
  explain();
  ImGui::SameLine(0.5f * ImGui::GetContentRegionMax().x);
  commandOption(Command::kPlaneFrames, actions, "frames of cuts", facts.shows_frames);
  surfaces_.draw(state, facts.faces ? *facts.faces : std::vector<std::string>{}, facts.further, actions);
  if (!state.isosurfaces.empty()) drawFinerThanStored(state, facts);
  cuts_.draw(state, actions);
  std::optional<size_t> seen = state.markers.size();  // a click in the picture unfolds nothing
  if (const Section open{"Markers", seen, state.markers.size()})
    drawMarkers(state, cache_.manifest().globe, actions);
}

namespace {

/// Draws a line for each step: the lowest and the highest value of the scalar.
void drawRanges(const CacheReader& cache, const std::string& scalar) {
  const size_t variable = cache.variableNamed(scalar);
  const std::vector<SeriesStep>& steps = cache.series().steps;
  heading(fmt::format("Range of {}", scalar).c_str());
  ImGui::BeginChild("ranges");
  ImGuiListClipper lines;
  lines.Begin(static_cast<int>(steps.size()));
  while (lines.Step())
    for (auto n = static_cast<size_t>(lines.DisplayStart); n < static_cast<size_t>(lines.DisplayEnd); ++n) {
      const StepValues& of = steps[n].values[variable];
      const std::string text = fmt::format("step {}: {:.6g} to {:.6g}", n + 1, of.min, of.max);
      ImGui::TextUnformatted(text.c_str());
      nameWithoutTab("range of " + text);
    }
  ImGui::EndChild();
}

}  // namespace

void Panels::drawTime(const ViewState& state, PanelActions& actions, Playback& playback) {
  label("steps per second");
  float speed = static_cast<float>(playback.stepsPerSecond());
  if (slider("##steps per second", speed, 1, 60, "%.0f", ImGuiSliderFlags_AlwaysClamp))
    playback.setStepsPerSecond(speed);
  nameWidget("steps per second");
  bool loops = playback.loops();
  if (option("loop", loops)) playback.setLoop(loops);
  bool backwards = playback.isBackwards();
  if (option("backwards", backwards)) playback.setBackwards(backwards);
  bool interpolates = playback.interpolates();
  if (option("interpolate between steps", interpolates)) actions.interpolates = interpolates;
  ImGui::Spacing();
  commandButton(Command::kSaveStepsMovie, actions, "Save film of all steps...");
  drawRanges(cache_, state.variable);
}

namespace {

/// Scalars of other caches within the whole one.
void drawElsewhere(const std::vector<std::string>& names, PanelActions& actions) {
  for (const std::string& name : names) {
    if (ImGui::Selectable(fmt::format("{}  (at other samples)", name).c_str())) actions.scalar = name;
    nameWidget("scalar " + name);
  }
}

}  // namespace

void Panels::drawScalars(const ViewState& state, const PanelFacts& facts, PanelActions& actions) {
  const auto& variables = cache_.manifest().variables;
  label("scalar");
  if (combo("##scalar", state.variable, ImGuiComboFlags_HeightLargest)) {
    for (const VariableInfo& one : variables) {
      const bool chosen = one.name == state.variable;
      const bool chooses = ImGui::Selectable(scalarTitle(one.name, one.unit).c_str(), chosen);
      nameWidget("scalar " + one.name);
      if (chooses) actions.scalar = one.name;
    }
    if (facts.elsewhere) drawElsewhere(*facts.elsewhere, actions);
    if (facts.further) drawFurther(*facts.further, {}, "further scalar ", actions);
    ImGui::EndCombo();
  } else {
    nameWidget("scalar");
    nameWidget("scalar shown: " + state.variable);
  }
  drawOpacityScalars(state, facts, actions);
}

void Panels::drawOpacityScalars(const ViewState& state, const PanelFacts& facts, PanelActions& actions) {
  const auto& variables = cache_.manifest().variables;
  const bool has_further = facts.further && !facts.further->from.empty();
  label("opacity by");
  ImGui::BeginDisabled(variables.size() < 2 && !has_further);
  constexpr const char* kSame = "the same scalar";
  if (combo("##opacity by", state.opacity_by ? state.opacity_by->variable : kSame,
            ImGuiComboFlags_HeightLarge)) {
    if (ImGui::Selectable(kSame, !state.opacity_by)) actions.opacity_scalar = "";
    nameWidget("opacity by the same scalar");
    for (const VariableInfo& one : variables) {
      if (one.name == state.variable) continue;
      const bool chosen = state.opacity_by && state.opacity_by->variable == one.name;
      const bool chooses = ImGui::Selectable(scalarTitle(one.name, one.unit).c_str(), chosen);
      nameWidget("opacity by " + one.name);
      if (chooses) actions.opacity_scalar = one.name;
    }
    if (has_further) drawFurther(*facts.further, {"", true}, "further opacity by ", actions);
    ImGui::EndCombo();
  } else {
    nameWidget("opacity by");
    nameWidget("opacity shown: " + (state.opacity_by ? state.opacity_by->variable : state.variable));
  }
  ImGui::EndDisabled();
}

void Panels::drawFunctions(ViewState& state, PanelActions& actions, uint64_t step) {
  using Shows = FunctionPanel::Shows;
  const auto draw = [&](FunctionPanel& panel, EditedFunction& function, const std::string& variable,
                        Shows shows) {
    std::vector<double> isovalues;
    for (const Isosurface& one : state.isosurfaces)
      if (one.visible && one.scalar == variable) isovalues.push_back(one.value);
    const FunctionPanel::Result result =
        panel.draw(function, cache_.variableNamed(variable), shows, step, isovalues);
    actions.function_changed |= result.changed;
    actions.dragging |= result.dragging;
    actions.automatic_function |= result.automatic;
    actions.automatic_opacities |= result.automatic_opacities;
    actions.load_function |= result.load;
    if (!result.error.empty()) actions.error = result.error;
    actions.save_function |= result.save;
  };
  if (state.opacity_by) {
    draw(function_, state.function, state.variable, Shows::kColours);
    ImGui::Separator();
    ImGui::Text("opacities of %s", state.opacity_by->variable.c_str());
    draw(opacity_function_, state.opacity_by->function, state.opacity_by->variable, Shows::kOpacities);
  } else {
    draw(function_, state.function, state.variable, Shows::kAll);
  }
}

/// Draws warnings where the picture asks for finer differences than are stored.
void Panels::drawFinerThanStored(const ViewState& state, const PanelFacts& facts) {
  std::pair asked(facts.playback ? facts.playback->step() : uint64_t{0}, state.askedDifferences(cache_));
  if (asked_ != asked) {
    try {
      finer_ = finerThanStored(cache_.atStep(asked.first), asked.second);
    } catch (const Error&) {
      finer_.clear();  // the picture reports what cannot be read
    }
    asked_ = std::move(asked);
  }
  ImGui::PushTextWrapPos(0);
  for (const std::string& text : finer_) {
    ImGui::TextUnformatted(inWindowsWords(text).c_str());
    nameWithoutTab("warning " + text);
  }
  ImGui::PopTextWrapPos();
}

namespace {

/// Draws strength and direction of the light.
void drawLight(ViewState& state, PanelActions& actions) {
  const auto slide = [&](const char* name, double& value, double low, double high, const char* format) {
    label(name);
    const bool slides =
        slider(fmt::format("##{}", name).c_str(), value, low, high, format, ImGuiSliderFlags_AlwaysClamp);
    actions.dragging |= isDragged();
    actions.changed |= slides;
    nameWidget(name);
    return slides;
  };
  if (slide("light strength", state.light_strength, 0, 1, "%.2f"))
    state.light_strength = std::round(100 * state.light_strength) / 100;
  hint("the rest is the same everywhere");
  bool at_viewer = !state.lightFrom();
  ImGui::BeginDisabled(state.shadow > 0);  // which needs a direction
  if (option("light at the viewer", at_viewer)) {
    state.light_direction = at_viewer ? std::nullopt : std::optional(Light::kShadowsFrom);
    actions.changed = true;
  }
  ImGui::EndDisabled();
  const glm::dvec3 from = state.lightFrom().value_or(Light::kShadowsFrom);
  double azimuth = glm::degrees(std::atan2(from.y, from.x));
  double elevation = glm::degrees(std::atan2(from.z, std::hypot(from.x, from.y)));
  ImGui::BeginDisabled(at_viewer);
  bool moves = slide("light azimuth", azimuth, -180, 180, "%.0f°");
  hint("from x towards y");
  // Straight from above it would have no azimuth.
  moves |= slide("light elevation", elevation, -89, 89, "%.0f°");
  ImGui::EndDisabled();
  if (!moves) return;
  const double a = glm::radians(azimuth), e = glm::radians(elevation);
  state.light_direction = glm::dvec3(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
}

/// Draws the field of the text above the data.
void drawTitle(ViewState& state, PanelActions& actions) {
  label("title");
  std::string title = state.title;
  if (ImGui::InputTextWithHint("##title", "none", &title)) {
    state.setTitle(std::move(title));
    actions.changed = true;
  }
  nameWidget("title");
  hint("text above the data, in pictures and films, too");
}

/// Draws how the picture looks around the data.
void drawSurroundings(ViewState& state, PanelActions& actions) {
  const float column = 0.5f * ImGui::GetContentRegionAvail().x;
  heading("Picture");
  // Not "light" beside "dark", which reads as a choice of two.
  actions.changed |= ImGui::Checkbox("lighting", &state.lit);
  nameWidget("light");
  hint(
      "Shapes stand out; colours are darker than the scalar bar's.\n"
      "On: volume and surfaces have the light that is set below. Off: surfaces alone are lit, from the "
      "viewer.");
  ImGui::SameLine(column);
  if (ImGui::Checkbox("dark background", &state.dark)) {
    state.suitBackground();
    actions.changed = actions.function_changed = true;
  }
  nameWidget("dark");
  hint("off: a white background (B)");
  actions.changed |= option("scalar bar", state.annotations.scalar_bar);
  ImGui::SameLine(column);
  actions.changed |= option("outline", state.annotations.outline);
  actions.changed |= option("axes", state.annotations.axes);
  hint("arrows that show the directions of x, y and z");
  ImGui::SameLine(column);
  actions.changed |= ImGui::Checkbox("axes with numbers", &state.annotations.axes_grid);
  nameWidget("axes grid");
  drawTitle(state, actions);
  if (!state.lit) return;
  const auto darkness = [&](const char* name, const char* id, double& value, const char* help) {
    auto shown = static_cast<float>(value);
    label(name);
    if (slider(id, shown, 0, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp)) {
      value = static_cast<double>(shown);
      actions.changed = true;
    }
    nameWidget(name);
    hint(help);
  };
  drawLight(state, actions);
  darkness("shadow", "##shadow", state.shadow,
           "of the volume, in a light that is not at the viewer (from x, -y and above, unless it is moved); "
           "0: none");
  darkness("occlusion", "##occlusion", state.ambient_occlusion, "darkens what the volume surrounds; 0: none");
}

/// Draws the factor of heights; there is none on a sphere, where they have no axis of their own.
void drawVerticalScale(ViewState& state, const std::optional<Globe>& globe, PanelActions& actions) {
  if (globe && globe->sphere()) return;
  auto factor = static_cast<float>(state.verticalScale(globe));
  label("vertical scale");
  if (slider("##vertical scale", factor, 0.01f, 1000, "%.3g",
             ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp)) {
    state.setVerticalScale(static_cast<double>(factor), globe);
    actions.changed = true;
  }
  nameWidget("vertical scale");
  hint("stretches z; numbers on axes and at markers stay those of the data");
}

}  // namespace

void Panels::drawView(ViewState& state, PanelActions& actions, const PanelFacts& facts) {
  drawSurroundings(state, actions);
  drawVerticalScale(state, cache_.manifest().globe, actions);
  heading("Camera");
  const bool perspective = state.camera.projection == Projection::kPerspective;
  commandButton(Command::kFit, actions, "Fit");
  ImGui::SameLine();
  commandButton(Command::kFirstView, actions, "First view");
  ImGui::SameLine();
  commandOption(Command::kOtherProjection, actions, "perspective", perspective);
  ImGui::SameLine();
  commandOption(Command::kFly, actions, "fly", facts.flies);
  constexpr std::pair<Command, const char*> kSides[]{
      {Command::kLookPlusX, "+x"},      {Command::kLookMinusX, "-x"}, {Command::kLookPlusY, "+y"},
      {Command::kLookMinusY, "-y"},     {Command::kLookPlusZ, "+z"},  {Command::kLookMinusZ, "-z"},
      {Command::kLookIsometric, "+xyz"}};
  label("look from");
  hint("+x: from the end of the x axis, towards -x; the other keys are alike");
  for (const auto& [command, text] : kSides) {
    commandButton(command, actions, text);
    if (command != Command::kLookIsometric) ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
  }
  float angle = static_cast<float>(state.camera.view_angle_deg);
  label("view angle");
  ImGui::BeginDisabled(!perspective);
  if (slider("##view angle", angle, 10, 120, "%.0f°", ImGuiSliderFlags_AlwaysClamp)) {
    state.camera.view_angle_deg = static_cast<double>(angle);
    actions.changed = true;
  }
  nameWidget("view angle");
  ImGui::EndDisabled();
  heading("Saved views");
  drawSavedViews(actions, facts.views);
  ImGui::Spacing();
  if (const Section open{"Film", keys_seen_, facts.film->keys().size()})
    film_.draw(*facts.film, facts.film_pictures, actions);
  if (const Section open{"Detail and memory", false}) drawDetail(state, actions);
  if (const Section open{"Statistics", false}) drawStatistics(state, facts.shown);
}

void Panels::drawSavedViews(PanelActions& actions, const std::vector<std::string>& views) {
  label("save view as");
  const float button = ImGui::CalcTextSize("save").x + 3 * ImGui::GetStyle().FramePadding.x;
  ImGui::SetNextItemWidth(-button - ImGui::GetStyle().ItemSpacing.x);
  bool saves =
      ImGui::InputTextWithHint("##view name", "name", &view_name_, ImGuiInputTextFlags_EnterReturnsTrue);
  nameWidget("view name");
  ImGui::SameLine();
  ImGui::BeginDisabled(view_name_.empty());
  saves |= ImGui::Button("Save##view");
  nameWidget("save view");
  ImGui::EndDisabled();
  if (saves && !view_name_.empty()) actions.save_view = std::exchange(view_name_, {});
  for (const std::string& view : views) {
    ImGui::PushID(view.c_str());
    const float remove = ImGui::CalcTextSize("Remove").x + 2 * ImGui::GetStyle().FramePadding.x;
    const float width = ImGui::GetContentRegionAvail().x - remove - ImGui::GetStyle().ItemSpacing.x;
    ImGui::PushStyleVar(ImGuiStyleVar_ButtonTextAlign, {0, 0.5f});
    if (ImGui::Button((view + "##show").c_str(), {width, 0})) actions.load_view = view;
    ImGui::PopStyleVar();
    nameWidget("view " + view);
    hint("show it again: camera, colours, objects and all else of the picture");
    ImGui::SameLine();
    if (ImGui::Button("Remove")) actions.remove_view = view;
    nameWidget("remove view " + view);
    ImGui::PopID();
  }
}

void Panels::drawColour(ViewState& state, const PanelFacts& facts, PanelActions& actions) {
  drawScalars(state, facts, actions);
  ImGui::Spacing();
  drawFunctions(state, actions, facts.playback ? facts.playback->step() : 0);
  drawFinerThanStored(state, facts);
  ImGui::Separator();
  const std::string& scalar = state.opacity_by ? state.opacity_by->variable : state.variable;
  const GradientPanel::Result result =
      gradient_.draw(state.gradient_opacity, cache_.variableNamed(scalar), state.scale);
  actions.changed |= result.changed;
  actions.dragging |= result.dragging;
  if (!result.error.empty()) actions.error = result.error;
}

void Panels::drawDetail(ViewState& state, PanelActions& actions) {
  float lod = static_cast<float>(state.lod_pixels);
  label("error, pixels");
  if (slider("##error", lod, 0, 16, "%.2f", ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp)) {
    state.lod_pixels = static_cast<double>(lod);
    actions.changed = true;
  }
  nameWidget("error, pixels");
  hint("of what is drawn coarser than the data; 0 draws all of it");
  actions.dragging |= isDragged();
  int mebibytes = static_cast<int>(std::min<uint64_t>(state.memory_bytes >> 20, 1 << 30));
  label("memory, MiB");
  if (slider("##memory", mebibytes, 64, 65536, "%d",
             ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp))
    state.memory_bytes = static_cast<uint64_t>(mebibytes) << 20;
  actions.changed |= ImGui::IsItemDeactivatedAfterEdit();
  nameWidget("memory, MiB");
  bool is_flat = state.classification == Classification::kFlat;
  if (option("one colour per splat", is_flat)) {
    state.classification = is_flat ? Classification::kFlat : Classification::kPixel;
    actions.changed = true;
  }
  hint("off: each pixel has the colour of the value there, also within a splat");
}

namespace {

void row(const char* name, const std::string& value) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(name);
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(value.c_str());
}

std::string milliseconds(double seconds) {
  return fmt::format("{:.1f} ms", 1000 * seconds);
}

std::string count(uint64_t number) {
  if (number < 10'000) return fmt::format("{}", number);
  if (number < 1'000'000) return fmt::format("{:.1f} k", static_cast<double>(number) / 1e3);
  return fmt::format("{:.2f} M", static_cast<double>(number) / 1e6);
}

double mebibytes(uint64_t bytes) {
  return static_cast<double>(bytes) / (1 << 20);
}

}  // namespace

const char* stateOfPicture(const ShownStatistics& shown) {
  if (!shown.statistics) return "not yet drawn";
  return shown.is_final ? "final" : shown.busy ? "refining" : "coarse";
}

void drawStatistics(const ViewState& state, const ShownStatistics& shown) {
  if (!ImGui::BeginTable("statistics", 2, ImGuiTableFlags_SizingFixedFit)) return;
  ImGui::TableSetupColumn("cost");
  ImGui::TableSetupColumn("of the picture that is shown");
  ImGui::TableHeadersRow();
  row("picture", stateOfPicture(shown));
  if (const FrameStatistics* s = shown.statistics) {
    row("frame", milliseconds(s->total_s));
    row("plan", milliseconds(s->plan_s));
    row("read, decode",
        fmt::format("{}, {}", milliseconds(s->read_s), milliseconds(s->verify_s + s->decode_s)));
    row("project, sort", fmt::format("{}, {}", milliseconds(s->project_s), milliseconds(s->sort_s)));
    row("upload, draw", fmt::format("{}, {}", milliseconds(s->upload_s), milliseconds(s->draw_s)));
    if (s->gl_draw_s > 0) row("OpenGL", milliseconds(s->gl_draw_s));
    if (s->card_peak_bytes > 0) {
      row("card memory", byteText(s->card_peak_bytes));
      row("read back", byteText(s->card_read_bytes));
    }
    row("splats", fmt::format("{} drawn of {}", count(s->splats_drawn), count(s->splats_read)));
    row("error", fmt::format("{:.2f} pixels", s->largest_error_px));
    row("bricks", fmt::format("{} resident", count(s->bricks_resident)));
    row("  needed",
        fmt::format("{}, {} of them resident", count(s->bricks_cached + s->bricks_read + s->bricks_left_out),
                    count(s->bricks_cached)));
    row("read", fmt::format("{:.1f} MiB, {:.0f} MiB/s", mebibytes(s->bytes_read),
                            s->read_s > 0 ? mebibytes(s->bytes_read) / s->read_s : 0));
    row("memory", fmt::format("{:.0f} of {:.0f} MiB limit", mebibytes(s->memory_used_bytes),
                              mebibytes(state.memory_bytes)));
  }
  const ProcessUsage usage = ProcessUsage::now();
  row("process", fmt::format("{:.0f} MiB, peak {:.0f} MiB", mebibytes(usage.memory_bytes),
                             mebibytes(usage.peak_memory_bytes)));
  row("drawn by", shown.backend);
  ImGui::EndTable();
}

}  // namespace curvisplat
