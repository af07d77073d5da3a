#include "tools/viewer/panels.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "stream/base/process_usage.h"
#include "tools/viewer/first_view.h"
#include "tools/viewer/widget_places.h"

namespace curvisplat {
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

float Panels::width() {
  constexpr float kFontSize = 13;  // of Dear ImGui's default font; ImGui::GetFontSize() would need a frame
  return 26 * kFontSize * ImGui::GetIO().FontGlobalScale;
}

PanelActions Panels::draw(ViewState& state, size_t variable, const PanelFacts& facts) {
  PanelActions actions;
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({width(), ImGui::GetIO().DisplaySize.y});
  constexpr ImGuiWindowFlags kFixed = ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize |
                                      ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoSavedSettings;
  ImGui::Begin("curvisplat", nullptr, kFixed);
  ImGui::PushItemWidth(0.62f * ImGui::GetContentRegionAvail().x);
  if (facts.playback && facts.playback->steps() > 1) drawTime(actions, *facts.playback);
  if (ImGui::BeginCombo("scalar", state.variable.c_str())) {
    for (const VariableInfo& one : cache_.manifest().variables) {
      const bool chosen = one.name == state.variable;
      const bool chooses = ImGui::Selectable(scalarTitle(one.name, one.unit).c_str(), chosen) && !chosen;
      nameWidget("scalar " + one.name);
      if (!chooses) continue;
      chooseVariable(state, cache_, one.name);
      actions.function_changed = true;
    }
    ImGui::EndCombo();
  } else {
    nameWidget("scalar");
  }
  // `variable` is outdated if another one was chosen just now; draw the editor from the next frame on.
  if (cache_.manifest().variables[variable].name == state.variable)
    actions.function_changed |= function_.draw(state.function, variable);
  actions.changed |= actions.function_changed;
  actions.dragging |= function_.isDragging();
  if (ImGui::CollapsingHeader("View", ImGuiTreeNodeFlags_DefaultOpen)) drawView(state, actions, facts);
  if (ImGui::CollapsingHeader("Detail", ImGuiTreeNodeFlags_DefaultOpen)) drawDetail(state, actions);
  const bool clips = ImGui::CollapsingHeader("Clip box");
  nameWidget("Clip box");
  if (clips) drawClipBox(state, actions);
  if (ImGui::CollapsingHeader("Clip planes")) drawPlanes(state.clip_planes, kMaxClipPlanes, state, actions);
  if (ImGui::CollapsingHeader("Slices")) drawSlices(state, actions);
  if (ImGui::CollapsingHeader("Statistics", ImGuiTreeNodeFlags_DefaultOpen)) drawStatistics(state, facts);
  if (!facts.message.empty()) ImGui::TextWrapped("%s", facts.message.c_str());
  ImGui::PopItemWidth();
  ImGui::End();
  return actions;
}

void Panels::drawTime(PanelActions& actions, Playback& playback) {
  const double time = cache_.series().steps[playback.step()].time;
  int step = static_cast<int>(playback.step());
  if (ImGui::SliderInt("step", &step, 0, static_cast<int>(playback.steps() - 1)))
    actions.step = static_cast<uint64_t>(std::max(0, step));
  actions.dragging |= ImGui::IsItemActive();
  if (ImGui::Button(playback.isPlaying() ? "stop (space)" : "play (space)")) actions.toggle_play = true;
  ImGui::SameLine();
  bool loops = playback.loops();
  if (ImGui::Checkbox("loop", &loops)) playback.setLoop(loops);
  ImGui::SameLine();
  ImGui::Text("time %g %s", time, cache_.seriesManifest().time_unit.c_str());
  float speed = static_cast<float>(playback.stepsPerSecond());
  if (ImGui::SliderFloat("steps per second", &speed, 1, 60, "%.0f")) playback.setStepsPerSecond(speed);
}

void Panels::drawView(ViewState& state, PanelActions& actions, const PanelFacts& facts) {
  if (ImGui::Button("fit (r)")) actions.reset_camera = true;
  ImGui::SameLine();
  const bool perspective = state.camera.projection == Projection::kPerspective;
  if (ImGui::Button(perspective ? "orthographic (o)" : "perspective (o)")) actions.other_projection = true;
  ImGui::SameLine();
  if (ImGui::Button(facts.flies ? "orbit (f)" : "fly (f)")) actions.toggle_flight = true;
  if (perspective) {
    float angle = static_cast<float>(state.camera.view_angle_deg);
    if (ImGui::SliderFloat("view angle", &angle, 10, 120, "%.0f deg")) {
      state.camera.view_angle_deg = static_cast<double>(angle);
      actions.changed = true;
    }
  }
  actions.changed |= ImGui::Checkbox("scalar bar", &state.annotations.scalar_bar);
  ImGui::SameLine();
  actions.changed |= ImGui::Checkbox("axes", &state.annotations.axes);
  ImGui::SameLine();
  actions.changed |= ImGui::Checkbox("axes grid", &state.annotations.axes_grid);
  actions.changed |= ImGui::Checkbox("outline", &state.annotations.outline);
  ImGui::SameLine();
  actions.changed |= ImGui::Checkbox("dark", &state.dark);
  nameWidget("dark");
  if (ImGui::Button("save picture (p)")) actions.save_picture = true;
  ImGui::SameLine();
  if (ImGui::Button("copy command (c)")) actions.copy_command = true;
}

void Panels::drawDetail(ViewState& state, PanelActions& actions) {
  float lod = static_cast<float>(state.lod_pixels);
  if (ImGui::SliderFloat("error, pixels", &lod, 0, 16, "%.2f", ImGuiSliderFlags_Logarithmic)) {
    state.lod_pixels = static_cast<double>(lod);
    actions.changed = true;
  }
  actions.dragging |= ImGui::IsItemActive();
  int mebibytes = static_cast<int>(std::min<uint64_t>(state.memory_bytes >> 20, 1 << 30));
  if (ImGui::SliderInt("memory, MiB", &mebibytes, 64, 65536, "%d", ImGuiSliderFlags_Logarithmic))
    state.memory_bytes = static_cast<uint64_t>(mebibytes) << 20;
  actions.changed |= ImGui::IsItemDeactivatedAfterEdit();
  bool per_pixel = state.classification == Classification::kPixel;
  if (ImGui::Checkbox("classify every pixel", &per_pixel)) {
    state.classification = per_pixel ? Classification::kPixel : Classification::kFlat;
    actions.changed = true;
  }
  ImGui::SameLine();
  actions.changed |= ImGui::Checkbox("light", &state.lit);
}

void Panels::drawClipBox(ViewState& state, PanelActions& actions) {
  const Manifest& manifest = cache_.manifest();
  bool on = state.clip_box.has_value();
  const bool toggled = ImGui::Checkbox("clip", &on);
  nameWidget("clip");
  if (toggled) {
    if (on)
      state.clip_box = WorldBox{manifest.lower, manifest.upper};
    else
      state.clip_box.reset();
    actions.changed = true;
  }
  if (!state.clip_box) return;
  for (int axis = 0; axis < 3; ++axis) {
    constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
    const float lowest = static_cast<float>(manifest.lower[axis]);
    const float highest = static_cast<float>(manifest.upper[axis]);
    float lower = static_cast<float>(state.clip_box->lower[axis]);
    float upper = static_cast<float>(state.clip_box->upper[axis]);
    if (ImGui::DragFloatRange2(kNames[static_cast<size_t>(axis)], &lower, &upper, (highest - lowest) / 500,
                               lowest, highest, "%.4g", "%.4g", ImGuiSliderFlags_AlwaysClamp)) {
      state.clip_box->lower[axis] = static_cast<double>(lower);
      state.clip_box->upper[axis] = static_cast<double>(std::max(lower, upper));
      actions.changed = true;
    }
    actions.dragging |= ImGui::IsItemActive();
    nameWidget(fmt::format("clip {}", kNames[static_cast<size_t>(axis)]));
  }
}

/// Each plane has a direction and a place along it. A new one faces the viewer, in the middle of the data.
void Panels::drawPlanes(std::vector<ClipPlane>& planes, size_t most, const ViewState& state,
                        PanelActions& actions) {
  const Manifest& manifest = cache_.manifest();
  const glm::dvec3 middle = 0.5 * (manifest.lower + manifest.upper);
  const glm::dvec3 half = 0.5 * (manifest.upper - manifest.lower);
  ImGui::PushID(&planes);
  ImGui::BeginDisabled(planes.size() >= most);
  if (ImGui::Button("add a plane")) {
    // A plane's normal in data coordinates is its normal after --scale, times the scale.
    const glm::dvec3 view = (state.camera.focal_point - state.camera.position) * state.scale;
    planes.push_back({middle, glm::normalize(view)});
    actions.changed = true;
  }
  ImGui::EndDisabled();
  size_t removed = planes.size();
  for (size_t n = 0; n < planes.size(); ++n) {
    ClipPlane& plane = planes[n];
    ImGui::PushID(static_cast<int>(n));
    ImGui::Separator();
    const auto turn = [&](const char* label, const glm::dvec3& normal) {
      if (!ImGui::Button(label)) return;
      plane.normal = normal;
      actions.changed = true;
    };
    turn("x", {1, 0, 0});
    ImGui::SameLine();
    turn("y", {0, 1, 0});
    ImGui::SameLine();
    turn("z", {0, 0, 1});
    ImGui::SameLine();
    turn("view", glm::normalize((state.camera.focal_point - state.camera.position) * state.scale));
    ImGui::SameLine();
    turn("flip", -plane.normal);
    ImGui::SameLine();
    if (ImGui::Button("remove")) removed = n;
    // From the data's one end along the normal to the other.
    const double reach = glm::dot(half, glm::abs(plane.normal));
    const double length2 = glm::dot(plane.normal, plane.normal);
    double place = glm::dot(plane.normal, plane.point - middle);
    float share = reach > 0 ? static_cast<float>(0.5 + 0.5 * place / reach) : 0.5f;
    if (ImGui::SliderFloat("place", &share, 0, 1, "%.3f")) {
      place = reach * (2 * static_cast<double>(share) - 1);
      plane.point = middle + (place / length2) * plane.normal;
      actions.changed = true;
    }
    actions.dragging |= ImGui::IsItemActive();
    ImGui::PopID();
  }
  ImGui::PopID();
  if (removed == planes.size()) return;
  planes.erase(planes.begin() + static_cast<ptrdiff_t>(removed));
  actions.changed = true;
}

/// Without a slice or a surface there is nothing to show but the volume.
void Panels::drawSlices(ViewState& state, PanelActions& actions) {
  auto opacity = static_cast<float>(state.slice_opacity);
  if (ImGui::SliderFloat("opacity", &opacity, 0.05f, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp)) {
    state.slice_opacity = static_cast<double>(opacity);
    actions.changed = true;
  }
  actions.dragging |= ImGui::IsItemActive();
  const bool alone =
      state.slices.empty() && state.surfaces.empty() && state.faces.empty() && state.isovalues.empty();
  ImGui::BeginDisabled(alone);
  actions.changed |= ImGui::Checkbox("volume", &state.volume);
  ImGui::EndDisabled();
  drawPlanes(state.slices, kMaxSlices, state, actions);
}

void Panels::drawStatistics(const ViewState& state, const PanelFacts& facts) {
  if (!ImGui::BeginTable("statistics", 2, ImGuiTableFlags_SizingFixedFit)) return;
  row("picture", !facts.statistics ? "not yet drawn"
                 : facts.is_final  ? "final"
                 : facts.busy      ? "refining"
                                   : "coarse");
  if (const FrameStatistics* s = facts.statistics) {
    row("frame", milliseconds(s->total_s));
    row("plan", milliseconds(s->plan_s));
    row("read, decode",
        fmt::format("{}, {}", milliseconds(s->read_s), milliseconds(s->verify_s + s->decode_s)));
    row("project, sort", fmt::format("{}, {}", milliseconds(s->project_s), milliseconds(s->sort_s)));
    row("upload, draw", fmt::format("{}, {}", milliseconds(s->upload_s), milliseconds(s->draw_s)));
    if (s->gl_draw_s > 0) row("OpenGL", milliseconds(s->gl_draw_s));
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
  row("drawn by", facts.backend);
  ImGui::EndTable();
}

}  // namespace curvisplat
