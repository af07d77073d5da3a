// Writes a splat cache. The files get their final names at once, but in a folder NAME.splats.partial beside
// the output. finish() writes the index, bricks.vdb and the manifest, syncs everything, and renames the
// folder to its final name. Until then nothing opens as a cache, and an older cache at the output stays in
// place.
//
// A log (partial_folder.h) records the appended bricks. Nothing is synced before finish(): a conversion that
// continues an interrupted one checks every stream against its checksum, and rewrites what the disk has
// lost.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "stream/cache/manifest.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// Writes one cache. One thread at a time.
class CacheWriter {
 public:
  /// Throws Error if `cache` exists and `overwrite` is false, if `cache` exists and is not a cache, if the
  /// partial folder cannot be created, or if a running conversion has it locked.
  CacheWriter(std::filesystem::path cache, bool overwrite, RootCube root,
              std::vector<VariableInfo> variables);
  /// Writes to an existing partial folder, which must outlive the writer. Bricks that an interrupted
  /// conversion appended there count as appended, up to the first one with a missing or damaged stream; each
  /// advances `progress` by 1. `root` and `variables` must be those of the interrupted conversion.
  CacheWriter(PartialFolder& folder, RootCube root, std::vector<VariableInfo> variables, Progress& progress);
  /// Removes the partial folder unless finish() has succeeded or the caller owns the folder.
  ~CacheWriter();

  /// The bricks appended so far. A brick's id is its index.
  std::span<const Brick> bricks() const;
  /// Discards the bricks with ids >= `count`.
  void keep(uint64_t count);

  /// Appends a brick's streams, aligned as cache_format.h describes. Bricks must come in post-order of the
  /// octree (children before their parent, siblings in Morton order), so that the bytes do not depend on the
  /// number of threads or on the memory budget. `error`: Brick::error. One thread at a time. Returns the
  /// brick's id.
  uint64_t append(EncodedBrick&& encoded, float error);

  /// Reads back the brick that append() wrote under `id`, for merging into coarser levels. Any number of
  /// threads may read at the same time, while nothing is appended.
  BrickSplats readBack(uint64_t id) const;

  /// The sums of the variables' histograms. finish() writes a histogram if every leaf was added to it. Any
  /// thread may add.
  HistogramSums& histograms();

  /// The record that append() has noted of a brick.
  AppendedBrick appended(uint64_t id) const;
  /// Syncs the streams and the log, so that what was appended outlasts a crash of the machine. Nothing may be
  /// appended meanwhile.
  void sync();
  /// Syncs and closes the streams and the log, so that another machine may read them. Only readBack() may
  /// follow.
  void closeStreams();

  /// Takes the place of append() where other processes write the streams: sets the offsets of all bricks,
  /// which must be in the order of append(). Nothing may have been appended. The streams have to be in the
  /// files before finish().
  void reserve(std::vector<AppendedBrick>& bricks);

  /// Sorts the records by level and Morton order and links parents and children. Writes bricks.bin, the
  /// variables' tables, bricks.vdb and the manifest, whose root, counts, levels, volume and files it fills
  /// in. Files that `manifest` lists must be in the folder; they stay listed. Renames the folder to its final
  /// name. Returns the manifest as written.
  Manifest finish(Manifest manifest);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
