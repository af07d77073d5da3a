// The state of an unfinished conversion, for the one that resumes it: its input, its temporary folder and,
// where splats are on disk, where they are (ScatteredSplats, which also carries them from the passes up to
// "seams" to those that build). The journal is a JSON file with a checksum in the partial folder, replaced
// atomically; only the version of the program that wrote it reads it.
//
// While scatter runs, the journal is written from time to time with what has been scattered so far
// (timedNotes()). One thread calls.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/overset/block_owners.h"

namespace curvisplat {

/// The result of the passes up to "seams" for those that build: the splats on disk, and what is known of
/// them.
struct ScatteredSplats {
  GridSurvey survey;
  ScatterCounts counts;
  uint64_t merged_nodes = 0;
  std::string overlap;                    // Manifest::overlap
  std::vector<WallSide> thin_walls = {};  // of walls.bin
  BucketTree tree;       // with contents, as it was scattered by: before any bucket was divided
  BucketChains buckets;  // of the temporary file
  std::vector<BucketChains> buckets_of_ranks = {};  // from rank 1 on, where several have scattered
  std::vector<double> sample = {};                  // ValueSample::rows(); not in the journal
  std::string sample_file = {};                     // of it, in the scratch folder: megabytes
  std::optional<ScatterState> unfinished;           // not all splats are there: how far scatter had come

  uint64_t temporaryBytes() const {
    uint64_t bytes = buckets.size;
    for (const BucketChains& of_rank : buckets_of_ranks) bytes += of_rank.size;
    return bytes;
  }
};

/// Notes of a scatter pass for a run that goes on from there; that run reads the slabs that were done
/// again, but makes only those of their splats that wait for the seams. Notes are due every `interval`, or
/// less often: writing them takes a twentieth of the time at most. `write` gets what there is to note.
/// `from`: see ScatterNotes; must outlive them.
ScatterNotes timedNotes(std::chrono::milliseconds interval, const ScatterState* from,
                        const std::function<void(const ScatterState&)>& write);

/// The file of splats that an interrupted scatter has left, to append to. Throws LostBuckets if it is
/// damaged, or was made with more memory than `plan` has.
std::unique_ptr<BucketFile> openScattered(const std::filesystem::path& file, const ScatteredSplats& left,
                                          const MemoryPlan& plan);

/// Writes the sample to a new file in the scratch folder, and names it for the journal.
void writeSample(const std::filesystem::path& scratch, ScatteredSplats& splats);
/// Reads the sample that a journal names. Throws Error if the file is missing or has changed.
void readSample(const std::filesystem::path& scratch, ScatteredSplats& splats);

inline constexpr const char* kJournalName = "journal";

/// Something that the cache's bytes depend on, in words.
struct ConversionFact {
  std::string what, value;
  bool operator==(const ConversionFact&) const = default;
};

/// All such things: program, files as they are now, layout, scalars, blank value, overlaps. Not memory and
/// threads.
std::vector<ConversionFact> factsOf(const GridDescription& description, const std::vector<uint32_t>& scalars,
                                    std::optional<double> blank_value, Overlap overlap);

/// "" or, in words, the first fact in which two conversions differ.
std::string differenceOf(const std::vector<ConversionFact>& before, const std::vector<ConversionFact>& now);

struct ConversionJournal {
  std::vector<ConversionFact> facts;
  std::filesystem::path scratch;  // the folder of temporary files
  std::optional<ScatteredSplats> splats;
};

/// The journal as bytes, and back: nullopt unless this version of the program has written them.
std::string journalText(const ConversionJournal& journal);
std::optional<ConversionJournal> journalFrom(const std::string& bytes);

/// Throws Error if the disk fails.
void writeJournal(const std::filesystem::path& folder, const ConversionJournal& journal);

/// The journal in `folder`; none if there is no whole one that this program has written. Throws Error if the
/// disk fails.
std::optional<ConversionJournal> readJournal(const std::filesystem::path& folder);

}  // namespace curvisplat
