#include "preprocess/addition/convert_series.h"

#include <cmath>
#include <filesystem>
#include <set>

#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {
namespace {

class SeriesConversion {
 public:
  SeriesConversion(const SeriesInput& input, const SeriesOptions& options, Progress& progress,
                   const std::function<void(const SeriesEvent&)>& report)
      : input_(input), options_(options), progress_(progress), report_event_(report) {
    const std::filesystem::path& output = options.convert.output;
    const bool is_cache = std::filesystem::exists(output / "manifest.json") && !hasUnfinished(output);
    if (options.add || (options.convert.resume && is_cache)) openCache();
    if (!options.add) known_ = times_.size();
  }

  SeriesReport run() {
    for (uint64_t number = 0; number < input_.count; ++number) {
      try {
        take(number);
      } catch (const Interrupted& interrupted) {
        throw Interrupted(interrupted.signal(), whereItStands(interrupted.what()));
      } catch (const UsageError&) {
        throw;
      } catch (const Error& error) {
        leaveOut(number, error.what());
      }
    }
    if (times_.empty())
      throw Error("{}: none of the {} steps could be converted", options_.convert.output.string(),
                  input_.count);
    sums_.steps = times_.size();
    return sums_;
  }

 private:
  void openCache() {
    const CacheReader cache(options_.convert.output);
    for (const SeriesStep& step : cache.series().steps) times_.push_back(step.time);
    const std::vector<std::string>& sources = cache.seriesManifest().sources;
    sources_.insert(sources.begin(), sources.end());
    sums_.nodes = cache.manifest().nodes;
    expect_new_geometry_ = cache.series().geometries() > 1 &&
                           cache.series().first_steps.back() == cache.series().steps.size() - 1;
  }

  void take(uint64_t number) {
    progress_.throwIfStopped();
    const std::unique_ptr<DataSource> source = input_.open(number);
    if (next_ < known_) {
      const double last = next_ == 0 ? -1 : times_[next_ - 1];
      const double time = timeOf(source->description()).value_or(last + 1);
      for (const std::string& file : source->description().files)
        if (!sources_.contains(file))
          throw Error("the cache was not made from {}; to convert anew, add --overwrite", file);
      if (time == times_[next_]) {
        ++next_;
        return;
      }
      throw Error("its time {:g} is not {:g}, that of step {} of the cache; to convert anew, add --overwrite",
                  time, times_[next_], next_);
    }
    if (times_.empty())
      convertFirst(number, *source);
    else
      add(number, *source);
    ++sums_.converted;
  }

  void convertFirst(uint64_t number, const DataSource& source) {
    ConvertOptions options = options_.convert;
    options.scalars = input_.scalars(source.description());
    options.time = timeOf(source.description()).value_or(0);
    if (!std::isfinite(*options.time)) throw Error("its time is {:g}; expected a number", *options.time);
    const ConvertReport converted = convert(source, options, progress_);
    times_.push_back(*options.time);
    next_ = known_ = 1;
    sums_.nodes = converted.nodes;
    report_event_({input_.name(number), nullptr, &converted, &source.description(), ""});
  }

  void add(uint64_t number, const DataSource& source) {
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
    options.bucket_splats = all.bucket_splats;
    const AddStepReport added = addStep(source, options, progress_);
    times_.push_back(added.time);
    next_ = known_ = times_.size();
    expect_new_geometry_ = added.new_geometry;
    sums_.new_geometries += added.new_geometry;
    report_event_({input_.name(number), &added, nullptr, nullptr, ""});
  }

  void leaveOut(uint64_t number, const std::string& reason) {
    const std::string step = fmt::format("step {} ({})", input_.first_number + number, input_.name(number));
    if (!options_.keep_going)
      throw Error("{}: {} cannot be converted: {}{}", options_.convert.output.string(), step, reason,
                  times_.empty()
                      ? ""
                      : fmt::format("; the cache has the {} steps before it; --keep-going leaves out "
                                    "such steps",
                                    times_.size()));
    ++sums_.left_out;
    report_event_({step, nullptr, nullptr, nullptr, reason});
  }

  std::string whereItStands(const std::string& of_first) const {
    if (times_.empty()) return of_first;
    return fmt::format("{}: interrupted after {} steps; continue with the same command and --resume",
                       options_.convert.output.string(), times_.size());
  }

  const SeriesInput& input_;
  const SeriesOptions& options_;
  Progress& progress_;
  const std::function<void(const SeriesEvent&)>& report_event_;
  std::vector<double> times_;      // of the cache's steps
  std::set<std::string> sources_;  // of a cache that is there
  uint64_t known_ = 0;             // steps of the cache that the input has to begin with
  uint64_t next_ = 0;              // of those, the next one
  bool expect_new_geometry_ = false;
  SeriesReport sums_;
};

}  // namespace

SeriesReport convertSeries(const SeriesInput& input, const SeriesOptions& options, Progress& progress,
                           const std::function<void(const SeriesEvent&)>& report) {
  return SeriesConversion(input, options, progress, report).run();
}

}  // namespace curvisplat
