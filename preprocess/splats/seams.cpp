#include "preprocess/splats/seams.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "preprocess/splats/coincidence_sweep.h"
#include "preprocess/splats/seam_sorter.h"

namespace curvisplat {

struct SeamMerger::State {
  UnlikeHalves unlike;
  SeamSorter sorter;

  void sweep(int coordinate_bytes, const JointNodes::Sink& sink) {
    CoincidenceSweep sweep(coordinate_bytes, unlike, [&](JointNodes& joint) { joint.finish(sink); });
    sorter.drain([&](const SeamNode& node, std::span<const SplatScalar> values) { sweep.add(node, values); });
    sweep.finish();
  }
};

SeamMerger::SeamMerger(size_t variables, uint64_t memory_bytes, std::filesystem::path temporary_folder,
                       UnlikeHalves unlike)
    : state_(new State{unlike, SeamSorter(variables, memory_bytes, std::move(temporary_folder))}) {}
SeamMerger::~SeamMerger() = default;
SeamMerger::SeamMerger(SeamMerger&&) noexcept = default;
SeamMerger& SeamMerger::operator=(SeamMerger&&) noexcept = default;

void SeamMerger::add(const NodeSplat& splat, std::span<const SplatScalar> values) {
  state_->sorter.add(seamNodeOf(splat), values);
}

void SeamMerger::sendToFirst(Ranks& ranks) {
  constexpr size_t kMessageBytes = 4 << 20;
  SeamSorter& sorter = state_->sorter;
  Ranks::Bytes message;
  // A round takes a message of one rank. Its last one is not full.
  const auto round = [&](unsigned sender) {
    const bool sends = sender == ranks.rank();
    const std::vector<Ranks::Bytes> sent = ranks.gather(sends ? message : Ranks::Bytes{});
    if (ranks.isFirst()) sorter.addPacked(fromBytes<double>(sent[sender]));
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

uint64_t SeamMerger::finish(int coordinate_bytes,
                            const std::function<void(const NodeSplat&, std::span<const SplatScalar>)>& sink) {
  uint64_t merged = 0;
  state_->sweep(coordinate_bytes, [&](const NodeSplat& splat, std::span<const SplatScalar> values,
                                      std::span<const uint64_t> nodes) {
    if (!nodes.empty()) merged += nodes.size() - 1;
    sink(splat, values);
  });
  return merged;
}

void SeamMerger::forEachSet(int coordinate_bytes,
                            const std::function<void(std::span<const uint64_t>)>& visit) {
  std::vector<uint64_t> rising;
  state_->sweep(coordinate_bytes,
                [&](const NodeSplat&, std::span<const SplatScalar>, std::span<const uint64_t> nodes) {
                  if (nodes.size() < 2) return;
                  rising.assign(nodes.begin(), nodes.end());
                  std::sort(rising.begin(), rising.end());
                  visit(rising);
                });
}

}  // namespace curvisplat
