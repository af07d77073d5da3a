#include "render/frame/frame_statistics.h"

#include <algorithm>
#include <array>

namespace curvisplat {
namespace {

template <typename Stage>
using Field = StatisticsField<Stage>;
template <typename Stage, size_t count>
using Fields = std::array<Field<Stage>, count>;

constexpr bool kSeconds = true;

constexpr Fields<PlanStatistics, 6> kPlan{{
    {"plan", &PlanStatistics::plan_s, Combined::kLargest, kSeconds},
    {"bricks_culled", &PlanStatistics::bricks_culled, Combined::kLargest},
    {"bricks_out_of_image", &PlanStatistics::bricks_out_of_image, Combined::kLargest},
    {"bricks_transparent", &PlanStatistics::bricks_transparent, Combined::kLargest},
    {"largest_level", &PlanStatistics::largest_level, Combined::kLargest},
    {"largest_error_px", &PlanStatistics::largest_error_px, Combined::kLargest},
}};

constexpr Fields<FetchStatistics, 16> kFetch{{
    {"read", &FetchStatistics::read_s, Combined::kSum, kSeconds},
    {"verify", &FetchStatistics::verify_s, Combined::kSum, kSeconds},
    {"decode", &FetchStatistics::decode_s, Combined::kSum, kSeconds},
    {"workers_waited_for_reads", &FetchStatistics::read_waited_s, Combined::kSum, kSeconds},
    {"mean_queue_depth", &FetchStatistics::mean_queue_depth, Combined::kLargest},
    {"bytes_read", &FetchStatistics::bytes_read},
    {"read_requests", &FetchStatistics::read_requests},
    {"bricks_cached", &FetchStatistics::bricks_cached},
    {"bricks_read", &FetchStatistics::bricks_read},
    {"bricks_left_out", &FetchStatistics::bricks_left_out},
    {"bytes_left_out", &FetchStatistics::bytes_left_out},
    {"bricks_resident", &FetchStatistics::bricks_resident},
    {"cache_bytes", &FetchStatistics::cache_bytes},
    {"kept_bytes", &FetchStatistics::kept_bytes},
    {"cache_peak_bytes", &FetchStatistics::cache_peak_bytes},
    {"pager_peak_bytes", &FetchStatistics::pager_peak_bytes},
}};

constexpr Fields<PrepareStatistics, 19> kPrepare{{
    {"project", &PrepareStatistics::project_s, Combined::kSum, kSeconds},
    {"sort", &PrepareStatistics::sort_s, Combined::kSum, kSeconds},
    {"workers_waited", &PrepareStatistics::workers_waited_s, Combined::kSum, kSeconds},
    {"exchange", &PrepareStatistics::exchange_s, Combined::kSum, kSeconds},
    {"workers", &PrepareStatistics::workers},
    {"bricks_drawn", &PrepareStatistics::bricks_drawn},
    {"bricks_hidden", &PrepareStatistics::bricks_hidden},
    {"bricks_again", &PrepareStatistics::bricks_again},
    {"splats_read", &PrepareStatistics::splats_read},
    {"splats_drawn", &PrepareStatistics::splats_drawn},
    {"splats_clipped", &PrepareStatistics::splats_clipped},
    {"splats_off_screen", &PrepareStatistics::splats_off_screen},
    {"splats_transparent", &PrepareStatistics::splats_transparent},
    {"splats_behind", &PrepareStatistics::splats_behind},
    {"exchanged_bytes", &PrepareStatistics::exchanged_bytes},
    {"regions", &PrepareStatistics::regions, Combined::kLargest},
    {"slabs", &PrepareStatistics::slabs, Combined::kLargest},
    {"ring_peak_bytes", &PrepareStatistics::ring_peak_bytes},
    {"sweep_peak_bytes", &PrepareStatistics::sweep_peak_bytes},
}};

constexpr Fields<DrawStatistics, 20> kDraw{{
    {"upload", &DrawStatistics::upload_s, Combined::kSum, kSeconds},
    {"draw", &DrawStatistics::draw_s, Combined::kSum, kSeconds},
    {"gl_draw", &DrawStatistics::gl_draw_s, Combined::kSum, kSeconds},
    {"gl_project", &DrawStatistics::gl_project_s, Combined::kSum, kSeconds},
    {"gl_list", &DrawStatistics::gl_list_s, Combined::kSum, kSeconds},
    {"gl_sort", &DrawStatistics::gl_sort_s, Combined::kSum, kSeconds},
    {"gl_paint", &DrawStatistics::gl_paint_s, Combined::kSum, kSeconds},
    {"card_entries", &DrawStatistics::card_entries},
    {"card_splats", &DrawStatistics::card_splats},
    {"card_peak_bytes", &DrawStatistics::card_peak_bytes},
    {"card_sent_bytes", &DrawStatistics::card_sent_bytes},
    {"card_slabs", &DrawStatistics::card_slabs},
    {"card_read_bytes", &DrawStatistics::card_read_bytes},
    {"card_pixels_listed", &DrawStatistics::card_pixels_listed},
    {"card_pixels_blended", &DrawStatistics::card_pixels_blended},
    {"painter_waited", &DrawStatistics::painter_waited_s, Combined::kSum, kSeconds},
    {"splats_hidden", &DrawStatistics::splats_hidden},
    {"surfaces", &DrawStatistics::surfaces_s, Combined::kSum, kSeconds},
    {"iso_splats", &DrawStatistics::iso_splats, Combined::kLargest},
    {"iso_bricks", &DrawStatistics::iso_bricks, Combined::kLargest},
}};

constexpr Fields<FrameStatistics, 2> kFrame{{
    {"total", &FrameStatistics::total_s, Combined::kLargest, kSeconds},
    {"memory_used_bytes", &FrameStatistics::memory_used_bytes, Combined::kLargest},
}};

// No number is missing: each takes eight bytes.
static_assert(sizeof(PlanStatistics) == 8 * kPlan.size());
static_assert(sizeof(FetchStatistics) == 8 * kFetch.size() + sizeof(std::string));
static_assert(sizeof(PrepareStatistics) == 8 * kPrepare.size() + sizeof(std::vector<BrickFailure>));
static_assert(sizeof(DrawStatistics) == 8 * kDraw.size());
static_assert(sizeof(FrameStatistics) == sizeof(PlanStatistics) + sizeof(FetchStatistics) +
                                             sizeof(PrepareStatistics) + sizeof(DrawStatistics) +
                                             8 * kFrame.size());

template <typename T, typename Stage>
T FrameStatistics::*memberOfFrame(T Stage::*member) {
  return member;
}

template <typename Stage, size_t count>
void addFields(const Fields<Stage, count>& fields, std::vector<Field<FrameStatistics>>& all) {
  for (const Field<Stage>& field : fields)
    std::visit(
        [&](auto member) {
          all.push_back({field.name, memberOfFrame(member), field.combined, field.seconds});
        },
        field.value);
}

template <typename Stage>
void combineFields(std::span<const Field<Stage>> fields, Stage& whole, const Stage& part) {
  for (const Field<Stage>& field : fields)
    std::visit(
        [&](auto member) {
          auto& value = whole.*member;
          value = field.combined == Combined::kLargest ? std::max(value, part.*member) : value + part.*member;
        },
        field.value);
}

/// A brick that is drawn in several slabs, or by several ranks, is reported once for each.
void addFailures(std::vector<BrickFailure>& all, const std::vector<BrickFailure>& more) {
  all.insert(all.end(), more.begin(), more.end());
  std::stable_sort(all.begin(), all.end(),
                   [](const BrickFailure& a, const BrickFailure& b) { return a.brick < b.brick; });
  const auto again = std::unique(all.begin(), all.end(), [](const BrickFailure& a, const BrickFailure& b) {
    return a.brick == b.brick;
  });
  all.erase(again, all.end());
}

}  // namespace

std::span<const StatisticsField<FrameStatistics>> statisticsFields() {
  static const std::vector<Field<FrameStatistics>> all = [] {
    std::vector<Field<FrameStatistics>> fields;
    addFields(kPlan, fields);
    addFields(kFetch, fields);
    addFields(kPrepare, fields);
    addFields(kDraw, fields);
    addFields(kFrame, fields);
    return fields;
  }();
  return all;
}

void combine(PrepareStatistics& sum, const PrepareStatistics& part) {
  combineFields<PrepareStatistics>(kPrepare, sum, part);
  addFailures(sum.bricks_unreadable, part.bricks_unreadable);
}

void combine(FrameStatistics& whole, const FrameStatistics& part) {
  combineFields(statisticsFields(), whole, part);
  addFailures(whole.bricks_unreadable, part.bricks_unreadable);
}

}  // namespace curvisplat
