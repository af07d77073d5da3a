// The state of an unfinished conversion, for the one that resumes it: its input, its temporary folder and,
// where splats are on disk, where they are. A JSON file with a checksum in the partial folder, replaced
// atomically. Only the version of the program that wrote it reads it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/scattered_splats.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/overset/block_owners.h"

namespace curvisplat {

inline constexpr const char* kJournalName = "journal";

/// Something that the cache's bytes depend on, in words.
struct ConversionFact {
  std::string what, value;
  bool operator==(const ConversionFact&) const = default;
};

/// All such things: program, files as they are now, layout, scalars, blank value, overlaps. Not memory and threads.
std::vector<ConversionFact> factsOf(const GridDescription& description, const std::vector<uint32_t>& scalars,
                                    std::optional<double> blank_value, Overlap overlap);

/// "" or, in words, the first fact in which two conversions differ.
std::string differenceOf(const std::vector<ConversionFact>& before, const std::vector<ConversionFact>& now);

struct ConversionJournal {
  std::vector<ConversionFact> facts;
  std::filesystem::path scratch;  // the folder of temporary files
  std::optional<ScatteredSplats> splats;
};

/// The journal as bytes, and back: none if they are not what this program has written.
std::string journalText(const ConversionJournal& journal);
std::optional<ConversionJournal> journalFrom(const std::string& bytes);

/// Throws Error if the disk fails.
void writeJournal(const std::filesystem::path& folder, const ConversionJournal& journal);

/// The journal in `folder`; none if there is no whole one that this program has
/// written. Throws Error if the disk fails.
std::optional<ConversionJournal> readJournal(const std::filesystem::path& folder);

}  // namespace curvisplat
