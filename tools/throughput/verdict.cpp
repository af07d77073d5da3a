#include "tools/throughput/verdict.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

// A smaller gain is within the noise of most machines.
constexpr double kMinGain = 1.1;
// More cores are recommended if the speedup is at least this fraction of their number.
constexpr double kGoodScaling = 0.7;

struct Stage {
  const char* name;
  double seconds;
};

std::string secondsText(double seconds) {
  return seconds < 0.1 ? fmt::format("{:.1f} ms", 1e3 * seconds) : fmt::format("{:.2f} s", seconds);
}

/// Whether the times differ by more than both of them spread.
bool differ(const OtherFrame& a, const OtherFrame& b) {
  return std::abs(a.seconds - b.seconds) > a.spread_s + b.spread_s;
}

std::string timeText(const OtherFrame& frame) {
  return fmt::format("{} +- {}", secondsText(frame.seconds), secondsText(frame.spread_s));
}

std::string memoryText(uint64_t bytes) {
  return fmt::format("{}M", bytes >> 20);
}

class Judge {
 public:
  Judge(const JudgedFrame& frame, const StageSpeeds& speeds, std::span<const OtherFrame> others)
      : frame_(frame), speeds_(speeds), others_(others) {
    CURVISPLAT_CHECK(frame.seconds > 0);
    const auto prepared = static_cast<double>(frame.splats_prepared);
    const auto drawn = static_cast<double>(frame.splats_drawn);
    const double decoded = frame.read_fraction * prepared;
    if (speeds.read_bytes_s)
      read_s_ = frame.read_fraction * static_cast<double>(frame.bytes) / *speeds.read_bytes_s;
    draw_s_ = drawn / speeds.draw_splats_s;
    on_cores_ = {{"decoding", decoded / speeds.verify_splats_s + decoded / speeds.decode_splats_s},
                 {"projecting", prepared / speeds.project_splats_s},
                 {"sorting", drawn / speeds.sort_splats_s}};
    if (!frame.draws_apart) on_cores_.push_back({"drawing", draw_s_});
    for (const Stage& stage : on_cores_) cores_s_ += stage.seconds;
  }

  Verdict verdict() {
    const double card_s = frame_.draws_apart ? draw_s_ : 0;
    compareResources(card_s);
    if (read_s_ > std::max(cores_s_, card_s)) {
      boundApart("reading", read_s_);
      buys_.emplace_back("a faster disk");
    } else if (card_s > cores_s_) {
      boundApart("drawing", card_s);
      buys_.emplace_back("a faster graphics card");
    } else {
      boundOnCores();
      adviseCard();
      adviseCores();
    }
    adviseMemory();
    adviseError();
    reportDisk();
    sayWhatToBuy();
    return std::move(verdict_);
  }

 private:
  void boundApart(const char* stage, double seconds) {
    verdict_.stage = stage;
    verdict_.share = 1;
    verdict_.lines.push_back(
        fmt::format("{} bounds the frame: in isolation it takes {} of {}; the work on the cores takes {}",
                    stage, secondsText(seconds), secondsText(frame_.seconds), secondsText(cores_s_)));
  }

  /// Disk, cores and graphics card work at the same time: the slowest of them bounds the frame, if it is slower by more than
  /// the measured rates spread.
  void compareResources(double card_s) {
    std::array<Stage, 3> all{{{"reading", read_s_},
                              {"the work on the cores", cores_s_},
                              {"drawing by the graphics card", card_s}}};
    std::stable_sort(all.begin(), all.end(),
                     [](const Stage& a, const Stage& b) { return a.seconds > b.seconds; });
    const double spread_s = speeds_.spread * (all[0].seconds + all[1].seconds);
    if (spread_s == 0 || all[0].seconds - all[1].seconds > spread_s) return;
    undecided_ = fmt::format("{} ({}) and {} ({})", all[0].name, secondsText(all[0].seconds), all[1].name,
                             secondsText(all[1].seconds));
    verdict_.lines.push_back(fmt::format("{}: no difference measured, since the rates spread by {:.0f} %",
                                         undecided_, 100 * speeds_.spread));
  }

  void boundOnCores() {
    std::vector<Stage> sorted = on_cores_;
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const Stage& a, const Stage& b) { return a.seconds > b.seconds; });
    verdict_.stage = sorted.front().name;
    verdict_.share = cores_s_ > 0 ? sorted.front().seconds / cores_s_ : 0;
    std::vector<std::string> stage_times;
    for (const Stage& stage : sorted)
      stage_times.push_back(fmt::format("{} {}", stage.name, secondsText(stage.seconds)));
    verdict_.lines.push_back(fmt::format(
        "{} bounds the frame: {:.0f} % of the work on the cores in {} (in isolation: {})", verdict_.stage,
        100 * verdict_.share, secondsText(frame_.seconds), fmt::join(stage_times, ", ")));
    const double rest = 1 - cores_s_ / frame_.seconds;
    if (rest > 0.15)
      verdict_.lines.push_back(fmt::format(
          "{:.0f} % of the frame is overhead: stages wait for each other and compete for caches and memory",
          100 * rest));
  }

  void adviseCard() {
    if (frame_.draws_apart || draw_s_ < cores_s_ / 3) return;
    buys_.emplace_back("a graphics card");
    verdict_.lines.push_back(
        fmt::format("a graphics card would draw instead of the cores; their remaining work takes {}",
                    secondsText(cores_s_ - draw_s_)));
  }

  /// Compares frames that differ only in their threads.
  void adviseCores() {
    const OtherFrame* one = nullptr;
    const OtherFrame* all = nullptr;
    for (const OtherFrame& other : others_) {
      if (other.threads != 1) continue;
      for (const OtherFrame& same : others_)
        if (same.threads == frame_.threads && same.threads > 1 && same.lod_pixels == other.lod_pixels &&
            same.memory_bytes == other.memory_bytes) {
          one = &other;
          all = &same;
        }
    }
    if (!one) return;
    if (!differ(*one, *all)) {
      verdict_.lines.push_back(fmt::format("--threads {} instead of 1: no difference measured ({} and {})",
                                           all->threads, timeText(*all), timeText(*one)));
      return;
    }
    const double gain = one->seconds / all->seconds;
    const bool good = gain >= kGoodScaling * all->threads;
    if (good) buys_.emplace_back("a processor with more cores");
    verdict_.lines.push_back(
        fmt::format("--threads {} draws --lod-pixels {:g} {:.1f} times as fast as --threads 1: more cores "
                    "would {}",
                    all->threads, all->lod_pixels, gain, good ? "help" : "help little"));
  }

  void adviseMemory() {
    for (const OtherFrame& more : others_)
      for (const OtherFrame& less : others_) {
        if (more.threads != less.threads || more.lod_pixels != less.lod_pixels ||
            less.memory_bytes != frame_.memory_bytes || more.memory_bytes <= less.memory_bytes)
          continue;
        if (!differ(less, more)) {
          verdict_.lines.push_back(fmt::format(
              "--memory {} instead of {}: no difference measured ({} and {})", memoryText(more.memory_bytes),
              memoryText(less.memory_bytes), timeText(more), timeText(less)));
          return;
        }
        const double gain = less.seconds / more.seconds;
        if (gain >= kMinGain)
          buys_.push_back(fmt::format("memory for --memory {}", memoryText(more.memory_bytes)));
        verdict_.lines.push_back(
            gain >= kMinGain ? fmt::format("--memory {} would help: --lod-pixels {:g} takes {} instead of {}",
                                           memoryText(more.memory_bytes), more.lod_pixels,
                                           secondsText(more.seconds), secondsText(less.seconds))
                             : fmt::format("more than --memory {} would not help: {} takes {} instead of {}",
                                           memoryText(less.memory_bytes), memoryText(more.memory_bytes),
                                           secondsText(more.seconds), secondsText(less.seconds)));
        return;
      }
  }

  void adviseError() {
    for (const OtherFrame& other : others_) {
      if (other.lod_pixels <= frame_.lod_pixels || other.threads != frame_.threads ||
          other.memory_bytes != frame_.memory_bytes || other.splats_prepared == 0)
        continue;
      const double gain = frame_.seconds / other.seconds;
      const auto measured = std::find_if(others_.begin(), others_.end(), [&](const OtherFrame& same) {
        return same.lod_pixels == frame_.lod_pixels && same.threads == frame_.threads &&
               same.memory_bytes == frame_.memory_bytes;
      });
      // What draws as much is not faster, whatever the clock said.
      const bool draws_less =
          static_cast<double>(other.splats_prepared) * kMinGain < static_cast<double>(frame_.splats_prepared);
      if (!draws_less || gain < kMinGain || (measured != others_.end() && !differ(*measured, other)))
        continue;
      verdict_.lines.push_back(fmt::format(
          "--lod-pixels {:g} takes {}, {:.1f} times as fast ({:.1f}x fewer splats)", other.lod_pixels,
          secondsText(other.seconds), gain,
          static_cast<double>(frame_.splats_prepared) / static_cast<double>(other.splats_prepared)));
    }
  }

  /// One sentence without terms of ours. It names what was measured or follows from the stages, and nothing else.
  void sayWhatToBuy() {
    if (!undecided_.empty()) {
      verdict_.lines.push_back(
          fmt::format("nothing that could be bought alone is sure to draw this faster: {} take equally long",
                      undecided_));
      return;
    }
    const bool reads_little = read_s_ < cores_s_ / 2;
    if (buys_.empty()) buys_.emplace_back("a processor with faster cores");
    verdict_.lines.push_back(
        fmt::format("to draw this faster, buy {}{}", fmt::join(buys_, ", or "),
                    !reads_little || !speeds_.read_bytes_s ? "" : "; a faster disk would change little"));
  }

  void reportDisk() {
    if (!speeds_.read_bytes_s || frame_.bytes == 0) return;
    const double frames_s = *speeds_.read_bytes_s / static_cast<double>(frame_.bytes);
    verdict_.lines.push_back(
        fmt::format("the disk could sustain {:.1f} such frames per second with nothing in memory; {:.0f} % "
                    "of this frame's "
                    "bricks were read from it",
                    frames_s, 100 * frame_.read_fraction));
  }

  const JudgedFrame& frame_;
  const StageSpeeds& speeds_;
  const std::span<const OtherFrame> others_;
  double read_s_ = 0, draw_s_ = 0, cores_s_ = 0;
  std::vector<Stage> on_cores_;
  std::vector<std::string> buys_;  // what would make the frame faster, the surest first
  std::string undecided_;          // the two resources that bound the frame equally, or empty
  Verdict verdict_;
};

}  // namespace

Verdict judge(const JudgedFrame& frame, const StageSpeeds& speeds, std::span<const OtherFrame> others) {
  return Judge(frame, speeds, others).verdict();
}

}  // namespace curvisplat
