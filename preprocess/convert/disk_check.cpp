#include "preprocess/convert/disk_check.h"

#include <algorithm>

#include "preprocess/faces/grid_faces_pass.h"

namespace curvisplat {
namespace {

/// `needs` of the whole, less what an interrupted conversion has left, with what else the passes write.
DiskNeeds leftOf(const UncheckedConversion& conversion, DiskNeeds needs, const TemporaryNeeds& temporary) {
  const auto& [options, origin, nodes, workspace, estimate] = conversion;
  if (workspace.splats())
    needs.temporary_bytes -= std::min(needs.temporary_bytes, workspace.splats()->buckets.size);
  if (workspace.hasAllSplats()) needs.temporary_bytes = 0;
  if (options.ranks)
    needs.temporary_bytes += needs.cache_bytes;  // the bricks of each, before they are joined
  if (options.surfaces)
    needs.temporary_bytes += temporaryBytesOfFaces(origin.blocks(), options.planes, options.scalars.size());
  needs.cache_bytes -= std::min(needs.cache_bytes, workspace.bytesInPartial());
  return with(temporary, needs);
}

DiskNeeds likelyNeeds(const UncheckedConversion& conversion, const DiskNeeds& most) {
  const auto likely =
      conversion.estimate ? conversion.estimate(conversion.workspace.scratch() / "sample") : std::nullopt;
  if (!likely) return most;
  return {std::min(likely->temporary_bytes, most.temporary_bytes),
          std::min(likely->cache_bytes, most.cache_bytes), 0};
}

}  // namespace

void checkDiskOf(const UncheckedConversion& conversion, Progress& progress) {
  const auto& [options, origin, nodes, workspace, estimate] = conversion;
  if (!options.check_disk_space) return;
  const DiskNeeds most = diskNeeds(nodes, options.scalars.size());
  const TemporaryNeeds most_temporary =
      workspace.hasAllSplats() ? TemporaryNeeds{} : origin.mostTemporaryNeeds();
  const std::filesystem::path folder = temporaryFolder(options);
  if (hasDiskSpace(leftOf(conversion, most, most_temporary), options.output, folder)) return;
  const TemporaryNeeds forecast =
      workspace.hasAllSplats() ? TemporaryNeeds{} : origin.temporaryNeeds(progress);
  checkDiskSpace(leftOf(conversion, likelyNeeds(conversion, most), forecast), options.output, folder,
                 options.full_disk_hint.empty() ? kSmallDiskHint : options.full_disk_hint);
}

}  // namespace curvisplat
