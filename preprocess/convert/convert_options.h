// The options of a conversion, and its report.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/overset/block_owners.h"
#include "stream/base/calendar.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/ranks.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {

/// The treatment of scalars that do not have values at the same samples.
enum class DifferingScalars {
  kBlankAll,  // a sample is blanked where any of them has no value
  // Scalars with values at the same samples form a set. The largest set becomes the cache; each other set
  // becomes a cache of its own in the cache's folder (Manifest::own_blanks).
  kKeepApart
};

/// The options of convert(). Only `output` has to be set.
struct ConvertOptions {
  std::filesystem::path output;   // NAME.splats, without a trailing slash
  bool check_disk_space = true;   // before the work
  bool overwrite = false;         // an existing cache is replaced once the new one is complete
  bool resume = false;            // continue an interrupted conversion, if there is one
  bool keep_interrupted = true;   // an interruption leaves finished work for `resume`; false: no files
  std::vector<uint32_t> scalars;  // positions in the source's description; the cache's variables
  DifferingScalars differing = DifferingScalars::kBlankAll;
  std::optional<double> blank_value;                 // samples with this value of any scalar are blanked
  uint64_t memory_bytes = 0;                         // 0: defaultMemory()
  unsigned threads = 0;                              // 0: as many as the machine has
  std::filesystem::path temporary_folder;            // empty: the folder of the output
  std::string full_disk_hint;                        // advice where the disk is full; empty: `convert`'s
  std::vector<std::filesystem::path> given_folders;  // folders that a message of a full disk may name
  std::string title;                                 // empty: the output's name
  std::optional<double> time;                        // of the step; nullopt: the source's, or 0
  std::optional<TimeUnit> time_unit;                 // of `time`; nullopt: the source's
  ValuePrecision precision = ValuePrecision::kAuto;  // of the samples' values
  bool surfaces = true;                              // store the grid's outer faces in the cache
  std::vector<IndexPlane> planes;                    // index planes to store besides, with `surfaces`
  bool blank_faces = false;                          // store the faces of blanked cells, with `surfaces`
  Overlap overlap = Overlap::kOwner;                 // what is drawn where blocks overlap

  /// The processes that convert together. Each calls convert() with the same source and options. Borrowed, never null.
  Ranks* ranks = &oneRank();

  TestLimits limits;  // for tests
};

/// Thrown if no sample of the grid can be drawn.
class NothingToDraw final : public Error {
 public:
  using Error::Error;
};

/// Thrown once the grid has been read, if the scalars do not have values at the same samples: with kBlankAll
/// only if no sample is left that has all of them. The scalars of a cache share its samples, so each would
/// lose values where another has none. With kKeepApart convert() catches it and makes several caches.
class DifferingBlanks final : public Error {
 public:
  /// `lost`: BlankCounts::lost. `is_any_drawn`: whether there is a sample at which all scalars have values.
  DifferingBlanks(std::vector<BlankCounts::Lost> lost, bool is_any_drawn)
      : Error(
            "at no sample do all scalars have a value; convert each to a cache of its own, with --scalar "
            "NAME"),
        lost_(std::move(lost)),
        is_any_drawn_(is_any_drawn) {}
  const std::vector<BlankCounts::Lost>& lost() const { return lost_; }
  bool isAnyDrawn() const { return is_any_drawn_; }

 private:
  std::vector<BlankCounts::Lost> lost_;
  bool is_any_drawn_;
};

/// The folder for temporary files: the one that was chosen, otherwise the one of the output.
inline std::filesystem::path temporaryFolder(const ConvertOptions& options) {
  return options.temporary_folder.empty() ? folderOf(options.output) : options.temporary_folder;
}

/// A file of the cache, and its size.
struct FileReport {
  std::string name;
  uint64_t bytes = 0;
};

/// The results of a conversion, and what was unusual about the grid.
struct ConvertReport {
  Centring centring = Centring::kNode;  // of the scalars: `nodes` and `blanked` count nodes, or cells
  uint64_t nodes = 0;
  BlankCounts blanked;
  uint64_t degenerate = 0;    // splats with an axis of length zero, which got a minimum length
  uint64_t inverted = 0;      // cells of the other handedness than most of their block
  uint64_t merged_nodes = 0;  // nodes on block faces that were merged into the splat of another node
  uint64_t splats = 0, bricks = 0;
  uint32_t levels = 0;
  double volume = 0;             // sum of the finest splats' weights, in cubed world units
  uint64_t temporary_bytes = 0;  // the most bytes in temporary files at a time
  bool resumed = false;          // an interrupted conversion was continued
  uint64_t resumed_bricks = 0;   // bricks that the interrupted one had made
  unsigned threads = 0;          // in use: memory may allow fewer than asked for
  uint64_t memory_bytes = 0;     // the memory limit that was kept
  std::vector<FileReport> files;
  std::vector<std::string> warnings, notes;
};

}  // namespace curvisplat
