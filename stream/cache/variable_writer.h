// Adds variables to a complete cache. Writes one var.<number>.bin.part per variable beside the cache's files;
// at the end renames these files and replaces the manifest. No other file changes. Until the manifest is
// replaced, readers see the old cache. Files that a killed program left behind are removed by the next
// VariableWriter.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/cache_lock.h"
#include "stream/cache/manifest.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {

/// For one thread at a time.
class VariableWriter : public ValuesWriter {
 public:
  /// `lock` must outlive the writer. `manifest`: the cache's, read under the lock. Assigns the numbers of
  /// `variables`. Throws Error if a file cannot be created.
  VariableWriter(const CacheLock& lock, Manifest manifest, std::vector<VariableInfo> variables);
  /// Removes the new files unless finish() has succeeded.
  ~VariableWriter() override;
  VariableWriter(const VariableWriter&) = delete;
  VariableWriter& operator=(const VariableWriter&) = delete;

  void append(uint32_t brick, std::span<const EncodedValues> values) override;

  /// The numbers of the new variables.
  std::vector<uint32_t> numbers() const;
  /// A further file of the cache's folder, complete: finish() lists it; removed unless that succeeds.
  void addFile(const FileInfo& file) { others_.push_back(file); }

  /// Writes the tables, syncs, and puts the files and the manifest into place. Adds those `sources` to the
  /// manifest that it does not list yet. Returns the manifest's entries for the new files. After an Error the
  /// cache is what it was; after NameNotSynced it has the new files, though a power loss may undo that.
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

  const CacheLock* lock_;
  Manifest manifest_;
  std::vector<NewFile> files_;
  std::vector<FileInfo> others_;
  bool in_place_ = false;
};

}  // namespace curvisplat
