#include "preprocess/seams/seams.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/coincidence/coincidence_sweep.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/seams/joint_sides.h"
#include "preprocess/seams/seam_sorter.h"
#include "stream/base/trace.h"

namespace curvisplat {

namespace {

constexpr uint64_t kWaitingShare = 8;  // of the memory: of the splats that wait for probes

/// Splats that have layers, and answers: probes of faces that are seams.
class WaitingSplats {
 public:
  WaitingSplats(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder)
      : variables_(variables), sorter_(variables, memory_bytes, std::move(temporary_folder)) {}

  /// Any thread.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values) {
    std::vector<double> record;
    sorter_.pack({static_cast<double>(splat.node), 0}, splat, values, record);
    sorter_.add(record);
  }

  /// Gives out all splats, without the layers behind seams.
  void finish(const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink) {
    const TraceScope trace("merge splats that wait");
    SplatWithValues waiting;
    NodeSplat probe;
    waiting.values.resize(variables_);
    bool any = false;
    uint64_t node = 0;
    uint32_t seams = 0;  // bit n: across axis n of the lattice
    std::array<JointLine, 3> joined{};
    const auto release = [&] {
      if (any) {
        NodeSplat& splat = waiting.splat;
        const LayeredBorder left = withoutSeams({splat.border_code, splat.layers}, seams);
        splat.border_code = left.code;
        splat.layers = left.layers;
        for (size_t axis = 0; axis < joined.size(); ++axis)
          if ((seams >> axis & 1) != 0) goOnAcross(axis, joined[axis], splat, waiting.values);
        sink(splat, waiting.values);
      }
      any = false;
      seams = 0;
    };
    sorter_.drain([&](const SeamRecord& next) {
      if (next.node() != node) release();
      node = next.node();
      next.unpack(probe, {});
      if (probe.is_probe) {
        seams |= 1u << probe.layers;
        joined[probe.layers] = probe.lines[probe.layers];
      } else {
        next.unpack(waiting.splat, waiting.values);
        any = true;
      }
    });
    release();
  }

 private:
  const size_t variables_;
  SeamSorter sorter_;
};

}  // namespace

struct SeamMerger::State {
  UnlikeHalves unlike;
  size_t variables;
  SeamSorter sorter;
  WaitingSplats waiting;
  ThinWalls walls;
  std::optional<std::vector<SweepRange>> ranges;  // once the sorter has sorted

  State(size_t variable_count, uint64_t memory_bytes, const std::filesystem::path& folder, UnlikeHalves how)
      : unlike(how),
        variables(variable_count),
        sorter(variables, memory_bytes - memory_bytes / kWaitingShare, folder),
        waiting(variables, memory_bytes / kWaitingShare, folder) {}

  using ForEachRecord = std::function<void(const SeamSorter::Visit&)>;  // in the order of the sweep

  /// `sink` does not get what waits.
  void sweep(int coordinate_bytes, const ForEachRecord& for_each, const JointNodes::Sink& sink) {
    const JointNodes::Sink sink_or_wait = [&](const NodeSplat& splat, std::span<const SplatScalar> values,
                                              std::span<const uint64_t> nodes) {
      if (splat.is_probe) {
        if (splat.border_code == kNoBorder) waiting.add(splat, values);
      } else {
        sink(splat, values, nodes);
      }
    };
    std::vector<JointNodes> sets;
    CoincidenceSweep sweep(coordinate_bytes, [&](size_t set) { sets[set].finish(sink_or_wait); });
    NodeSplat splat;
    std::vector<SplatScalar> values(variables);
    for_each([&](const SeamRecord& node) {
      node.unpack(splat, values);
      if (!splat.on_block_face && !splat.behind_face) return waiting.add(splat, values);
      const size_t set = sweep.add(node.swept());
      if (set == sets.size()) sets.emplace_back(unlike, variables);
      sets[set].add(splat, values, walls.sideOf(splat.node));
    });
    sweep.finish();
  }

  void sweepAll(int coordinate_bytes, const JointNodes::Sink& sink) {
    sweep(
        coordinate_bytes, [&](const SeamSorter::Visit& visit) { sorter.drain(visit); }, sink);
  }

  const std::vector<SweepRange>& sortedRanges(int coordinate_bytes) {
    if (ranges) return *ranges;
    const TraceScope trace("sort seams");
    const auto threads = static_cast<unsigned>(tbb::this_task_arena::max_concurrency());
    return ranges.emplace(sorter.sort(threads, coordinate_bytes));
  }

  /// The same by several threads.
  void sweepRanges(int coordinate_bytes, const JointNodes::Sink& sink) {
    const std::vector<SweepRange>& of_threads = sortedRanges(coordinate_bytes);
    parallelFor(size_t{0}, of_threads.size(), [&](size_t n) {
      const TraceScope trace("merge seams");
      sweep(
          coordinate_bytes, [&](const SeamSorter::Visit& visit) { sorter.visit(of_threads[n], visit); },
          sink);
    });
    sorter.forget();
  }

  /// Visits the joints of a range.
  void findJoints(const SweepRange& range, int coordinate_bytes,
                  const std::function<void(std::span<const uint64_t>)>& visit) {
    const TraceScope trace("find joints");
    std::vector<JointNodes> sets;
    CoincidenceSweep sweep(coordinate_bytes, [&](size_t set) {
      if (sets[set].joinsHalves()) visit(sets[set].nodes());
      sets[set].clear();
    });
    NodeSplat splat;
    sorter.visit(range, [&](const SeamRecord& node) {
      node.unpack(splat, {});
      if (!splat.on_block_face && !splat.behind_face) return;
      const size_t set = sweep.add(node.swept());
      if (set == sets.size()) sets.emplace_back(unlike, 0);
      sets[set].add(splat, {});
    });
    sweep.finish();
  }

  uint64_t finish(void (State::*sweep_with)(int, const JointNodes::Sink&), int coordinate_bytes,
                  const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink) {
    std::atomic<uint64_t> merged = 0;
    (this->*sweep_with)(coordinate_bytes, [&](const NodeSplat& splat, std::span<const SplatScalar> values,
                                              std::span<const uint64_t> nodes) {
      if (nodes.size() > 1) merged += nodes.size() - 1;
      if (splat.layers == 0)
        sink(splat, values);
      else
        waiting.add(splat, values);
    });
    waiting.finish(sink);
    return merged;
  }
};

SeamMerger::SeamMerger(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder,
                       UnlikeHalves unlike)
    : state_(new State(variables, memory_bytes, temporary_folder, unlike)) {}
SeamMerger::~SeamMerger() = default;
SeamMerger::SeamMerger(SeamMerger&&) noexcept = default;
SeamMerger& SeamMerger::operator=(SeamMerger&&) noexcept = default;

void SeamMerger::pack(const NodeSplats& splats, std::vector<double>& records) const {
  const size_t variables = state_->variables;
  const auto pack_one = [&](const NodeSplat& splat, size_t n) {
    const auto values = std::span(splats.values).subspan(n * variables, variables);
    state_->sorter.pack(seamPosition(splat.node_position), splat, values, records);
  };
  for (size_t n = 0; n < splats.splats.size(); ++n)
    if (splats.splats[n].isForSeams()) pack_one(splats.splats[n], n);
  for (const auto& [splat, probe] : splats.probes) {
    if (splats.splats[splat].layers == 0) continue;  // a part of the cell is left
    NodeSplat asks = splats.splats[splat];
    asks.on_block_face = false;
    asks.behind_face = asks.is_probe = true;
    asks.layers = probe.axis;
    asks.border_code = ~kNoBorder;  // kNoBorder once the face turns out to be a seam
    asks.node_position = probe.face_node;
    asks.spacing = probe.spacing;
    pack_one(asks, splat);
  }
}

void SeamMerger::add(std::span<const double> records) {
  state_->sorter.add(records);
}

void SeamMerger::sendToFirst(Ranks& ranks) {
  constexpr size_t kMessageBytes = 4 << 20;
  SeamSorter& sorter = state_->sorter;
  Ranks::Bytes message;
  // A round takes a message of one rank. Its last one is not full.
  const auto round = [&](unsigned sender) {
    const bool sends = sender == ranks.rank();
    const std::vector<Ranks::Bytes> sent = ranks.gather(sends ? message : Ranks::Bytes{});
    if (ranks.isFirst()) sorter.add(fromBytes<double>(sent[sender]));
    message.clear();
    std::vector<uint64_t> full{ranks.isFirst() && sent[sender].size() >= kMessageBytes};
    ranks.sum(std::span<uint64_t>(full));
    return full[0] != 0;
  };
  for (unsigned sender = 1; sender < ranks.count(); ++sender) {
    if (sender == ranks.rank()) {
      sorter.drainPacked([&](std::span<const double> record) {
        const auto bytes = std::as_bytes(record);
        message.insert(message.end(), bytes.begin(), bytes.end());
        if (message.size() >= kMessageBytes) round(sender);
      });
      round(sender);
    } else {
      while (round(sender)) {
      }
    }
  }
}

void SeamMerger::forEachJoint(int coordinate_bytes,
                              const std::function<void(std::span<const uint64_t>)>& visit) {
  const std::vector<SweepRange>& ranges = state_->sortedRanges(coordinate_bytes);
  parallelFor(size_t{0}, ranges.size(),
              [&](size_t n) { state_->findJoints(ranges[n], coordinate_bytes, visit); });
}

void SeamMerger::keepApart(ThinWalls walls) {
  state_->walls = std::move(walls);
}

uint64_t SeamMerger::finish(int coordinate_bytes,
                            const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink) {
  return state_->finish(&State::sweepAll, coordinate_bytes, sink);
}

uint64_t SeamMerger::finishInParallel(
    int coordinate_bytes, const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink) {
  return state_->finish(&State::sweepRanges, coordinate_bytes, sink);
}

void SeamMerger::forEachSet(int coordinate_bytes,
                            const std::function<void(std::span<const uint64_t>)>& visit) {
  std::vector<uint64_t> rising;
  state_->sweepAll(coordinate_bytes,
                   [&](const NodeSplat&, std::span<const SplatScalar>, std::span<const uint64_t> nodes) {
                     if (nodes.size() < 2) return;
                     rising.assign(nodes.begin(), nodes.end());
                     std::sort(rising.begin(), rising.end());
                     visit(rising);
                   });
}

}  // namespace curvisplat
