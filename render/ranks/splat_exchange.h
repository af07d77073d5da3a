// The exchange of projected splats among the ranks that draw one picture together. Each brick is read,
// decoded and projected by one rank, its preparer, which sends each of its splats to the ranks whose tiles
// it touches.
//
//   preparer   nextToPrepare() -> project -> submit()        all workers
//                                              |
//              step()   offers -> grants -> splats           one thread, at all ranks at the same time
//                                              |
//   owner      nextReceived() -> received() -> sort, enter into the sweep      all workers
//
// A preparer's own splats are not sent: it takes them from where they are, or, where it needs only some,
// from a copy.
//
// Work and steps alternate. Parts are prepared in rounds (picture_shares.h), the next one after each step.
// In a step, a preparer offers what it has prepared; an owner grants, in its sweep's order, what it has
// space for; then splats are sent. An owner may cancel parts that it does not need any more, as long as they
// have not been sent.
//
// A rank paints its tiles region by region, each in slabs of depth, where its memory is short
// (render/frame/frame_memory.h). All ranks begin their next slab together, whichever regions these belong
// to, and say which tiles and parts they need for it; parts that a rank needs again are prepared and sent
// again.
//
// Each rank holds at most three times `buffer_bytes`: of what it has prepared, of what it sends and of what
// it has received in a step. There is no deadlock: of all parts that are still to be sent somewhere, the
// first in the sweep's order can always be prepared, offered, granted and entered.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "render/image/image.h"
#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"
#include "render/sweep/sweep_buffer.h"
#include "stream/base/mutex.h"
#include "stream/base/ranks.h"

namespace curvisplat {

/// How ranks share a picture; the same at all of them.
struct SharedParts {
  std::vector<SweptPart> parts;     // of the cut, in the sweep's order
  std::vector<uint32_t> preparers;  // [part] a rank
  uint64_t elements = 0;            // the most records that a part can be projected to
  ImageSize size;
  std::vector<uint32_t> owners;  // [shared tile] a rank, which paints it in one of its regions
};

class SplatExchange {
 public:
  /// The least `buffer_bytes` for parts of up to `elements` records.
  static constexpr uint64_t leastBytes(uint64_t elements) { return elements * kPreparedBytes + kHeaderBytes; }

  /// `ranks` and `shared` outlive the exchange.
  SplatExchange(Ranks& ranks, const SharedParts& shared, uint64_t buffer_bytes);

  /// The parts that a rank needs for a slab of a region of its tiles.
  struct Request {
    TileBox tiles;  // that it paints in it; no other rank does
    // Numbers in SharedParts, increasing: all parts whose splats may touch those tiles.
    std::vector<uint32_t> parts;
  };
  /// Begins a slab; nullopt: this rank has none any more, but may have to prepare parts for others. All
  /// ranks call it; false if none has one. No other thread may use the exchange meanwhile.
  bool beginSlab(std::optional<Request> request);
  /// The parts of SharedParts.
  std::span<const SweptPart> parts() const { return shared_.parts; }
  /// The parts that this rank prepares in the slab, in order.
  const std::vector<uint32_t>& toPrepare() const { return own_; }

  /// The next of toPrepare(), as an index, if there is space for its splats; nullopt: none until the next
  /// step. The caller calls submit() or skip() next. Any thread.
  std::optional<size_t> nextToPrepare();
  /// Whether nobody needs a brick that this rank was to prepare any more. Once true, it stays so. Any
  /// thread.
  bool isUnneeded(uint32_t brick) const;
  /// Takes the splats of a part.   splats, keys [n]  as projected: records before their splat, with its key
  void submit(size_t index, std::span<const ScreenSplat> splats, std::span<const uint32_t> keys);
  void skip(size_t index);

  struct Received {
    std::span<const ScreenSplat> splats;
    std::span<const uint32_t> keys;
  };
  /// The next part that has arrived, as its place in the request; nullopt: none until the next step. Any
  /// thread.
  std::optional<uint64_t> nextReceived();
  /// The part's splats, until the next step; nullopt where the part was cancelled.
  std::optional<Received> received(uint64_t sequence) const;

  /// Sends and receives. All ranks call it, while their workers do nothing; false if nothing is left to be
  /// received by any. `unneeded`: of parts that have not arrived, whether this rank can do without them in
  /// this slab. Throws as Ranks::exchange() does.
  bool step(const std::function<bool(uint64_t sequence)>& unneeded);

  /// Bytes sent to other ranks so far.
  uint64_t sentBytes() const { return sent_bytes_; }

 private:
  static constexpr uint64_t kHeaderBytes = 8;
  static constexpr uint64_t kElementBytes = sizeof(ScreenSplat) + sizeof(uint32_t);
  // Lists of those of a part's elements that each rank gets have this many entries for each element at most:
  // else the ranks get all.
  static constexpr uint64_t kEntriesAnElement = 2;
  static constexpr uint64_t kPreparedBytes = kElementBytes + kEntriesAnElement * sizeof(uint32_t);

  /// A rank that gets splats of a prepared part.
  struct Receiver {
    uint32_t rank = 0;
    uint32_t first = 0, count = 0;  // entries, or all
    bool offered = false, done = false;
    // True if this rank is the receiver: it takes all of the part's splats from where they are, until the
    // next step.
    bool kept = false;
    uint64_t bytes() const { return kHeaderBytes + count * kElementBytes; }
  };
  struct Prepared {
    bool ready = false;
    bool all = false;  // each receiver gets all splats
    std::vector<Receiver> receivers;
    std::vector<ScreenSplat> splats;
    std::vector<uint32_t> keys, entries;
    uint64_t bytes = 0;
  };
  struct Arrived {
    bool known = false, cancelled = false;
    uint32_t count = 0;
    const uint32_t* keys = nullptr;
    const ScreenSplat* splats = nullptr;
  };

  void beginRounds(const std::vector<Ranks::Bytes>& requests);
  void findReceivers(Prepared& part, std::span<const ScreenSplat> splats) const;
  TileBox tilesOf(const ScreenBox& box) const;
  std::vector<Ranks::Bytes> offers(const std::vector<uint32_t>& cancelled);
  uint64_t receive(const std::vector<Ranks::Bytes>& offered);
  void cancel(uint32_t part, uint32_t rank);
  std::vector<Ranks::Bytes> grants();
  void send(const std::vector<uint32_t>& granted);
  void takeSplats(std::span<const std::byte> bytes);
  static void write(const Prepared& part, const Receiver& receiver, uint32_t number, std::byte* to);
  void finish(Prepared& part, Receiver& receiver);
  bool keep(Prepared& part, Receiver& receiver, uint32_t number);
  void endKept();
  Arrived& arrived(uint32_t number);

  Ranks& ranks_;
  const SharedParts& shared_;
  const uint64_t buffer_bytes_;
  const int columns_, rows_;

  // State of the slab; changed by beginSlab() and step() only, except as said.
  std::vector<TileBox> boxes_;      // [rank] its tiles
  std::vector<uint32_t> painters_;  // [shared tile] a rank, or kNobody
  std::vector<uint32_t> needed_, own_;
  std::unordered_map<uint32_t, uint32_t> index_of_brick_;  // in own_
  std::vector<Prepared> prepared_;                         // [own]; each is one worker's until it is ready
  std::unique_ptr<std::atomic<uint32_t>[]> wanted_by_;     // [own] ranks
  std::vector<size_t> kept_;                               // own parts with a receiver that is kept
  std::vector<uint32_t> round_ends_;                       // [round] the first part that comes later
  size_t steps_ = 0, round_ = 0;
  bool all_painted_ = false;  // every tile of the picture is some rank's
  size_t first_open_ = 0;     // own parts before it have been sent to all
  uint64_t offered_bytes_ = 0, sent_bytes_ = 0;
  std::vector<Arrived> arrived_;  // [needed]
  Messages sending_, received_;   // of the last step; splats for this rank itself stay in the first
  uint64_t available_ = 0;        // needed parts before it have arrived or were cancelled
  std::atomic<uint64_t> next_received_ = 0;

  mutable Mutex mutex_;
  size_t next_own_ GUARDED_BY(mutex_) = 0;
  uint64_t prepared_bytes_ GUARDED_BY(mutex_) = 0;  // and reserved
};

}  // namespace curvisplat
