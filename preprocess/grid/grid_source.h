// What a reader offers to conversion: blocks of nodes, read by slabs, with scalars and blanking. One
// implementation a file format. Nothing here holds a whole grid.
//
// Blanking has one place: NodeReader (node_reader.h) lays `--blank` and the non-finite values over what a
// source says.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace curvisplat {

/// Half-open ranges of node indices of one block: all i, j0 <= j < j1, k0 <= k < k1. The unit of reading.
struct NodeBox {
  uint64_t j0 = 0, j1 = 0, k0 = 0, k1 = 0;
};

struct GridBlock {
  std::string name;  // "block 1", or the file's own name for it
  uint64_t ni = 0, nj = 0, nk = 0;
  bool has_blanking = false;
  uint64_t nodes() const { return ni * nj * nk; }
};

/// Where a scalar's values stand.
enum class Centring { kNode, kCell };

struct GridScalar {
  std::string name;                  // "density"; of a vector's components "Velocity:mag", "Velocity:x"
  std::string unit;                  // may be empty
  std::vector<std::string> aliases;  // other names it answers to
  uint32_t number = 0;               // of the variable in its function file, from 1; 0: it has none
  Centring centring = Centring::kNode;
  uint32_t function = 0;  // PLOT3D's number of the quantity; 0: it has none
  bool derived = false;   // not in the files: computed from other scalars and the grid
};

/// The four numbers before a block's values in a PLOT3D Q file.
struct FlowConditions {
  std::string file;
  uint32_t block = 0;
  double mach = 0, alpha = 0, reynolds = 0, time = 0;
};

/// A perfect gas. Nothing: not known.
struct GasModel {
  std::optional<double> gamma;     // ratio of specific heats
  std::optional<double> constant;  // the gas constant R
};

/// What a source is, for `info` and the manifest.
struct GridDescription {
  std::string format;  // "PLOT3D grid + Q, big-endian, C, single precision, 1 block"
  std::vector<std::string> files;
  std::vector<GridBlock> blocks;
  std::vector<GridScalar> scalars;    // all that can be asked for
  std::vector<FlowConditions> flow;   // of every block of every file that tells
  GasModel gas;                       // what the files tell of it
  int coordinate_bytes = 4;           // 4 or 8: the precision of the coordinates as stored
  std::vector<double> times;          // of every time step there is; empty: the files tell of none
  uint32_t time_step = 0;             // the one that was opened, from 0
  std::vector<std::string> warnings;  // "bluntfinq.bin: 484 trailing bytes ignored"
};

/// The nodes of a NodeBox, i fastest, then j, then k. Arrays are resized by the source and keep their
/// capacity. The value of a cell stands at the cell's lowest node, (i, j, k) of its corners (i..i+1, j..j+1,
/// k..k+1); it is NaN where there is no such cell (at the last i, j and k of the block) and where the cell is
/// blanked.
struct NodeArrays {
  std::vector<double> x, y, z;              // world units
  std::vector<uint8_t> blank;               // 1: not there. Always filled
  std::vector<std::vector<float>> scalars;  // [as asked for][node]
};

class GridSource {
 public:
  virtual ~GridSource() = default;

  virtual const GridDescription& description() const = 0;

  /// Reads the nodes of `box` in block number `block`: coordinates, the block's own blanking, and the scalars
  /// whose positions in description().scalars are given. Any number of threads may read at once. Throws Error
  /// naming file and offset.
  virtual void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                    NodeArrays& out) const = 0;
};

}  // namespace curvisplat
