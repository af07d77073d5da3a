// Adds values to a cache: the streams of further variables, or of a further time step.
//
// The new files have names that end in .part; at the end they are renamed and the manifest is replaced. No
// other file changes, so readers see the old cache or the new one at every moment. The destructors remove
// the new files unless finish() has succeeded; the next writer of the same kind removes or replaces what a
// killed program has left behind.
//
// Writers are for one thread at a time, except for histograms(), to which any thread may add.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/manifest.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {

/// The destination of the values streams that conversion makes: a VariableWriter or a StepWriter.
class ValuesWriter {
 public:
  /// `variables`: the new ones, or those of the step, with their ranges.
  ValuesWriter(const RootCube& root, const std::vector<VariableInfo>& variables)
      : histograms_(root, variables) {}
  virtual ~ValuesWriter() = default;
  /// Appends a brick's streams, one per variable. Each brick comes once, in the order of conversion.
  virtual void append(uint32_t brick, std::span<const EncodedValues> values) = 0;

  /// The sums of the variables' histograms. A histogram is written if every leaf was added to it. Any thread
  /// may add.
  HistogramSums& histograms() { return histograms_; }

 private:
  HistogramSums histograms_;
};

/// Adds variables to a complete cache: var.<number>.bin for each. The constructor removes files that a
/// killed program left behind.
class VariableWriter : public ValuesWriter {
 public:
  /// `lock` must outlive the writer. `manifest`: that of the cache, read under the lock. Assigns the numbers
  /// of `variables`. Throws Error if a file cannot be created.
  VariableWriter(const CacheLock& lock, Manifest manifest, std::vector<VariableInfo> variables);
  /// Removes the new files unless finish() has succeeded.
  ~VariableWriter() override;
  VariableWriter(const VariableWriter&) = delete;
  VariableWriter& operator=(const VariableWriter&) = delete;

  void append(uint32_t brick, std::span<const EncodedValues> values) override;

  /// The numbers of the new variables.
  std::vector<uint32_t> numbers() const;
  /// Adds a file that is complete in the cache's folder. finish() lists it; the destructor removes it unless
  /// finish() has succeeded.
  void addFile(const FileInfo& file) { others_.push_back(file); }

  /// Writes the tables, syncs, and puts the files and the manifest into place. Adds those `sources` to the
  /// manifest that it does not list yet. Returns the manifest's entries for the new files. After an Error
  /// the cache is what it was; after NameNotSynced it has the new files, though a power loss may undo that.
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

/// The range of a variable's samples.
struct StepRange {
  double min = 0, max = 0;
};

/// The facts about a new step besides its values.
struct NewStep {
  double time = 0;
  std::vector<StepRange> ranges;     // [variable]
  std::vector<std::string> sources;  // files
};

/// Adds a time step to a complete cache: its values on a geometry that the cache has. Files that a killed
/// program left behind are replaced when the step is added again.
class StepWriter : public ValuesWriter {
 public:
  /// `lock` must outlive the writer. `cache`: opened under the lock, at a step of the geometry. `step`: the
  /// new one. Throws Error if a file cannot be created.
  StepWriter(const CacheLock& lock, const CacheReader& cache, NewStep step);
  /// Removes the new files unless finish() has succeeded.
  ~StepWriter() override;
  StepWriter(const StepWriter&) = delete;
  StepWriter& operator=(const StepWriter&) = delete;

  void append(uint32_t brick, std::span<const EncodedValues> values) override;

  /// Adds a file of the step that is complete in the cache's folder. finish() lists it.
  void addFile(const FileInfo& file) { others_.push_back(file); }

  /// Writes the tables, syncs, and puts files and manifest into place. Returns the new files. After an Error
  /// the cache is what it was.
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

/// Adds a step whose files are complete in the cache's folder. `others`: those of them that the manifest
/// will list. `cache`: opened under the lock. Throws Error as StepWriter::finish().
void addWrittenStep(const CacheLock& lock, const CacheReader& cache, SeriesStep step, const NewStep& added,
                    std::span<const FileInfo> others);

/// Adds a step with a geometry of its own: a conversion has put it and its values into the folder
/// geometry.<g> of the cache, where g is the series' next geometry. `cache`: opened under the lock. Throws
/// Error as StepWriter::finish().
void addGeometryStep(const CacheLock& lock, const CacheReader& cache, const NewStep& added);

/// Removes the steps from number `count` on, at least one of which stays. `cache`: opened under the lock. A kill leaves the cache
/// as it was, or without the steps. Throws Error.
void removeStepsFrom(uint64_t count, const CacheLock& lock, const CacheReader& cache);

}  // namespace curvisplat
