// GridSource, the interface that readers of structured grids offer to conversion: blocks of nodes, read by
// boxes of rows, with scalars and blanking. Each file format has one implementation. No source holds a
// whole grid in memory, and any number of threads may read one.
//
// A source reports only the blanking in its files. NodeReader (node_reader.h) adds `--blank` and non-finite
// values. The functions at the end are shared by the readers of all formats: they compare names of scalars
// and choose a time step.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/model/globe.h"
#include "stream/model/refinement.h"

namespace curvisplat {

/// Half-open ranges of node indices of one block, the unit of reading: j0 <= j < j1, k0 <= k < k1, and all
/// i, or i0 <= i < i1 of each row.
struct NodeBox {
  uint64_t j0 = 0, j1 = 0, k0 = 0, k1 = 0;
  uint64_t i0 = 0, i1 = UINT64_MAX;  // i1 above the block's ni: to the end of the row

  bool hasWholeRows(uint64_t ni) const { return i0 == 0 && i1 >= ni; }
  uint64_t endOfRow(uint64_t ni) const { return i1 < ni ? i1 : ni; }
  /// Nodes of a row, in a block of `ni` along i.
  uint64_t rowNodes(uint64_t ni) const { return endOfRow(ni) - i0; }
};

/// A structured block of ni x nj x nk nodes.
struct GridBlock {
  std::string name;  // "block 1", or the file's own name for it
  uint64_t ni = 0, nj = 0, nk = 0;
  bool has_blanking = false;
  uint64_t nodes() const { return ni * nj * nk; }
};

/// A part of an unstructured grid, with points and cells of its own.
struct MeshPiece {
  std::string name;  // "piece 1", or the file's own name for it
  std::string file;  // for messages
  uint64_t points = 0, cells = 0;
};

/// The places of a scalar's samples: nodes or cells.
enum class Centring { kNode, kCell };

/// A scalar that a source can read.
struct GridScalar {
  std::string name;                  // "density"; for vectors "Velocity:mag", "Velocity:x", ...
  std::string unit;                  // may be empty
  std::vector<std::string> aliases;  // alternative names, simplified (simplifiedName())
  uint32_t number = 0;               // of the variable in its PLOT3D function file, from 1; 0: none
  Centring centring = Centring::kNode;
  uint32_t function = 0;  // PLOT3D's function number; 0: none
  bool derived = false;   // computed from other scalars and the grid instead of read
};

/// The four numbers before a block's values in a PLOT3D Q file.
struct FlowConditions {
  std::string file;
  uint32_t block = 0;
  double mach = 0, alpha = 0, reynolds = 0, time = 0;
};

/// A perfect gas; nullopt where unknown.
struct GasModel {
  std::optional<double> gamma;     // ratio of specific heats
  std::optional<double> constant;  // the gas constant R
};

/// A boundary condition: nodes of a block that have a name. Indices from 0, the last included.
struct GridBoundary {
  std::string name, type;  // "Wing", "BCWallViscous"
  uint32_t block = 0;
  std::array<uint64_t, 3> first{}, last{};  // i, j, k; equal along the axis of its face
};

/// The metadata of a source, for `info` and the manifest.
struct GridDescription {
  std::string format;  // "PLOT3D grid + Q, big-endian, C, single precision, 1 block"
  std::vector<std::string> files;
  std::vector<GridBlock> blocks;    // of a structured grid
  std::vector<MeshPiece> pieces;    // of an unstructured one
  std::vector<GridScalar> scalars;  // all that can be read
  std::vector<GridBoundary> boundaries;
  std::vector<FlowConditions> flow;   // for every block of every file that has them
  GasModel gas;                       // as stored in the files
  int coordinate_bytes = 4;           // 4 or 8: the stored precision of the coordinates
  std::vector<double> times;          // of every time step; empty: the files have none
  uint32_t time_step = 0;             // index of the open one
  std::string time_unit, calendar;    // of the times, by the CF conventions; may be empty
  std::optional<Globe> globe;         // that places its nodes, if the files are of the Earth
  Refinement refinement;              // the parts that cells of the files are cut into
  std::string blanking;               // the files' rule for blanking in words; empty: iblank or the like
  std::string undefined;              // fill values, which are read as NaN: "T = -999"; may be empty
  std::vector<std::string> warnings;  // "bluntfinq.bin: 484 trailing bytes ignored"
  std::vector<std::string> notes;     // further contents: "boundaries BCWall 3, BCInflow 1"
};

/// The nodes of a NodeBox, i fastest, then j, then k. The source resizes the arrays, which keep their
/// capacity. The value of a cell is stored at its lowest node: (i, j, k) for the cell with the corners
/// i..i+1, j..j+1, k..k+1. It is NaN where there is no such cell (at the last i, j or k of the block) and
/// where the cell is blanked.
struct NodeArrays {
  std::vector<double> x, y, z;              // world units
  std::vector<uint8_t> blank;               // 1: blanked; always filled
  std::vector<std::vector<float>> scalars;  // [requested scalar][node]
};

/// Opened files: a structured grid (GridSource) or an unstructured one (MeshSource, preprocess/mesh).
class DataSource {
 public:
  virtual ~DataSource() = default;
  virtual const GridDescription& description() const = 0;
};

/// A structured grid, read by boxes of nodes.
class GridSource : public DataSource {
 public:
  /// Reads the nodes of `box`, which has whole rows, in block number `block`: coordinates, the block's own
  /// blanking, and the scalars with the given indices in description().scalars. Any number of threads may
  /// read concurrently. Throws Error with the file and the offset.
  virtual void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                    NodeArrays& out) const = 0;
  /// Reads as read() does, but parts of rows: `out` gets box.rowNodes() nodes of each row. The default reads
  /// whole rows, one after the other.
  virtual void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                              NodeArrays& out) const;
  /// The number of whole rows that readPartOfRows() holds in memory beside `out`: 0 if it reads the parts
  /// alone.
  virtual uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const { return 1; }
  /// Reads which nodes of the box, which has whole rows, are fringe: interpolated from another block (a
  /// negative iblank). Fills `out` with 1 or 0 for each and returns true; returns false if the grid has no
  /// such marks. Threads and errors are as for read().
  virtual bool readFringe(uint32_t /*block*/, const NodeBox& /*box*/, std::vector<uint8_t>& /*out*/) const {
    return false;
  }
  /// Reads as readFringe() does, but parts of rows. It reads whole rows, one after the other.
  bool readFringePart(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const;
};

/// Reads a box of whole rows or of parts of them.
inline void readBox(const GridSource& source, uint32_t block, const NodeBox& box,
                    std::span<const uint32_t> scalars, NodeArrays& out) {
  if (box.hasWholeRows(source.description().blocks.at(block).ni))
    source.read(block, box, scalars, out);
  else
    source.readPartOfRows(block, box, scalars, out);
}

/// The name in lower case without spaces, underscores and hyphens, in which files, programs and users
/// differ.
std::string simplifiedName(const std::string& name);

/// Whether `simple` (a simplified name) is the scalar's name or one of its aliases.
bool answersTo(const GridScalar& scalar, const std::string& simple);

/// The step that the user chose, or the first. Throws Error if `file` has no such step; a file without times
/// has a single step.
uint32_t chosenTimeStep(const std::string& file, std::span<const double> times,
                        std::optional<uint32_t> asked);

/// "3 time steps from 0 to 2.5", followed by their dates if the unit has them; nullopt if there is a single step.
std::optional<std::string> timesText(const GridDescription& description);

/// A note for users who have not chosen between several steps: "3 time steps from 0 to 2.5; using the first:
/// choose with --time-step 0..2". nullopt if there is a single step, or if the user chose one.
std::optional<std::string> timeStepNote(const GridDescription& description, std::optional<uint32_t> asked);

/// The time that the files state for the open step: that of the step, or that in the Q file's header unless
/// it is 0, which many programs write for all steps.
std::optional<double> statedTime(const GridDescription& description);

}  // namespace curvisplat
