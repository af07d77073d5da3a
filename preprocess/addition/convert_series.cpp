#include "preprocess/addition/convert_series.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "preprocess/addition/series_steps.h"
#include "preprocess/addition/shared_series.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/preflight.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {
namespace {

class SeriesConversion {
 public:
  SeriesConversion(const SeriesInput& input, const SeriesOptions& options, Progress& progress,
                   const std::function<void(const SeriesEvent&)>& report)
      : input_(input),
        options_(options),
        progress_(progress),
        report_event_(report),
        ranks_(*options.convert.ranks) {
    if (hasCache()) openCache();
    if (!options.add) known_ = times_.size();
  }

  SeriesReport run() {
    try {
      if (!ranks_.alone()) {
        runTogether();
      } else {
        if (!options_.to_part) removeLeftOfRanks(options_.convert.output, options_.convert.temporary_folder);
        for (uint64_t number = stepsAddedBefore(); number < input_.count; ++number) takeOrLeaveOut(number);
      }
    } catch (const Interrupted& interrupted) {
      throw Interrupted(interrupted.signal(), whereItStands(interrupted.what()));
    }
    if (times_.empty()) throw Error("{}: no step could be converted", options_.convert.output.string());
    sums_.steps = times_.size();
    return std::move(sums_);
  }

 private:
  /// A step of the input, and how it is converted if it is the first.
  struct OpenStep {
    std::unique_ptr<DataSource> source;
    ConvertOptions first;
  };

  /// A step that another rank could not convert.
  struct FailedElsewhere {
    uint64_t number = 0;
    unsigned rank = 0;
    std::string error;
  };

  void takeOrLeaveOut(uint64_t number) {
    try {
      use(number, open(number));
    } catch (const Interrupted&) {
      throw;
    } catch (const UsageError&) {
      throw;
    } catch (const OutputError& error) {
      if (options_.is_kept) throw;
      throw OutputError(whyNot(number, error.what()));
    } catch (const Error& error) {
      leaveOut(number, error.what());
    }
  }

  /// All ranks together up to the first step, which decides what is converted; then in rounds (shared_series.h).
  void runTogether() {
    uint64_t next = stepsAddedBefore();
    for (; next < input_.count && (times_.empty() || next_ < known_); ++next)
      if (const std::optional<OpenStep> step = openTogether(next)) useTogether(next, *step);
    if (next == input_.count) return;
    const SharedSteps shared(input_, stepOptions(), ranks_, progress_);
    while (next < input_.count) next = runRound(shared, next);
  }

  /// open() at all ranks; nullopt if all have left the step out.
  std::optional<OpenStep> openTogether(uint64_t number) {
    std::optional<OpenStep> step;
    std::string reason = "not all ranks can read it";
    try {
      step = open(number);
    } catch (const Interrupted&) {
      throw;
    } catch (const UsageError&) {
      throw;
    } catch (const Error& error) {
      reason = error.what();
    }
    std::vector<uint64_t> failed{step ? 0u : 1u};
    ranks_.sum(std::span(failed));
    if (failed[0] == 0) return step;
    if (failed[0] < ranks_.count()) throw Error("{}", refusal(number, reason));
    leaveOut(number, reason);
    return std::nullopt;
  }

  /// Uses a step that cannot be left out: not all ranks may see why its conversion fails.
  void useTogether(uint64_t number, const OpenStep& step) {
    try {
      use(number, step);
    } catch (const Interrupted&) {
      throw;
    } catch (const UsageError&) {
      throw;
    } catch (const Error& error) {
      const char* const advice =
          "; ranks that have begun to convert the first step cannot leave it out: choose "
          "another with --steps, or convert in one process";
      throw Error("{}{}", whyNot(number, error.what()), options_.keep_going ? advice : "");
    }
  }

  /// Returns the number of the first step that is left for the next round.
  uint64_t runRound(const SharedSteps& shared, uint64_t next) {
    using Start = SharedSteps::Start;
    std::vector<Start> starts(1);
    if (ranks_.isFirst()) starts[0] = startOfRound(next);
    const Start start = fromBytes<Start>(ranks_.broadcast(toBytes(starts)))[0];
    const auto ranges = dealSteps(next, input_.count, start.in_group, ranks_.count());
    ConvertedSteps converted;
    if (ranks_.isFirst())
      for (; next < ranges[0].end; ++next) takeAfterOthers(next);
    else
      converted = shared.convertPart(start);
    const std::vector<Ranks::Bytes> sent = ranks_.gather(toBytes(converted));
    bool complete = true;
    for (unsigned rank = 1; rank < sent.size() && complete; ++rank) {
      const ConvertedSteps theirs = convertedFrom(sent[rank]);
      complete = shared.join(rank, ranges[rank], theirs, [&](uint64_t number, const AddStepReport& added) {
        note(number, added);
        next = number + 1;
      });
      if (!theirs.error.empty() && next == ranges[rank].begin + theirs.steps.size())
        failed_elsewhere_ = FailedElsewhere{next, rank, theirs.error};
    }
    std::vector<uint64_t> nexts{next};
    next = fromBytes<uint64_t>(ranks_.broadcast(toBytes(nexts)))[0];
    return next;
  }

  /// Converts, at rank 0, a step that another rank could not. If rank 0 can, something is wrong at that rank;
  /// if it cannot either, its own message says why.
  void takeAfterOthers(uint64_t number) {
    const size_t steps = times_.size();
    takeOrLeaveOut(number);
    if (failed_elsewhere_ && failed_elsewhere_->number == number && times_.size() > steps)
      printMessage("warning: rank {} could not convert step {} ({}): {}; rank 0 could",
                   failed_elsewhere_->rank, numberOf(number), input_.name(number), failed_elsewhere_->error);
    failed_elsewhere_.reset();
  }

  SharedSteps::Start startOfRound(uint64_t next) const {
    const CacheReader cache(options_.convert.output);
    const Series& series = cache.series();
    const uint64_t steps = series.steps.size();
    const uint64_t in_group = referenceSteps(series, series.steps.back().geometry, steps).size();
    return {steps - 1, expect_new_geometry_, next, in_group};
  }

  /// Whether there is a cache to go on with. Rank 0 looks, and clears what a killed conversion has left, before the others read it.
  bool hasCache() {
    const std::filesystem::path& output = options_.convert.output;
    std::vector<uint8_t> has(1);
    if (ranks_.isFirst()) {
      const auto is_cache = [&] {
        return std::filesystem::exists(output / "manifest.json") && !hasUnfinished(output);
      };
      has[0] = options_.add || (options_.convert.resume && is_cache());
      if (has[0] != 0) ConversionWorkspace::clearKilled(output);
    }
    return fromBytes<uint8_t>(ranks_.broadcast(toBytes(has)))[0] != 0;
  }

  void openCache() {
    const CacheReader cache(options_.convert.output);
    for (const SeriesStep& step : cache.series().steps) times_.push_back(step.time);
    for (const BlockInfo& block : cache.seriesManifest().blocks) names_.push_back(block.name);
    unit_ = {cache.seriesManifest().time_unit, cache.seriesManifest().calendar};
    const std::vector<std::string>& sources = cache.seriesManifest().sources;
    sources_.insert(sources.begin(), sources.end());
    first_files_ = sources_;
    sums_.nodes = cache.manifest().nodes;
    expect_new_geometry_ = cache.series().geometries() > 1 &&
                           cache.series().first_steps.back() == cache.series().steps.size() - 1;
  }

  /// How many of the steps to add, from the first on, an interrupted addition of the same steps has added. As rank 0 sees it.
  uint64_t stepsAddedBefore() {
    if (!options_.add) return 0;
    uint64_t number = 0;
    if (ranks_.isFirst() && options_.convert.resume)
      while (number < input_.count && isInCache(number)) ++number;
    number = fromBytes<uint64_t>(ranks_.broadcast(toBytes(std::vector{number})))[0];
    first_number_ = times_.size() - number;
    return number;
  }

  bool isInCache(uint64_t number) const {
    try {
      const std::unique_ptr<DataSource> source = input_.open(number);
      const GridDescription& description = source->description();
      const std::vector<std::string>& files = description.files;
      const std::optional<double> time = timeOf(description, unit_);
      return std::all_of(files.begin(), files.end(),
                         [&](const std::string& file) { return sources_.contains(file); }) &&
             (!time || std::find(times_.begin(), times_.end(), *time) != times_.end());
    } catch (const Error&) {
      return false;  // which is reported where it is to be added
    }
  }

  /// Throws Error if the step cannot be opened, is not the one that the cache has, or cannot be the first.
  OpenStep open(uint64_t number) const {
    progress_.throwIfStopped();
    OpenStep step{input_.open(number), options_.convert};
    const GridDescription& description = step.source->description();
    if (next_ < known_) {
      requireKnown(timeFor(number, description), description);
    } else if (times_.empty()) {
      step.first.scalars = input_.scalars(description);
      step.first.time = timeOf(description, unit_).value_or(0);
      if (!std::isfinite(*step.first.time))
        throw Error("its time is {}; expected a finite number", numberText(*step.first.time));
    }
    return step;
  }

  void requireKnown(double time, const GridDescription& description) const {
    for (const std::string& file : description.files)
      if (!sources_.contains(file))
        throw Error("the cache was not made from {}; to convert anew, add --overwrite", file);
    if (time != times_[next_])
      throw Error("its time {} is not {}, that of step {} of the cache; to convert anew, add --overwrite",
                  time, times_[next_], next_);
  }

  void use(uint64_t number, const OpenStep& step) {
    if (next_ < known_)
      ++next_;
    else if (times_.empty())
      convertFirst(number, step);
    else
      add(number, *step.source);
    noteOrigin(step.source->description());
  }

  /// Stated, or counted on from the step before, which is `places` away.
  double timeFor(uint64_t number, const GridDescription& description) const {
    const auto& places = input_.places;
    const uint64_t away = places.empty() || number == 0 ? 1 : places[number] - places[number - 1];
    const size_t before = next_ < known_ ? next_ : times_.size();
    const double last = before == 0 ? -1 : times_[before - 1];
    return timeOf(description, unit_).value_or(last + static_cast<double>(away));
  }

  void noteOrigin(const GridDescription& description) {
    if (!input_.places.empty())
      sums_.origins.push_back({timeOf(description, unit_).has_value(), description.files});
  }

  void convertFirst(uint64_t number, const OpenStep& step) {
    const ConvertOptions& options = step.first;
    if (options_.before_change) {
      checkReplaceable(options.output, options.overwrite);  // as convert() does: an error changes nothing
      options_.before_change();
    }
    const ConvertReport converted = convert(*step.source, options, progress_);
    for (const GridBlock& block : step.source->description().blocks) names_.push_back(block.name);
    first_files_.insert(step.source->description().files.begin(), step.source->description().files.end());
    times_.push_back(*options.time);
    unit_ = {step.source->description().time_unit, step.source->description().calendar};
    next_ = known_ = 1;
    sums_.nodes = converted.nodes;
    ++sums_.converted;
    if (ranks_.isFirst())
      report_event_({input_.name(number), nullptr, &converted, &step.source->description(), ""});
  }

  AddStepOptions stepOptions() const {
    const ConvertOptions& all = options_.convert;
    AddStepOptions options;
    options.cache = all.output;
    options.blank_value = all.blank_value;
    options.memory_bytes = all.memory_bytes;
    options.threads = all.threads;
    options.check_disk_space = all.check_disk_space;
    options.resume = all.resume;
    options.expect_new_geometry = expect_new_geometry_;
    options.temporary_folder = all.temporary_folder;
    options.given_folders = all.given_folders;
    options.limits = all.limits;
    options.to_part = options_.to_part;
    return options;
  }

  void add(uint64_t number, const DataSource& source) {
    AddStepOptions options = stepOptions();
    if (!times_.empty()) options.time = timeFor(number, source.description());
    if (options_.before_change) options_.before_change();
    note(number, addStep(source, options, progress_));
    sayNewNames(number, source.description());
  }

  /// Prints once which names differ from those in the first step, unless they differ only in the numbers of
  /// files' steps.
  void sayNewNames(uint64_t number, const GridDescription& description) {
    if (names_said_ || names_.size() != description.blocks.size()) return;
    const bool own_files = std::any_of(description.files.begin(), description.files.end(),
                                       [&](const std::string& file) { return !first_files_.contains(file); });
    const auto word = [&](std::string name) {
      if (own_files) std::erase_if(name, [](char c) { return c >= '0' && c <= '9'; });
      return name;
    };
    const std::vector<GridBlock>& blocks = description.blocks;
    const auto is_old = [&](const GridBlock& block) {
      return std::any_of(names_.begin(), names_.end(),
                         [&](const std::string& name) { return word(name) == word(block.name); });
    };
    const auto renamed = std::find_if_not(blocks.begin(), blocks.end(), is_old);
    if (renamed == blocks.end()) return;
    names_said_ = true;
    printMessage(
        "note: step {} ({}): block {} is called {}, in the first step {}; since names do not tell, blocks of "
        "equal sizes are taken in their order",
        numberOf(number), input_.name(number), renamed - blocks.begin() + 1, renamed->name,
        names_[static_cast<size_t>(renamed - blocks.begin())]);
  }

  void note(uint64_t number, const AddStepReport& added) {
    ++sums_.converted;
    times_.push_back(added.time);
    next_ = known_ = times_.size();
    expect_new_geometry_ = added.new_geometry;
    sums_.new_geometries += added.new_geometry;
    report_event_({input_.name(number), &added, nullptr, nullptr, ""});
  }

  void leaveOut(uint64_t number, const std::string& reason) {
    const std::string step = fmt::format("step {} ({})", numberOf(number), input_.name(number));
    if (!options_.keep_going) throw Error("{}", refusal(number, reason));
    ++sums_.left_out;
    if (ranks_.isFirst()) report_event_({step, nullptr, nullptr, nullptr, reason});
  }

  /// The number of a step in messages.
  uint64_t numberOf(uint64_t number) const {
    return input_.places.empty() ? first_number_ + number : input_.places[number];
  }

  std::string whyNot(uint64_t number, const std::string& reason) const {
    if (options_.is_kept) {
      const std::string file = input_.name(number) + ": ";
      if (number == 0) return reason;
      return fmt::format("{}cannot be a time step after {}: {}", file, input_.name(0),
                         reason.starts_with(file) ? reason.substr(file.size()) : reason);
    }
    std::string text =
        fmt::format("{}: step {} ({}) cannot be converted: {}", options_.convert.output.string(),
                    numberOf(number), input_.name(number), reason);
    if (!times_.empty()) text += fmt::format("; the cache has {}", countText(times_.size(), "step"));
    return text;
  }

  /// The message about a step that could be left out.
  std::string refusal(uint64_t number, const std::string& reason) const {
    const bool may_leave_out =
        !times_.empty() && input_.places.empty() && !options_.keep_going && !options_.is_kept;
    return whyNot(number, reason) + (may_leave_out ? "; --keep-going leaves out such steps" : "");
  }

  std::string whereItStands(const std::string& of_first) const {
    if (options_.is_kept) return "interrupted";
    if (times_.empty()) return of_first;
    return fmt::format("{}: interrupted after {}; continue with the same command and --resume",
                       options_.convert.output.string(), countText(times_.size(), "step"));
  }

  const SeriesInput& input_;
  const SeriesOptions& options_;
  Progress& progress_;
  const std::function<void(const SeriesEvent&)>& report_event_;
  Ranks& ranks_;
  std::vector<double> times_;       // of the cache's steps
  TimeUnit unit_;                   // of these
  std::set<std::string> sources_;   // of a cache that is there
  std::vector<std::string> names_;  // of the first step's blocks
  std::set<std::string> first_files_;
  bool names_said_ = false;
  uint64_t first_number_ = 0;  // of the input's first step in the cache
  uint64_t known_ = 0;         // steps of the cache that the input has to begin with
  uint64_t next_ = 0;          // of those, the next one
  std::optional<FailedElsewhere> failed_elsewhere_;
  bool expect_new_geometry_ = false;
  SeriesReport sums_;
};

}  // namespace

SeriesReport convertSeries(const SeriesInput& input, const SeriesOptions& options, Progress& progress,
                           const std::function<void(const SeriesEvent&)>& report) {
  const ConvertOptions& first = options.convert;
  RoomNeeded room{first.given_folders, "the cache and its temporary files", kFullDiskHint};
  if (room.folders.empty()) room.folders = {folderOf(first.output), temporaryFolder(first)};
  return room.during([&] { return SeriesConversion(input, options, progress, report).run(); });
}

}  // namespace curvisplat
