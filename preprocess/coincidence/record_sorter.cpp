#include "preprocess/coincidence/record_sorter.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <queue>
#include <span>
#include <utility>

#include "stream/base/memory.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxReadBytes = 1 << 20;  // of a run at a time
constexpr size_t kFirstRead = 16;            // records: a visit may end soon
constexpr size_t kSamplesOfRun = 64;
constexpr size_t kWriteSize = 32 << 10;  // doubles
constexpr size_t kRecordsAhead = 12;     // to prefetch
constexpr size_t kEntriesOfBucket = 8;  // on average; a bucket takes a size_t, so an entry takes another byte
constexpr size_t kFewEntries = 1024;    // sorted without buckets
constexpr size_t kCacheLineDoubles = 8;
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

void prefetch(const double* record, size_t size) {
  for (size_t n = 0; n < size; n += kCacheLineDoubles) __builtin_prefetch(record + n);
  __builtin_prefetch(record + size - 1);
}

/// Reads a part of a run from the file, a buffer of whole records at a time, the first of them short.
class RunReader {
 public:
  RunReader(const InputFile& file, uint64_t begin, uint64_t end, size_t record_size, size_t buffer_records)
      : file_(&file),
        next_(begin),
        end_(end),
        record_size_(record_size),
        size_(std::min<uint64_t>(buffer_records * record_size, (end - begin) / sizeof(double))),
        to_read_(kFirstRead * record_size),
        buffer_(std::make_unique_for_overwrite<double[]>(size_)) {
    fill();
  }

  bool done() const { return filled_ == 0; }
  const double* record() const { return buffer_.get() + at_; }
  void advance() {
    at_ += record_size_;
    if (at_ == filled_) fill();
  }

 private:
  void fill() {
    at_ = 0;
    filled_ =
        static_cast<size_t>(std::min<uint64_t>(std::min(size_, to_read_), (end_ - next_) / sizeof(double)));
    file_->readAt(next_, std::span(buffer_.get(), filled_));
    next_ += filled_ * sizeof(double);
    to_read_ = std::min(4 * to_read_, size_);
  }

  const InputFile* file_;
  uint64_t next_, end_;                  // bytes of the file
  size_t record_size_, size_, to_read_;  // in doubles
  std::unique_ptr<double[]> buffer_;
  size_t at_ = 0, filled_ = 0;
};

}  // namespace

RecordSorter::RecordSorter(size_t record_size, uint64_t memory_bytes, std::filesystem::path temporary_folder)
    : record_size_(record_size),
      memory_bytes_(memory_bytes),
      half_(std::max<uint64_t>(1, memory_bytes / (record_size * sizeof(double) + 2 * sizeof(Entry) + 1) / 2)),
      folder_(std::move(temporary_folder)) {}

void RecordSorter::takeMemory() {
  if (records_) return;
  // All at once: growing would hold the old and the new. Pages that are never touched cost nothing.
  halves_[0].entries.reserve(2 * half_);  // all, if they stay in memory
  halves_[1].entries.reserve(half_);
  halves_[1].first = half_;
  records_ = std::make_unique_for_overwrite<double[]>(2 * half_ * record_size_);
  preferHugePages(records_.get(), 2 * half_ * record_size_ * sizeof(double));
}

/// Takes as many records as there is space for. Returns how many doubles these are.
size_t RecordSorter::fill(Half& half, std::span<const double> records) {
  const size_t room = (half_ - half.entries.size()) * record_size_;
  records = records.first(std::min(room, records.size()));
  size_t place = half.first + half.entries.size();
  std::copy(records.begin(), records.end(), records_.get() + place * record_size_);
  for (size_t n = 0; n < records.size(); n += record_size_)
    half.entries.push_back({alongOf(&records[n]), place++});
  return records.size();
}

void RecordSorter::add(std::span<const double> records) {
  if (records.empty()) return;
  MutexLock lock(mutex_);
  takeMemory();
  while (!records.empty()) {
    Half &half = halves_[filling_], &other = halves_[1 - filling_];
    if (half.entries.size() < half_) {
      records = records.subspan(fill(half, records));
    } else if (other.is_being_written) {
      const TraceScope trace("wait for a run", TraceKind::kWait);
      changed_.wait(lock);
    } else if (runs_.empty() && other.entries.empty()) {
      filling_ = 1 - filling_;  // nothing is written before all of the memory is full
    } else {
      Half& full = other.entries.empty() ? half : other;
      if (&full == &half) filling_ = 1 - filling_;
      full.is_being_written = true;
      lock.unlock();
      std::exception_ptr error;
      Run run;
      try {
        run = write(full);
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      full.is_being_written = false;
      full.entries.clear();
      changed_.notify_all();
      if (error) std::rethrow_exception(error);
      runs_.push_back(run);
    }
  }
}

/// Distributes entries over buckets of equal width, then sorts each bucket: quick where positions are spread
/// more or less evenly.
void RecordSorter::sortEntries(Half& half) const {
  std::vector<Entry>&entries = half.entries, &sorted = half.sorted;
  const auto is_before = [this](const Entry& a, const Entry& b) { return isBefore(a, b); };
  if (entries.size() < kFewEntries) return std::sort(entries.begin(), entries.end(), is_before);
  const auto [least, most] = std::minmax_element(
      entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.along < b.along; });
  const double lower = least->along, width = most->along - lower;
  const auto buckets = static_cast<uint32_t>(std::min<size_t>(entries.size() / kEntriesOfBucket, 1u << 24));
  const double scale = buckets / width;
  if (!(std::isfinite(width) && scale < 1e300)) return std::sort(entries.begin(), entries.end(), is_before);
  const auto bucketOf = [&](const Entry& entry) {
    return std::min(static_cast<uint32_t>((entry.along - lower) * scale), buckets - 1);
  };
  std::vector<size_t> begins(buckets + size_t{1});
  for (const Entry& entry : entries) ++begins[bucketOf(entry) + size_t{1}];
  for (size_t n = 1; n < begins.size(); ++n) begins[n] += begins[n - 1];
  sorted.reserve(entries.capacity());
  sorted.resize(entries.size());
  for (const Entry& entry : entries) sorted[begins[bucketOf(entry)]++] = entry;
  size_t begin = 0;
  for (uint32_t bucket = 0; bucket < buckets; ++bucket) {
    const size_t end = begins[bucket];
    std::sort(sorted.begin() + static_cast<ptrdiff_t>(begin), sorted.begin() + static_cast<ptrdiff_t>(end),
              is_before);
    begin = end;
  }
  entries.swap(sorted);
}

void RecordSorter::visitInMemory(const std::vector<Entry>& entries, double from, double to,
                                 const VisitOrStop& visit) const {
  const auto placeOf = [&](double along) {
    return static_cast<size_t>(std::ranges::lower_bound(entries, along, {}, &Entry::along) - entries.begin());
  };
  const size_t end = to < kUnbounded ? placeOf(to) : entries.size();
  for (size_t n = from > -kUnbounded ? placeOf(from) : 0; n < end; ++n) {
    if (n + kRecordsAhead < end) prefetch(record(entries[n + kRecordsAhead]), record_size_);
    if (!visit(record(entries[n]))) return;
  }
}

/// Sorts a half and writes it as a run.
RecordSorter::Run RecordSorter::write(Half& half) {
  const TraceScope trace("write a run");
  if (!file_) file_ = std::make_unique<NamelessFile>(folder_);
  OutputFile& out = file_->out();
  const uint64_t begin = out.size();
  std::vector<double> block;
  sortEntries(half);
  visitInMemory(half.entries, -kUnbounded, kUnbounded, [&](const double* record) {
    block.insert(block.end(), record, record + record_size_);
    if (block.size() < kWriteSize) return true;
    out.append(std::span<const double>(block));
    block.clear();
    return true;
  });
  out.append(std::span<const double>(block));
  return {begin, out.size()};
}

void RecordSorter::drain(const Visit& visit_one) {
  sort();
  visit(-kUnbounded, kUnbounded, [&](const double* record) {
    visit_one(record);
    return true;
  });
  forget();
}

void RecordSorter::sort(unsigned visitors) {
  visitors_ = visitors;
  if (runs_.empty()) {
    Half &all = halves_[0], &rest = halves_[1];
    all.entries.insert(all.entries.end(), rest.entries.begin(), rest.entries.end());
    rest.entries = std::vector<Entry>();
    return sortEntries(all);
  }
  for (Half& half : halves_)
    if (!half.entries.empty()) runs_.push_back(write(half));
  forgetMemory();
}

void RecordSorter::forget() {
  forgetMemory();
  runs_.clear();
  file_.reset();
}

void RecordSorter::forgetMemory() {
  halves_ = {};
  filling_ = 0;
  records_.reset();
}

void RecordSorter::visit(double from, double to, const VisitOrStop& visit) const {
  if (runs_.empty())
    visitInMemory(halves_[0].entries, from, to, visit);
  else
    visitRuns(from, to, visit);
}

double RecordSorter::alongAt(const Run& run, uint64_t record) const {
  double along;
  file_->in().readAt(run.begin + record * record_size_ * sizeof(double), std::span(&along, 1));
  return along;
}

RecordSorter::Run RecordSorter::partOf(const Run& run, double from, double to) const {
  const auto at = [&](double along) {
    uint64_t low = 0, high = recordsOf(run);
    while (low < high) {
      const uint64_t middle = (low + high) / 2;
      if (alongAt(run, middle) < along)
        low = middle + 1;
      else
        high = middle;
    }
    return run.begin + low * record_size_ * sizeof(double);
  };
  return {from > -kUnbounded ? at(from) : run.begin, to < kUnbounded ? at(to) : run.end};
}

void RecordSorter::visitRuns(double from, double to, const VisitOrStop& visit) const {
  const size_t buffer_bytes = std::min(kMaxReadBytes, memory_bytes_ / runs_.size() / visitors_);
  const size_t buffer_records = std::max<uint64_t>(1, buffer_bytes / (record_size_ * sizeof(double)));
  std::vector<RunReader> readers;
  for (const Run& run : runs_) {
    const Run part = partOf(run, from, to);
    readers.emplace_back(file_->in(), part.begin, part.end, record_size_, buffer_records);
  }

  struct Head {
    double along;
    uint64_t number;
    size_t run;
  };
  const auto later = [](const Head& a, const Head& b) {
    return a.along != b.along ? a.along > b.along : a.number > b.number;
  };
  std::priority_queue<Head, std::vector<Head>, decltype(later)> heads(later);
  const auto push_head = [&](size_t run) {
    if (readers[run].done()) return;
    const double* record = readers[run].record();
    heads.push({alongOf(record), numberOf(record), run});
  };
  for (size_t run = 0; run < readers.size(); ++run) push_head(run);
  while (!heads.empty()) {
    const size_t run = heads.top().run;
    heads.pop();
    if (!visit(readers[run].record())) return;
    readers[run].advance();
    push_head(run);
  }
}

std::vector<double> RecordSorter::cutsInto(size_t parts) const {
  std::vector<double> sample;
  const auto add = [&](uint64_t records, const auto& along_at) {
    const uint64_t step = std::max<uint64_t>(1, records / kSamplesOfRun);
    for (uint64_t n = step / 2; n < records; n += step) sample.push_back(along_at(n));
  };
  const std::vector<Entry>& in_memory = halves_[0].entries;
  if (runs_.empty()) add(in_memory.size(), [&](uint64_t n) { return in_memory[n].along; });
  for (const Run& run : runs_) add(recordsOf(run), [&](uint64_t n) { return alongAt(run, n); });
  std::sort(sample.begin(), sample.end());
  std::vector<double> cuts;
  for (size_t n = 1; n < parts && parts <= sample.size(); ++n)
    cuts.push_back(sample[n * sample.size() / parts]);
  return cuts;
}

}  // namespace curvisplat
