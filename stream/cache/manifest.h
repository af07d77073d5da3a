// manifest.json: describes a cache's contents, for people and for the reader; stream/FORMAT.md lists its
// keys. It is written last, by rename: a cache folder without it is unfinished.
//
// The manifest names the features of the cache; a reader must know those that it requires. They also say how
// the cells at the borders of the cache are drawn (borderStyleOf()). Plain data and pure functions: any
// thread may use them.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/globe.h"
#include "stream/model/octree.h"
#include "stream/model/refinement.h"

namespace curvisplat {

/// A variable: a scalar as the cache holds it.
struct VariableInfo {
  uint32_t number = 0;      // var.<number>.bin
  std::string name;         // unique in the cache
  std::string unit;         // may be empty
  double min = 0, max = 0;  // of the samples' values, before merging
};

/// One time step. A manifest lists the first; a series has the others in steps.bin (series.h).
struct StepInfo {
  double time = 0;  // in Manifest::time_unit
  std::string geometry = "geometry.bin";
  std::vector<uint32_t> variables;  // VariableInfo::number of each
};

/// Scalars that have values at other samples than the cache's own variables. They form a cache of their own,
/// with the geometry of these samples, in a folder of the cache (ownBlanksFolderName() in series.h).
struct OwnBlanks {
  std::vector<std::string> variables;  // names; those of all sets and the cache's own are distinct
  uint64_t checksum = 0;  // of all bytes of the folder's manifest; with kOwnBlanksOfSteps firstStepChecksum()
};

/// Size and checksum (64-bit XXH3) of one of the cache's files. A payload file's checksum covers the table
/// of its streams' checksums instead of the streams themselves, so that opening a cache reads no payloads.
struct FileInfo {
  std::string name;
  uint64_t size = 0;
  uint64_t checksum = 0;
};

/// A block of the grid, with its numbers of nodes along i, j and k.
struct BlockInfo {
  std::string name;
  uint64_t ni = 0, nj = 0, nk = 0;
};

/// Thrown for a splat cache whose format version this program does not read.
class OtherVersion : public Error {
 public:
  using Error::Error;
};

// The features of caches. A reader must know those that a cache requires. Only caches of version 2 have
// features; apart from these, they are like caches of version 1. border_code.h and growth_code.h are in
// stream/model.
inline constexpr const char* kBorderFaces = "border-faces";  // borders are cut at faces (border_code.h)
inline constexpr const char* kCellGrowth = "cell-growth";    // kernels are skewed (growth_code.h)
inline constexpr const char* kMergedBorders =
    "merged-borders";  // merged splats are cut at faces (border_code.h), and have an even blur
inline constexpr const char* kFaceLayers =
    "face-layers";  // cells in the layer behind a face are cut at it, too (border_code.h)
inline constexpr const char* kPlates =
    "plates";  // merged splats between two faces are drawn as thin (border_code.h)
inline constexpr const char* kBorderPairs =
    "border-pairs";                             // cells at faces are drawn as two splats (border_code.h)
inline constexpr const char* kSteps = "steps";  // a series of time steps (series.h)
/// Splats at nodes beside blanked ones lack the octants of their cells that lie in cells with a blanked node
/// (preprocess/splats/node_splats.h). A reader need not do anything, but a program that adds scalars has to
/// make the same splats.
inline constexpr const char* kCellOctants = "cell-octants";
/// Some scalars have values at other samples: Manifest::own_blanks. A program that does not know the feature
/// would miss them.
inline constexpr const char* kOwnBlanks = "own-blanks";
/// The caches of kOwnBlanks have time steps, too: those of the cache that they lie in, unless a set ends
/// earlier. While a step is being added, a set may have one more.
inline constexpr const char* kOwnBlanksOfSteps = "own-blanks-steps";

// Values of Manifest::overlap.
inline constexpr const char* kOverlapAll = "all";      // every block is drawn
inline constexpr const char* kOverlapOwner = "owner";  // each point is drawn once (preprocess/overset)
inline constexpr const char* kOverlapNone = "none";    // as kOverlapOwner, but no blocks overlap

// Values of Manifest::stretch.
inline constexpr const char* kSteepStretch = "steep";  // by StretchFit::kSteep (preprocess/splats/stretch.h)
/// Steep as well, and splats weigh as much as their dual cells (preprocess/splats/dual_cell.h), collapsed
/// ones have their shape, and rows go on across joints (preprocess/seams/joined_rows.h).
inline constexpr const char* kDualCells = "dual-cells";
/// Dual cells as well, and splats are fitted to how long cells are across their faces (CellLengths in
/// preprocess/splats/stretch.h), no longer to lengths of grid lines.
inline constexpr const char* kCellWidths = "cell-widths";
/// Splats of a mesh's points are fitted where nodes hang (preprocess/moments/mesh_splats.h).
inline constexpr const char* kHangingNodes = "hanging-nodes";

/// The contents of manifest.json.
struct Manifest {
  std::vector<std::string> requirements;  // "requires"; none: version 1
  std::string title;
  std::string program;               // the program that wrote it: "curvisplat 0.1.0"
  std::vector<std::string> sources;  // the input files, as given
  std::string reader;                // the input's layout and options, as text
  RootCube root;
  glm::dvec3 lower{0.0}, upper{0.0};  // bounding box of the grid's nodes, world units
  std::vector<BlockInfo> blocks;
  bool cells = false;     // samples are the grid's cells, not its nodes; runs name a cell by its lowest node
  Refinement refinement;  // of the cells of the files' grid
  uint64_t nodes = 0;     // samples of the grid: nodes, or cells
  uint64_t blanked_nodes = 0;  // samples that are not drawn: iblank, --blank or not finite
  uint64_t splats = 0;         // at the finest level
  uint64_t bricks = 0;
  uint32_t levels = 0;  // deepest level + 1
  double volume = 0;    // sum of the finest level's weights
  /// How overlapping blocks of the grid were treated: kOverlapAll, ...; empty if it has one block, or if that
  /// is not known.
  std::string overlap;
  std::string
      stretch;  // how splats are made where cells grow: kCellWidths, kDualCells, ...; empty: by StretchFit::kGentle
  bool hasDualCells() const { return stretch == kDualCells || stretch == kCellWidths; }
  bool isSteep() const { return stretch == kSteepStretch || hasDualCells(); }
  std::optional<uint64_t> grid_checksum;  // of coordinates and blanking: steps in which it is the same share
                                          // their geometry (preprocess/survey/grid_survey.h)
  std::string time_unit;       // of the steps' times, such as "days since 1900-01-01"; may be empty
  std::string calendar;        // of the time unit, by the CF conventions; may be empty
  std::optional<Globe> globe;  // that has placed the nodes of a grid in degrees, or of another map
  std::vector<VariableInfo> variables;
  std::vector<StepInfo> steps;
  std::vector<OwnBlanks> own_blanks;  // empty without kOwnBlanks
  std::vector<FileInfo> files;        // all files of the cache's folder but the manifest; none of subfolders

  /// The variable, the file of that name; null if the cache has none. The manifest keeps it.
  const VariableInfo* variable(std::string_view name) const;
  const FileInfo* file(std::string_view name) const;
  bool hasFeature(const char* feature) const;
  /// Whether the grid is unstructured: its samples are one row, or two of cells that are two splats each (FORMAT.md).
  bool isMesh() const;
  /// Whether the slopes in the records of bricks are those of earlier programs, which drawn ones may exceed
  /// by the factor kEarlierSlopes (border_code.h).
  bool hasEarlierSlopes() const { return hasFeature(kBorderFaces) && !hasFeature(kMergedBorders); }

  std::string toJson() const;
  /// Throws an Error that names `path` if a field is missing, of the wrong type or out of range, or if a
  /// file's name is not a plain name. Throws OtherVersion if the program does not read this version, or does
  /// not know a feature that the cache requires.
  static Manifest fromJson(const std::string& text, const std::filesystem::path& path);
};

/// How finely values are stored (stream/codec/values_codec.h).
enum class ValuePrecision;
/// The precision of the cache's values, including those that are added later.
ValuePrecision precisionOf(const Manifest& manifest);

/// How the cells at the borders of a cache are drawn, by its centring and its features.
inline BorderStyle borderStyleOf(const Manifest& manifest) {
  if (!manifest.cells) return kHalfCellStyle;
  return manifest.hasFeature(kBorderPairs) ? kWholeCellPairs : kWholeCellStyle;
}

}  // namespace curvisplat
