// Adds variables to a cache that is whole: writes var.<number>.bin.part for each beside the cache's files,
// and at the end renames them and replaces the manifest. No other file is touched. Until the manifest is
// replaced the cache is what it was, and readers do not see the new files; what a killed program leaves of
// them is removed by the next one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/cache_lock.h"
#include "stream/cache/manifest.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {

/// For one thread at a time.
class VariableWriter {
 public:
  /// `lock` must outlive it. `manifest`: the cache's, read while it was locked. `variables` get their numbers
  /// here. Throws Error if a file cannot be made.
  VariableWriter(const CacheLock& lock, Manifest manifest, std::vector<VariableInfo> variables);
  /// Removes the new files unless finish() has put them into place.
  ~VariableWriter();
  VariableWriter(const VariableWriter&) = delete;
  VariableWriter& operator=(const VariableWriter&) = delete;

  /// Appends the streams of a brick, one a variable. Bricks come in the order of conversion, each once.
  void append(uint32_t brick, std::span<const EncodedValues> values);

  /// Writes the tables, syncs, and puts files and manifest into place. `sources`, those that the manifest
  /// does not have yet, are added to it. Returns the new files. Throws Error, and then the cache is what it was;
  /// NameNotSynced where it is not, although a power loss may undo that.
  std::vector<FileInfo> finish(const std::vector<std::string>& sources);

 private:
  struct NewFile {
    VariableInfo variable;
    std::filesystem::path path, part;
    OutputFile file;
    std::vector<BrickVariable> table;  // [brick]
    bool is_renamed = false;
  };

  void removeLeftovers() const;
  void replaceManifest();

  const CacheLock* lock_;
  Manifest manifest_;
  std::vector<NewFile> files_;
  bool in_place_ = false;
};

}  // namespace curvisplat
