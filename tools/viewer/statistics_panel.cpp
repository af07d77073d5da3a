#include "tools/viewer/statistics_panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include "stream/base/process_usage.h"

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

const char* stateOfPicture(const ShownStatistics& shown) {
  if (!shown.statistics) return "not yet drawn";
  return shown.is_final ? "final" : shown.busy ? "refining" : "coarse";
}

void drawStatistics(const ViewState& state, const ShownStatistics& shown) {
  if (!ImGui::BeginTable("statistics", 2, ImGuiTableFlags_SizingFixedFit)) return;
  row("picture", stateOfPicture(shown));
  if (const FrameStatistics* s = shown.statistics) {
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
  row("drawn by", shown.backend);
  ImGui::EndTable();
}

}  // namespace curvisplat
