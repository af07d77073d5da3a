#include "render/sweep/sweep_buffer.h"

#include <algorithm>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

// The place of the slab's end when space is short: behind this many eighths of the buffer's pages, when the
// slab first gets an end and when the end moves nearer.
constexpr size_t kFirstEighths = 6, kNextEighths = 7;
// Space is made for the part that needs it, and for one page in kSpareShare of the buffer in addition.
constexpr size_t kSpareShare = 16;
// Keys sampled from each run; they decide where a batch ends.
constexpr size_t kSamplesABatch = 16;

size_t pagesFor(size_t splats) {
  return (splats + SweepBuffer::kPageSplats - 1) / SweepBuffer::kPageSplats;
}

/// How many of a part's sorted splats lie before a position.
size_t countBefore(const SweepPosition& mark, uint32_t brick, std::span<const DepthItem> sorted) {
  size_t low = 0, high = sorted.size();
  while (low < high) {
    const size_t middle = (low + high) / 2;
    if (SweepPosition{sorted[middle].key, brick, static_cast<uint32_t>(middle)} < mark)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

/// The position behind all splats with the same key. A slab ends there where it can: which of a part's splats
/// another rank sends may differ from slab to slab, and so their numbers among those with equal keys.
SweepPosition behindKey(const SweepPosition& position) {
  return {position.key + 1, 0, 0};
}

}  // namespace

void copySplats(std::span<const DepthItem> items, const ScreenSplat* from, ScreenSplat* to) {
  constexpr size_t kAhead = 12;  // they come from anywhere in the brick, or the buffer
  for (size_t n = 0; n < items.size(); ++n) {
    if (n + kAhead < items.size()) __builtin_prefetch(from + items[n + kAhead].splat);
    to[n] = from[items[n].splat];
  }
}

SweepBuffer::SweepBuffer(size_t splats, size_t batch_splats)
    : batch_splats_(std::min(batch_splats, kMaxBatch)),
      splats_(std::make_unique_for_overwrite<ScreenSplat[]>(splats / kPageSplats * kPageSplats)),
      keys_(std::make_unique_for_overwrite<uint32_t[]>(splats / kPageSplats * kPageSplats)),
      left_(splats / kPageSplats) {
  CURVISPLAT_CHECK_OP(pages(), >=, 4u);
  CURVISPLAT_CHECK_OP(batch_splats_, >, 0u);
  beginFrame();
}

void SweepBuffer::beginFrame() {
  const MutexLock lock(mutex_);
  std::fill(left_.begin(), left_.end(), uint16_t{0});
  free_.clear();
  for (size_t page = pages(); page-- > 0;) free_.push_back(static_cast<uint32_t>(page));
  swept_ = {};
  parts_.clear();
  entered_whole_.clear();
  live_.clear();
  splits_.clear();
  turn_ = batches_ = under_way_ = filling_ = slabs_ = 0;
  peak_pages_ = 0;
  begin_ = end_ = {};
  closed_ = false;
}

void SweepBuffer::beginRegion(std::span<const uint8_t> left_out) {
  const MutexLock lock(mutex_);
  CURVISPLAT_CHECK(closed_ || isQuiet());
  entered_whole_.assign(left_out.begin(), left_out.end());
  begin_ = end_ = {};
}

bool SweepBuffer::beginSlab(std::span<const SweptPart> swept) {
  const MutexLock lock(mutex_);
  CURVISPLAT_CHECK(closed_ || isQuiet());
  if (closed_ || end_ == kSweepEnd) return false;
  begin_ = end_;
  end_ = kSweepEnd;
  swept_ = swept;
  entered_whole_.resize(swept.size());
  parts_.clear();
  for (uint32_t n = 0; n < swept.size(); ++n)
    if (!entered_whole_[n] && swept[n].end() >= begin_) parts_.push_back(n);
  turn_ = 0;
  mark_ = parts_.empty() ? kSweepEnd : std::max(begin_, swept_[parts_[0]].begin());
  entered_ = 0;
  worth_counting_ = parts_.empty();
  ++slabs_;
  return true;
}

bool SweepBuffer::isBehind(const SweptPart& part) const {
  const MutexLock lock(mutex_);
  return part.begin() >= end_;
}

bool SweepBuffer::awaitTurn(uint64_t sequence) {
  MutexLock lock(mutex_);
  while (!closed_ && turn_ != sequence) turnOf(sequence).wait(lock);
  return !closed_;
}

void SweepBuffer::skip() {
  const MutexLock lock(mutex_);
  endTurn();
}

void SweepBuffer::endTurn() {
  ++turn_;
  mark_ = turn_ < parts_.size() ? std::min(std::max(begin_, swept_[parts_[turn_]].begin()), end_) : end_;
  worth_counting_ |= entered_ >= batch_splats_ / 2 || turn_ == parts_.size();
  turnOf(turn_).notify_all();
  if (worth_counting_) batch_.notify_all();
}

std::shared_ptr<SweepBuffer::Run> SweepBuffer::enter(uint32_t brick, std::span<const DepthItem> sorted) {
  const MutexLock lock(mutex_);
  if (closed_) return {};
  const TraceScope trace("enter sweep");
  const size_t before = countBefore(begin_, brick, sorted);
  const size_t before_end = std::max(before, countBefore(end_, brick, sorted));
  size_t after = sorted.size();
  if (pagesFor(after - before) > free_.size()) after = before_end;
  const size_t needed = pagesFor(after - before);
  if (needed > free_.size()) return {};
  auto run = std::make_shared<Run>();
  run->part = parts_[turn_];
  run->brick = brick;
  run->before = static_cast<uint32_t>(before);
  run->count = after - before;
  entered_whole_[run->part] = after == sorted.size();
  for (size_t page = 0; page < needed; ++page) {
    run->pages.push_back(free_.back());
    left_[free_.back()] = static_cast<uint16_t>(std::min(kPageSplats, run->count - page * kPageSplats));
    free_.pop_back();
  }
  for (size_t n = 0; n < run->count; ++n) keys_[run->slot(n)] = sorted[before + n].key;
  if (run->count > 0) {
    const auto place =
        std::upper_bound(live_.begin(), live_.end(), brick,
                         [](uint32_t of_new, const auto& other) { return of_new < other->brick; });
    live_.insert(place, run);
  }
  ++filling_;
  entered_ += run->count;
  peak_pages_ = std::max(peak_pages_, used());
  endTurn();
  return run;
}

bool SweepBuffer::awaitSpace(uint32_t brick, std::span<const DepthItem> sorted) {
  MutexLock lock(mutex_);
  if (!closed_ && isQuiet()) {
    // Splats may have become final meanwhile: then a batch can leave, and no space need be made.
    if (splits_.empty() && countFinals() == 0) makeSpace(brick, sorted);
  } else {
    const size_t before = free_.size();
    while (!closed_ && free_.size() <= before && !isQuiet()) space_.wait(lock);
  }
  return !closed_;
}

void SweepBuffer::fill(Run& run, std::span<const DepthItem> sorted, std::span<const ScreenSplat> splats) {
  const std::span<const DepthItem> entered = sorted.subspan(run.before, run.count);
  for (size_t page = 0; page < run.pages.size(); ++page) {
    const size_t first = page * kPageSplats, last = std::min(first + kPageSplats, run.count);
    copySplats(entered.subspan(first, last - first), splats.data(), &splats_[run.slot(first)]);
  }
  const MutexLock lock(mutex_);
  run.filled = true;
  --filling_;
  filled_.notify_all();
  space_.notify_all();
}

std::optional<SweepBuffer::Batch> SweepBuffer::next() {
  const MutexLock lock(mutex_);
  const TraceScope trace("cut batch");
  return cut(batch_splats_);
}

std::optional<SweepBuffer::Batch> SweepBuffer::awaitNext() {
  MutexLock lock(mutex_);
  while (!closed_) {
    const bool all_in = turn_ == parts_.size();
    if (auto batch = cut(all_in ? 1 : batch_splats_)) return batch;
    if (all_in) break;
    batch_.wait(lock);
  }
  return {};
}

std::optional<SweepBuffer::Batch> SweepBuffer::nextFinal() {
  const MutexLock lock(mutex_);
  if (!isQuiet()) return {};
  worth_counting_ = true;
  return cut(1);
}

SweepPosition SweepBuffer::position(const Run& run, size_t n) const {
  return {keys_[run.slot(n)], run.brick, run.before + static_cast<uint32_t>(n)};
}

/// Searches from the run's first splat on with growing steps: fast if the mark is close to it.
size_t SweepBuffer::firstNotBefore(const Run& run, const SweepPosition& mark) const {
  size_t low = run.first, step = 1;  // what lies before `low` lies before the mark
  while (low + step <= run.count && position(run, low + step - 1) < mark) {
    low += step;
    step *= 2;
  }
  size_t high = std::min(low + step - 1, run.count);
  while (low < high) {
    const size_t middle = (low + high) / 2;
    if (position(run, middle) < mark)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

size_t SweepBuffer::countFinals() {
  size_t finals = 0;
  for (const auto& run : live_) {
    run->final_to = firstNotBefore(*run, mark_);
    finals += run->final_to - run->first;
  }
  return finals;
}

/// Takes the next batch out of the live runs. Returns nullopt if fewer than `at_least` splats are final.
std::optional<SweepBuffer::Batch> SweepBuffer::cut(size_t at_least) {
  if (closed_) return {};
  if (splits_.empty()) {
    if (!worth_counting_) return {};
    const size_t finals = countFinals();
    if (finals < at_least) {
      worth_counting_ = turn_ == parts_.size();
      entered_ = 0;
      return {};
    }
    splitFinals(finals, at_least > 1);
    split_turn_ = turn_;
  }
  const SweepPosition end = splits_.front();
  splits_.pop_front();
  Batch batch;
  for (const auto& run : live_) {
    const size_t to = firstNotBefore(*run, end);
    if (to == run->first) continue;
    batch.pieces.push_back({run, run->first, to});
    batch.count += to - run->first;
    run->first = to;
  }
  std::erase_if(live_, [](const auto& run) { return run->first == run->count; });
  CURVISPLAT_CHECK_OP(batch.count, <=, batch_splats_);
  batch.sequence = batches_++;
  batch.turn = split_turn_;
  ++under_way_;
  if (!splits_.empty()) batch_.notify_one();
  return batch;
}

/// Sets the ends of batches of at most batch_splats_ splats; the last end is the mark. They are chosen from
/// a sorted sample of every stride-th splat of every run: between two neighbours in the sample lie at most
/// `stride` splats of each run. So all batches but the last have most of that; the last may stay, to grow.
void SweepBuffer::splitFinals(size_t finals, bool last_may_stay) {
  if (finals > batch_splats_) {
    const size_t stride = std::max<size_t>(1, batch_splats_ / (kSamplesABatch * live_.size()));
    const size_t samples = stride == 1 ? batch_splats_ : batch_splats_ / stride - live_.size();
    std::vector<SweepPosition> sample;
    for (const auto& run : live_)
      for (size_t n = run->first; n < run->final_to; n += stride) sample.push_back(position(*run, n));
    std::sort(sample.begin(), sample.end());
    for (size_t n = samples; n < sample.size(); n += samples) splits_.push_back(sample[n]);
  }
  if (splits_.empty() || !last_may_stay) splits_.push_back(mark_);
}

/// Makes space for those splats of the part to be entered that lie before the slab's end. Requires that
/// nothing in the buffer is final: all splats are in live runs, and no batch is being sorted.
void SweepBuffer::makeSpace(uint32_t brick, std::span<const DepthItem> sorted) {
  if (end_ == kSweepEnd) end_ = behindKey(pageStart(kFirstEighths, brick, sorted));
  std::vector<std::pair<size_t, Run*>> behind;  // splats
  for (const auto& run : live_)
    if (const size_t count = run->count - firstNotBefore(*run, end_); count > 0)
      behind.emplace_back(count, run.get());
  std::sort(behind.begin(), behind.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second->brick < b.second->brick;
  });
  for (const auto& [count, run] : behind) {
    if (free_.size() >= pagesNeeded(brick, sorted) + pages() / kSpareShare) break;
    forgetBehindEnd(*run);
  }
  if (free_.size() < pagesNeeded(brick, sorted)) {
    const SweepPosition nearer = pageStart(kNextEighths, brick, sorted);
    end_ = behindKey(nearer) < end_ ? behindKey(nearer) : nearer;
    for (const auto& run : live_) forgetBehindEnd(*run);
  }
  mark_ = std::min(mark_, end_);
  std::erase_if(live_, [](const auto& run) { return run->first == run->count; });
}

/// The pages for those splats of a part that lie in the slab.
size_t SweepBuffer::pagesNeeded(uint32_t brick, std::span<const DepthItem> sorted) const {
  const size_t before = countBefore(begin_, brick, sorted);
  return pagesFor(std::max(before, countBefore(end_, brick, sorted)) - before);
}

/// The position at which a slab's end leaves `eighths` eighths of the buffer's pages before it. Pages are
/// ordered by the positions of their first splats, and include those that the part to be entered would take.
SweepPosition SweepBuffer::pageStart(size_t eighths, uint32_t brick,
                                     std::span<const DepthItem> sorted) const {
  std::vector<SweepPosition> starts;
  for (const auto& run : live_)
    for (size_t n = run->first; n < run->count; n = (n / kPageSplats + 1) * kPageSplats)
      starts.push_back(position(*run, n));
  const size_t before = countBefore(begin_, brick, sorted);
  const size_t before_end = std::max(before, countBefore(end_, brick, sorted));
  for (size_t n = before; n < before_end; n += kPageSplats)
    starts.push_back({sorted[n].key, brick, static_cast<uint32_t>(n)});
  const auto page =
      starts.begin() + static_cast<ptrdiff_t>(std::min(pages() * eighths / 8, starts.size() - 1));
  std::nth_element(starts.begin(), page, starts.end());
  return *page;
}

void SweepBuffer::forgetBehindEnd(Run& run) {
  const size_t count = firstNotBefore(run, end_);
  if (count == run.count) return;
  release(run, count, run.count);
  run.count = count;
  entered_whole_[run.part] = 0;
}

/// Frees the run's splats from .. to - 1, which are not needed any more.
void SweepBuffer::release(const Run& run, size_t from, size_t to) {
  while (from < to) {
    const size_t end = std::min((from / kPageSplats + 1) * kPageSplats, to);
    const uint32_t page = run.pages[from / kPageSplats];
    left_[page] = static_cast<uint16_t>(left_[page] - (end - from));
    if (left_[page] == 0) free_.push_back(page);
    from = end;
  }
}

bool SweepBuffer::awaitFilled(const Batch& batch) {
  MutexLock lock(mutex_);
  const auto all_filled = [&] {
    return std::all_of(batch.pieces.begin(), batch.pieces.end(),
                       [](const Piece& piece) { return piece.run->filled; });
  };
  while (!closed_ && !all_filled()) filled_.wait(lock);
  return !closed_;
}

void SweepBuffer::itemsOf(const Batch& batch, std::span<DepthItem> items) const {
  CURVISPLAT_CHECK_OP(items.size(), ==, batch.count);
  size_t item = 0;
  for (const Piece& piece : batch.pieces)
    for (size_t n = piece.from; n < piece.to;) {
      const size_t end = std::min((n / kPageSplats + 1) * kPageSplats, piece.to);
      for (size_t slot = piece.run->slot(n); n < end; ++n, ++slot)
        items[item++] = {keys_[slot], static_cast<uint32_t>(slot)};
    }
}

void SweepBuffer::copy(std::span<const DepthItem> items, std::span<ScreenSplat> to) const {
  CURVISPLAT_CHECK_OP(items.size(), ==, to.size());
  copySplats(items, splats_.get(), to.data());
}

void SweepBuffer::giveBack(const Batch& batch) {
  const MutexLock lock(mutex_);
  for (const Piece& piece : batch.pieces) release(*piece.run, piece.from, piece.to);
  --under_way_;
  space_.notify_all();
}

uint64_t SweepBuffer::batches() const {
  const MutexLock lock(mutex_);
  return batches_;
}

uint64_t SweepBuffer::slabs() const {
  const MutexLock lock(mutex_);
  return slabs_;
}

size_t SweepBuffer::peakSplats() const {
  const MutexLock lock(mutex_);
  return peak_pages_ * kPageSplats;
}

void SweepBuffer::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  for (ConditionVariable& turn : turns_) turn.notify_all();
  for (ConditionVariable* other : {&batch_, &filled_, &space_}) other->notify_all();
}

}  // namespace curvisplat
