// Writes a splat cache. Everything goes to files of their final names in a folder NAME.splats.partial beside
// the output; finish() writes index, bricks.vdb and manifest, syncs, and renames the folder into place. Until
// then nothing opens as a cache; what stood at the output before stays until the rename.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stream/brick.h"
#include "stream/brick_codec.h"
#include "stream/manifest.h"

namespace curvisplat {

class CacheWriter {
 public:
  /// Throws Error if `cache` exists and `overwrite` is false, if `cache` exists and is not a cache, or if the
  /// partial folder cannot be made, or belongs to a conversion that is still running (it is locked).
  CacheWriter(std::filesystem::path cache, bool overwrite, RootCube root,
              std::vector<VariableInfo> variables);
  /// Removes the partial folder unless finish() has succeeded.
  ~CacheWriter();

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
  /// in), and renames into place.
  void finish(Manifest manifest);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
