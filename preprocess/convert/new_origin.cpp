#include "preprocess/convert/new_origin.h"

#include "preprocess/convert/grid_origin.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/splat_record.h"
#include "stream/base/error.h"

namespace curvisplat {

uint64_t nodesOf(const SplatOrigin& origin) {
  uint64_t nodes = 0;
  for (const GridBlock& block : origin.blocks()) nodes += block.nodes();
  if (nodes >= kMaxNodes)
    throw Error("{}: has {} nodes; at most {} can be converted", origin.description().format, nodes,
                kMaxNodes - 1);
  return nodes;
}

std::unique_ptr<SplatOrigin> originOf(const DataSource& source, const ConvertOptions& options,
                                      const MemoryPlan& plan, const ScratchFiles& scratch) {
  if (const auto* mesh = dynamic_cast<const MeshSource*>(&source))
    return std::make_unique<MeshOrigin>(*mesh, options.scalars, options.blank_value, plan, scratch);
  return std::make_unique<GridOrigin>(dynamic_cast<const GridSource&>(source), options, plan,
                                      scratch.folder());
}

}  // namespace curvisplat
