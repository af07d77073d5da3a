// Writes a splat cache. Everything goes to files of their final names in a folder NAME.splats.partial beside
// the output; finish() writes index, bricks.vdb and manifest, syncs, and renames the folder into place. Until
// then nothing opens as a cache; what stood at the output before stays until the rename.
//
// A log (brick_log.h) tells what was appended. Nothing is synced before finish(): whoever goes on from an
// interrupted conversion checks every stream against its checksum, and what the disk has lost is made again.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/manifest.h"
#include "stream/cache/partial_folder.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/brick.h"

namespace curvisplat {

class CacheWriter {
 public:
  /// Throws Error if `cache` exists and `overwrite` is false, if `cache` exists and is not a cache, or if the
  /// partial folder cannot be made, or belongs to a conversion that is still running (it is locked).
  CacheWriter(std::filesystem::path cache, bool overwrite, RootCube root,
              std::vector<VariableInfo> variables);
  /// In a folder that is there already, and must outlive the writer. Bricks that an interrupted conversion
  /// has appended there count as appended, up to the first that is not whole; each advances `progress` by 1.
  /// Root and variables must be that conversion's.
  CacheWriter(PartialFolder& folder, RootCube root, std::vector<VariableInfo> variables, Progress& progress);
  /// Removes the partial folder unless finish() has succeeded, or the folder is another's.
  ~CacheWriter();

  /// The bricks appended so far, by id.
  std::span<const Brick> bricks() const;
  /// Forgets the bricks from id `count` on.
  void keep(uint64_t count);

  /// Appends a brick's streams; small ones share a 4 KiB page, no other crosses into one. Bricks come in
  /// post-order of the octree (children before their parent, Morton order among siblings), so that the bytes
  /// do not depend on threads or memory. `error` as Brick::error. One thread at a time. Returns the brick's
  /// id in order of appending.
  uint64_t append(EncodedBrick&& brick, float error);

  /// Reads back what append() has written under `id`, for merging the levels above. Any number of threads may
  /// read at once, while nothing is appended.
  BrickSplats readBack(uint64_t id) const;

  /// Sorts the records by level and Morton order, links parents and children, writes bricks.bin, the
  /// variables' tables, bricks.vdb and the manifest (whose root, counts, levels, volume and files it fills
  /// in), and renames into place. Returns the manifest as it was written.
  Manifest finish(Manifest manifest);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
