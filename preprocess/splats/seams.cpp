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
