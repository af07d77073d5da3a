#include "render/ranks/splat_exchange.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "render/project/footprint.h"
#include "render/ranks/picture_shares.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// How far ahead of what has arrived parts are looked at that may be cancelled.
constexpr uint64_t kCancelAhead = 1024;
// Boxes of more tiles are compared with the ranks' rectangles instead.
constexpr size_t kMaxTiles = 16;

/// The message of a rank to the others when a slab begins; then comes a bit for each part, of those that it
/// needs.
struct RequestHeader {
  TileBox tiles;
  int32_t has_slab = 0;
};
/// The message of a rank to another before splats are sent; then come the cancelled parts, then the offers.
struct OfferHeader {
  uint64_t left = 0;       // parts that the sender still waits for
  uint32_t cancelled = 0;  // numbers
  uint32_t offers = 0;
};
struct Offer {
  uint32_t part, count;
};
struct MessageHeader {
  uint32_t part, count;
};

template <typename T>
void put(Ranks::Bytes& to, const T* values, size_t count) {
  const auto* const bytes = reinterpret_cast<const std::byte*>(values);
  to.insert(to.end(), bytes, bytes + count * sizeof(T));
}

template <typename T>
void get(std::span<const std::byte> from, size_t& at, T* values, size_t count) {
  CURVISPLAT_CHECK_OP(at + count * sizeof(T), <=, from.size());
  if (count > 0) std::memcpy(values, from.data() + at, count * sizeof(T));
  at += count * sizeof(T);
}

std::vector<uint8_t> bitsOf(const std::vector<uint32_t>& numbers, size_t count) {
  std::vector<uint8_t> bits((count + 7) / 8);
  for (const uint32_t number : numbers) bits[number / 8] |= static_cast<uint8_t>(1u << number % 8);
  return bits;
}

/// Whether a rank has said in its request that it needs the part.
bool needs(const Ranks::Bytes& request, uint32_t part) {
  return (std::to_integer<unsigned>(request[sizeof(RequestHeader) + part / 8]) >> part % 8 & 1) != 0;
}

}  // namespace

SplatExchange::SplatExchange(Ranks& ranks, const SharedParts& shared, uint64_t buffer_bytes)
    : ranks_(ranks),
      shared_(shared),
      buffer_bytes_(buffer_bytes),
      columns_(TileSet::tilesAlong(shared.size.width, kSharedTileSide)),
      rows_(TileSet::tilesAlong(shared.size.height, kSharedTileSide)),
      boxes_(ranks.count()),
      sending_(buffer_bytes),
      received_(buffer_bytes) {}

bool SplatExchange::beginSlab(std::optional<Request> request) {
  const RequestHeader header{request ? request->tiles : TileBox{0, 0, 0, 0}, request.has_value()};
  needed_ = request ? std::move(request->parts) : std::vector<uint32_t>();
  arrived_.assign(needed_.size(), {});
  available_ = next_received_ = 0;
  Ranks::Bytes message;
  put(message, &header, 1);
  const std::vector<uint8_t> bits = bitsOf(needed_, shared_.parts.size());
  put(message, bits.data(), bits.size());
  const std::vector<Ranks::Bytes> all = ranks_.exchange(std::vector<Ranks::Bytes>(ranks_.count(), message));

  bool any = false;
  painters_.assign(static_cast<size_t>(columns_) * static_cast<size_t>(rows_), kNobody);
  for (uint32_t rank = 0; rank < ranks_.count(); ++rank) {
    size_t at = 0;
    RequestHeader of_rank;
    get(all[rank], at, &of_rank, 1);
    CURVISPLAT_CHECK_OP(all[rank].size(), ==, at + bits.size());
    any |= of_rank.has_slab != 0;
    const TileBox& box = boxes_[rank] = of_rank.tiles;
    for (int y = box.y0; y < box.y1; ++y)
      for (int x = box.x0; x < box.x1; ++x) painters_[static_cast<size_t>(y * columns_ + x)] = rank;
  }
  all_painted_ = std::find(painters_.begin(), painters_.end(), kNobody) == painters_.end();
  own_.clear();
  index_of_brick_.clear();
  prepared_.clear();
  beginRounds(all);
  for (uint32_t part = 0; part < shared_.parts.size(); ++part) {
    if (shared_.preparers[part] != ranks_.rank()) continue;
    Prepared prepared;
    for (uint32_t rank = 0; rank < ranks_.count(); ++rank)
      if (needs(all[rank], part)) prepared.receivers.push_back({rank, 0, 0, false, false});
    if (prepared.receivers.empty()) continue;
    index_of_brick_[shared_.parts[part].part.brick] = static_cast<uint32_t>(own_.size());
    own_.push_back(part);
    prepared_.push_back(std::move(prepared));
  }
  wanted_by_ = std::make_unique<std::atomic<uint32_t>[]>(own_.size());
  for (size_t n = 0; n < own_.size(); ++n)
    wanted_by_[n] = static_cast<uint32_t>(prepared_[n].receivers.size());
  kept_.clear();
  first_open_ = 0;
  offered_bytes_ = 0;
  const MutexLock lock(mutex_);
  next_own_ = 0;
  prepared_bytes_ = 0;
  return any;
}

/// Begins the rounds of the parts that any rank needs. `requests`: of all ranks.
void SplatExchange::beginRounds(const std::vector<Ranks::Bytes>& requests) {
  std::vector<uint32_t> needed;
  for (uint32_t part = 0; part < shared_.parts.size(); ++part)
    if (std::any_of(requests.begin(), requests.end(),
                    [&](const Ranks::Bytes& request) { return needs(request, part); }))
      needed.push_back(part);
  round_ends_.clear();
  for (const size_t end : roundEnds(needed.size(), ranks_.count()))
    round_ends_.push_back(needed[end - 1] + 1);
  round_ = 0;
  steps_ = 0;
}

// ---------------------------------------------------------------------------------------------- preparing

std::optional<size_t> SplatExchange::nextToPrepare() {
  const MutexLock lock(mutex_);
  if (next_own_ == own_.size() || own_[next_own_] >= round_ends_[round_]) return {};
  const uint64_t most = shared_.elements * kPreparedBytes;
  if (prepared_bytes_ > 0 && prepared_bytes_ + most > buffer_bytes_) return {};
  prepared_bytes_ += most;
  return next_own_++;
}

bool SplatExchange::isUnneeded(uint32_t brick) const {
  const auto found = index_of_brick_.find(brick);
  return found != index_of_brick_.end() && wanted_by_[found->second] == 0;
}

void SplatExchange::skip(size_t index) {
  Prepared& part = prepared_[index];
  for (const Receiver& receiver : part.receivers) CURVISPLAT_CHECK(receiver.done);
  part.ready = true;
  const MutexLock lock(mutex_);
  prepared_bytes_ -= shared_.elements * kPreparedBytes;
}

void SplatExchange::submit(size_t index, std::span<const ScreenSplat> splats,
                           std::span<const uint32_t> keys) {
  CURVISPLAT_CHECK_OP(splats.size(), ==, keys.size());
  CURVISPLAT_CHECK_OP(splats.size(), <=, shared_.elements);
  Prepared& part = prepared_[index];
  findReceivers(part, splats);
  const bool any = std::any_of(part.receivers.begin(), part.receivers.end(),
                               [](const Receiver& receiver) { return !receiver.done && receiver.count > 0; });
  if (any) {
    part.splats.assign(splats.begin(), splats.end());
    part.keys.assign(keys.begin(), keys.end());
  }
  part.bytes = part.splats.size() * kElementBytes + part.entries.size() * sizeof(uint32_t);
  part.ready = true;
  const MutexLock lock(mutex_);
  prepared_bytes_ -= shared_.elements * kPreparedBytes;
  prepared_bytes_ += part.bytes;
}

TileBox SplatExchange::tilesOf(const ScreenBox& box) const {
  return {TileSet::tileAt(box.x0 - TileSet::kMargin, columns_),
          TileSet::tileAt(box.y0 - TileSet::kMargin, rows_),
          TileSet::tileAt(box.x1 + TileSet::kMargin, columns_) + 1,
          TileSet::tileAt(box.y1 + TileSet::kMargin, rows_) + 1};
}

/// Finds which splats touch whose tiles. A receiver may get more than those: what touches none of its tiles
/// is not seen.
void SplatExchange::findReceivers(Prepared& part, std::span<const ScreenSplat> splats) const {
  constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> place(ranks_.count(), kNone);  // [rank] in the receivers
  for (uint32_t n = 0; n < part.receivers.size(); ++n)
    if (!part.receivers[n].done) place[part.receivers[n].rank] = n;
  // A part that lies in one rank's tiles. What lies outside of the picture has been left out already.
  if (all_painted_ && part.receivers.size() == 1) part.all = true;
  std::vector<std::vector<uint32_t>> lists(part.receivers.size());
  const uint64_t most = kEntriesAnElement * splats.size();
  uint64_t entries = 0;
  std::vector<uint32_t> last(part.receivers.size(), kNone);  // the splat that each got last
  size_t first_record = 0;                                   // the records of a splat come before it
  const auto add = [&](uint32_t rank, size_t n) {
    const uint32_t receiver = rank == kNobody ? kNone : place[rank];
    if (receiver == kNone || last[receiver] == n) return;
    last[receiver] = static_cast<uint32_t>(n);
    entries += n + 1 - first_record;
    if (entries > most) return;
    for (size_t from = first_record; from <= n; ++from)
      lists[receiver].push_back(static_cast<uint32_t>(from));
  };
  for (size_t n = 0; n < splats.size() && !part.all; ++n) {
    if (isRecord(splats[n])) continue;
    const ScreenBox box = footprintBox(splats[n]);
    if (!(box.x0 <= box.x1 && box.y0 <= box.y1)) {
      part.all = true;  // no numbers
      break;
    }
    const TileBox tiles = tilesOf(box);
    if (tiles.tiles() <= kMaxTiles) {
      for (int y = tiles.y0; y < tiles.y1; ++y)
        for (int x = tiles.x0; x < tiles.x1; ++x) add(painters_[static_cast<size_t>(y * columns_ + x)], n);
    } else {
      for (const Receiver& receiver : part.receivers) {
        const TileBox& other = boxes_[receiver.rank];
        if (tiles.x0 < other.x1 && tiles.x1 > other.x0 && tiles.y0 < other.y1 && tiles.y1 > other.y0)
          add(receiver.rank, n);
      }
    }
    first_record = n + 1;
    part.all = entries > most;
  }
  if (!part.all) part.entries.reserve(entries);
  for (size_t n = 0; n < part.receivers.size(); ++n) {
    Receiver& receiver = part.receivers[n];
    if (receiver.done) continue;
    receiver.first = static_cast<uint32_t>(part.entries.size());
    receiver.count = static_cast<uint32_t>(part.all ? splats.size() : lists[n].size());
    if (!part.all) part.entries.insert(part.entries.end(), lists[n].begin(), lists[n].end());
  }
}

// -------------------------------------------------------------------------------------------------- steps

bool SplatExchange::step(const std::function<bool(uint64_t sequence)>& unneeded) {
  // What was received has been entered.
  const uint64_t begin = available_;
  endKept();
  std::vector<uint32_t> cancelled;
  for (uint64_t n = begin; n < std::min<uint64_t>(needed_.size(), begin + kCancelAhead); ++n) {
    if (arrived_[n].cancelled || !unneeded(n)) continue;
    arrived_[n].cancelled = true;
    cancelled.push_back(needed_[n]);
  }
  const uint64_t left = receive(ranks_.exchange(offers(cancelled)));
  if (left == 0) return false;

  std::vector<uint32_t> granted;
  for (const Ranks::Bytes& bytes : ranks_.exchange(grants()))
    granted.push_back(fromBytes<uint32_t>(bytes).at(0));
  send(granted);
  next_received_ = begin;
  // Nothing is prepared before the first step.
  if (steps_++ > 0 && round_ + 1 < round_ends_.size()) ++round_;
  return true;
}

/// Offers what was prepared, in order, as far as it fits into the buffer for sending.
std::vector<Ranks::Bytes> SplatExchange::offers(const std::vector<uint32_t>& cancelled) {
  std::vector<std::vector<Offer>> to(ranks_.count());
  bool full = false;
  for (size_t n = first_open_; n < own_.size() && prepared_[n].ready && !full; ++n)
    for (Receiver& receiver : prepared_[n].receivers) {
      if (receiver.done || receiver.offered) continue;
      if (full = offered_bytes_ > 0 && offered_bytes_ + receiver.bytes() > buffer_bytes_; full) break;
      offered_bytes_ += receiver.bytes();
      receiver.offered = true;
      to[receiver.rank].push_back({own_[n], receiver.count});
    }
  std::vector<Ranks::Bytes> messages(ranks_.count());
  for (uint32_t rank = 0; rank < ranks_.count(); ++rank) {
    const OfferHeader header{needed_.size() - available_, static_cast<uint32_t>(cancelled.size()),
                             static_cast<uint32_t>(to[rank].size())};
    put(messages[rank], &header, 1);
    put(messages[rank], cancelled.data(), cancelled.size());
    put(messages[rank], to[rank].data(), to[rank].size());
  }
  return messages;
}

/// Returns how many parts all ranks together still wait for.
uint64_t SplatExchange::receive(const std::vector<Ranks::Bytes>& offered) {
  uint64_t left = 0;
  for (uint32_t rank = 0; rank < offered.size(); ++rank) {
    size_t at = 0;
    OfferHeader header;
    get(offered[rank], at, &header, 1);
    left += header.left;
    std::vector<uint32_t> cancelled(header.cancelled);
    get(offered[rank], at, cancelled.data(), cancelled.size());
    for (const uint32_t part : cancelled) cancel(part, rank);
    std::vector<Offer> offers(header.offers);
    get(offered[rank], at, offers.data(), offers.size());
    for (const Offer& offer : offers) {
      Arrived& part = arrived(offer.part);
      part.known = true;
      part.count = offer.count;
    }
  }
  while (first_open_ < own_.size() && prepared_[first_open_].ready &&
         std::all_of(prepared_[first_open_].receivers.begin(), prepared_[first_open_].receivers.end(),
                     [](const Receiver& receiver) { return receiver.done; }))
    ++first_open_;
  return left;
}

void SplatExchange::cancel(uint32_t part, uint32_t rank) {
  const auto found = std::lower_bound(own_.begin(), own_.end(), part);
  if (found == own_.end() || *found != part) return;  // another's
  Prepared& prepared = prepared_[static_cast<size_t>(found - own_.begin())];
  for (Receiver& receiver : prepared.receivers)
    if (receiver.rank == rank && !receiver.done) {
      if (receiver.offered) offered_bytes_ -= receiver.bytes();
      finish(prepared, receiver);
      --wanted_by_[static_cast<size_t>(found - own_.begin())];
    }
}

/// Ends what a receiver gets of a part, whose memory is free after the last.
void SplatExchange::finish(Prepared& part, Receiver& receiver) {
  receiver.done = true;
  if (!part.ready) return;
  for (const Receiver& other : part.receivers)
    if (!other.done) return;
  // Assigning {} would keep the memory.
  std::vector<ScreenSplat>().swap(part.splats);
  std::vector<uint32_t>().swap(part.keys);
  std::vector<uint32_t>().swap(part.entries);
  const MutexLock lock(mutex_);
  prepared_bytes_ -= std::exchange(part.bytes, 0);
}

SplatExchange::Arrived& SplatExchange::arrived(uint32_t number) {
  const auto found = std::lower_bound(needed_.begin(), needed_.end(), number);
  CURVISPLAT_CHECK(found != needed_.end() && *found == number);
  return arrived_[static_cast<size_t>(found - needed_.begin())];
}

/// Keeps a part where this rank itself needs all splats that it has prepared: they arrive where they are.
bool SplatExchange::keep(Prepared& part, Receiver& receiver, uint32_t number) {
  if (receiver.rank != ranks_.rank() || receiver.count == 0 || receiver.count != part.splats.size())
    return false;
  Arrived& here = arrived(number);
  CURVISPLAT_CHECK_OP(here.count, ==, receiver.count);
  here.keys = part.keys.data();
  here.splats = part.splats.data();
  return receiver.kept = true;
}

void SplatExchange::endKept() {
  for (const size_t n : kept_)
    for (Receiver& receiver : prepared_[n].receivers)
      if (std::exchange(receiver.kept, false)) finish(prepared_[n], receiver);
  kept_.clear();
}

/// Grants the needed parts in their order, as many as there is space for. Each rank may send all up to a
/// number.
std::vector<Ranks::Bytes> SplatExchange::grants() {
  uint64_t bytes = 0;
  for (; available_ < needed_.size(); ++available_) {
    const Arrived& part = arrived_[available_];
    if (part.cancelled) continue;
    if (!part.known) break;
    const uint64_t more = kHeaderBytes + part.count * kElementBytes;
    if (bytes > 0 && bytes + more > buffer_bytes_) break;
    bytes += more;
  }
  const uint32_t end = available_ == 0 ? 0 : needed_[available_ - 1] + 1;
  return std::vector<Ranks::Bytes>(ranks_.count(), toBytes(std::vector<uint32_t>{end}));
}

void SplatExchange::send(const std::vector<uint32_t>& granted) {
  const auto isSentNow = [&](size_t n, const Receiver& receiver) {
    return !receiver.done && !receiver.kept && receiver.offered && own_[n] < granted[receiver.rank];
  };
  std::vector<uint64_t> bytes_to(ranks_.count()), written(ranks_.count());
  for (size_t n = first_open_; n < own_.size() && prepared_[n].ready; ++n)
    for (Receiver& receiver : prepared_[n].receivers) {
      if (!isSentNow(n, receiver)) continue;
      offered_bytes_ -= receiver.bytes();
      if (keep(prepared_[n], receiver, own_[n]))
        kept_.push_back(n);
      else
        bytes_to[receiver.rank] += receiver.bytes();
    }
  sending_.begin(bytes_to);
  for (size_t n = first_open_; n < own_.size() && prepared_[n].ready; ++n)
    for (Receiver& receiver : prepared_[n].receivers) {
      if (!isSentNow(n, receiver)) continue;
      uint64_t& at = written[receiver.rank];
      write(prepared_[n], receiver, own_[n], sending_.of(receiver.rank).data() + at);
      at += receiver.bytes();
      if (receiver.rank != ranks_.rank()) sent_bytes_ += receiver.bytes();
      finish(prepared_[n], receiver);
    }
  ranks_.exchange(sending_, received_);
  for (uint32_t rank = 0; rank < ranks_.count(); ++rank)
    takeSplats(rank == ranks_.rank() ? sending_.of(rank) : received_.of(rank));
}

/// Takes the splats of one rank: they stay where they are until the next step.
void SplatExchange::takeSplats(std::span<const std::byte> bytes) {
  for (size_t at = 0; at < bytes.size();) {
    MessageHeader header;
    get(bytes, at, &header, 1);
    Arrived& part = arrived(header.part);
    CURVISPLAT_CHECK_OP(part.count, ==, header.count);
    // Messages are made of 4-byte numbers: keys, then splats.
    part.keys = reinterpret_cast<const uint32_t*>(bytes.data() + at);
    part.splats = reinterpret_cast<const ScreenSplat*>(bytes.data() + at + header.count * sizeof(uint32_t));
    at += header.count * kElementBytes;
    CURVISPLAT_CHECK_OP(at, <=, bytes.size());
  }
}

void SplatExchange::write(const Prepared& part, const Receiver& receiver, uint32_t number, std::byte* to) {
  const MessageHeader header{number, receiver.count};
  const auto append = [&to](const void* from, size_t bytes) {
    if (bytes > 0) std::memcpy(to, from, bytes);
    to += bytes;
  };
  append(&header, sizeof header);
  if (receiver.count == 0) return;
  if (part.all) {
    append(part.keys.data(), part.keys.size() * sizeof(uint32_t));
    append(part.splats.data(), part.splats.size() * sizeof(ScreenSplat));
    return;
  }
  const auto entries = std::span(part.entries).subspan(receiver.first, receiver.count);
  for (const uint32_t entry : entries) append(&part.keys[entry], sizeof(uint32_t));
  for (const uint32_t entry : entries) append(&part.splats[entry], sizeof(ScreenSplat));
}

// ---------------------------------------------------------------------------------------------- receiving

std::optional<uint64_t> SplatExchange::nextReceived() {
  uint64_t next = next_received_;
  while (next < available_)
    if (next_received_.compare_exchange_weak(next, next + 1)) return next;
  return {};
}

std::optional<SplatExchange::Received> SplatExchange::received(uint64_t sequence) const {
  const Arrived& part = arrived_[sequence];
  if (part.cancelled) return {};
  CURVISPLAT_CHECK(part.splats != nullptr);
  return Received{{part.splats, part.count}, {part.keys, part.count}};
}

}  // namespace curvisplat
