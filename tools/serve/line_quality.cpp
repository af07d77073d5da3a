#include "tools/serve/line_quality.h"

#include <algorithm>
#include <array>

namespace curvisplat {
namespace {

constexpr double kLateSeconds = 0.12;   // beyond the line's own delay
constexpr double kEarlySeconds = 0.04;  // beyond it
constexpr double kTooLongSeconds = 1;   // no line's own delay
constexpr int kInTimeToRefine = 12;
constexpr size_t kLately = 100;

// Each level has about half the bytes of the one before.
constexpr std::array<PictureQuality, LineQuality::kCoarsest + 1> kLevels{
    {{90, 1}, {75, 1}, {50, 1}, {60, 2}, {35, 2}, {50, 4}, {25, 4}}};

}  // namespace

PictureQuality LineQuality::quality() const {
  return kLevels[static_cast<size_t>(level_)];
}

void LineQuality::sent(uint64_t picture, double now_s, bool counts) {
  // One that does not count holds up those behind it.
  const bool held_up = std::any_of(sent_.begin(), sent_.end(), [](const Sent& one) { return !one.counts; });
  sent_.push_back({picture, now_s, counts && !held_up});
}

void LineQuality::shown(uint64_t picture, double now_s) {
  const auto found =
      std::find_if(sent_.begin(), sent_.end(), [&](const Sent& one) { return one.picture == picture; });
  if (found == sent_.end()) return;
  const bool counts = found->counts;
  const double delay_s = now_s - found->at_s;
  sent_.erase(sent_.begin(), found + 1);
  if (counts) learn(delay_s);
}

void LineQuality::learn(double delay_s) {
  delays_.push_back(delay_s);
  if (delays_.size() > kLately) delays_.pop_front();
  const double over_s = delay_s - *std::min_element(delays_.begin(), delays_.end());
  ++since_change_;
  in_time_ = over_s < kEarlySeconds ? in_time_ + 1 : 0;
  int level = level_;
  // Pictures that were on their way at the last change say nothing about this level.
  if ((over_s > kLateSeconds || delay_s > kTooLongSeconds) && since_change_ > static_cast<int>(kMaxOnTheWay))
    level = std::min(kCoarsest, level_ + 1);
  else if (in_time_ >= kInTimeToRefine)
    level = std::max(0, level_ - 1);
  if (level == level_) return;
  level_ = level;
  in_time_ = since_change_ = 0;
}

}  // namespace curvisplat
