#include "preprocess/convert/build_parent.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <utility>

#include "preprocess/convert/merge_levels.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/trace.h"

namespace curvisplat {

BuiltCell buildFromChildren(const RootCube& root, size_t variables, const Cell& cell,
                            const std::array<ChildBricks, 8>& children) {
  std::array<MergedOctant, 8> octants;
  tbb::enumerable_thread_specific<OctantMerger> mergers([&] { return OctantMerger(root, variables); });
  // Of its own: where a loop around this one is cancelled, this one would end early as well, with children missing.
  tbb::task_group_context own(tbb::task_group_context::isolated);
  parallelFor(
      size_t{0}, size_t{8},
      [&](size_t octant) {
        const ChildBricks& child = children[octant];
        if (child.bricks == 0) return;
        const TraceScope trace("merge octant");
        OctantMerger& merger = mergers.local();
        merger.begin(child.cell);
        for (uint64_t n = 0; n < child.bricks; ++n) merger.add(child.read(n));
        octants[octant] = merger.finish();
      },
      own);
  const TraceScope trace("build parent");
  BuiltCell built;
  for (size_t octant = 0; octant < 8; ++octant)
    if (!octants[octant].splats.positions.empty())
      built.error = std::max({built.error, children[octant].error, octants[octant].detail});
  BrickSplats brick = joinOctants(cell, variables, std::move(octants));
  built.bricks.push_back({encodeBrick(root, brick), static_cast<float>(built.error), false});
  built.own_bricks = 1;
  return built;
}

}  // namespace curvisplat
