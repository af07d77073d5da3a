// Adds a time step to a complete cache: its values on a geometry that the cache has, or a geometry of its own,
// which a conversion has put into the cache's folder. At every moment the cache is whole, with the steps so far.
// Files that a killed program left behind are replaced when the step is added again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/cache_lock.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {

/// Of a variable's samples.
struct StepRange {
  double min = 0, max = 0;
};

/// What is new about a step, beside its values.
struct NewStep {
  double time = 0;
  std::vector<StepRange> ranges;     // [variable]
  std::vector<std::string> sources;  // files
};

/// For one thread at a time.
class StepWriter : public ValuesWriter {
 public:
  /// `lock` must outlive the writer. `cache`: opened under the lock, at a step of the geometry. `step`: the new one.
  /// Throws Error if a file cannot be created.
  StepWriter(const CacheLock& lock, const CacheReader& cache, NewStep step);
  /// Removes the new files unless finish() has succeeded.
  ~StepWriter() override;
  StepWriter(const StepWriter&) = delete;
  StepWriter& operator=(const StepWriter&) = delete;

  void append(uint32_t brick, std::span<const EncodedValues> values) override;

  /// A further file of the step, which is complete in the cache's folder.
  void addFile(const FileInfo& file) { others_.push_back(file); }

  /// Writes the tables, syncs, and puts files and manifest into place. Returns the new files. After an Error the
  /// cache is what it was.
  std::vector<FileInfo> finish();

 private:
  struct NewFile {
    std::filesystem::path path, part;
    OutputFile file;
    std::vector<BrickVariable> table;  // [brick]
    bool is_renamed = false;
  };

  void removeFiles() const;

  const CacheLock* lock_;
  const std::filesystem::path folder_;
  const Manifest manifest_;  // of the series
  const Series series_;
  const uint32_t geometry_;
  const NewStep added_;
  std::vector<NewFile> files_;  // [variable]
  std::vector<FileInfo> others_;
  bool in_place_ = false;
};

/// Adds a step whose files are complete in the cache's folder; `others`: those of them that the manifest lists. `cache`:
/// opened under the lock. Throws Error as StepWriter::finish().
void addWrittenStep(const CacheLock& lock, const CacheReader& cache, SeriesStep step, const NewStep& added,
                    std::span<const FileInfo> others);

/// Adds the step whose geometry and values the folder geometry.<g> in the cache has, g being the series' next
/// geometry. `cache`: opened under the lock. Throws Error as StepWriter::finish().
void addGeometryStep(const CacheLock& lock, const CacheReader& cache, const NewStep& added);

}  // namespace curvisplat
