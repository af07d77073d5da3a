// The grids that readers of VTK files give to VtkSource: a VtkGrid of pieces, each with its nodes and
// arrays, and the blocks into which the pieces are divided.
//
// A piece has an extent, a box of node indices. Where the extents of pieces overlap (by ghost levels),
// ownedParts() gives each cell to one piece; where patches of an AMR set overlap, refinedCellsOf() finds the
// cells that finer patches cover. A VtkArray describes numbers of any type and encoding without holding
// them: readTuples() fetches a range of tuples.
//
// Memory grows with the number of pieces and arrays, not with their numbers. Any number of threads may read
// arrays, each with a buffer of 256 KiB.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_set>
#include <variant>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"

namespace curvisplat {

/// Node indices i0 i1 j0 j1 k0 k1, both ends inclusive.
struct VtkExtent {
  std::array<int64_t, 3> lower{}, upper{};

  uint64_t nodesAlong(size_t axis) const { return static_cast<uint64_t>(upper[axis] - lower[axis] + 1); }
  uint64_t nodes() const { return nodesAlong(0) * nodesAlong(1) * nodesAlong(2); }
  /// Number of cells by VTK's rule: a flat extent has one layer of cells.
  uint64_t cells() const;
  bool isFlat() const;
  std::string describe() const;  // "33x33x16"
  bool operator==(const VtkExtent&) const = default;
};

inline constexpr size_t kMaxVtkPieces = 100'000;

/// The extent with these ends (i0 i1 j0 j1 k0 k1); nullopt if they are none, or of an unreasonable size.
std::optional<VtkExtent> extentWith(std::span<const double> ends);

/// Cuts pieces that may overlap (by ghost levels) into parts that cover each cell once: a cell in several
/// pieces belongs to the first of them. Returns [piece] -> its parts, none if other pieces own all its
/// cells. Throws Error if a piece would be cut into unreasonably many parts.
std::vector<std::vector<VtkExtent>> ownedParts(const std::vector<VtkExtent>& pieces);

/// A patch of an AMR set (.vth, .vthb): a box of cells of its level's lattice. Finer patches cover coarser
/// ones.
struct AmrPatch {
  size_t level = 0;
  VtkExtent cells;  // in the lattice of its level, both ends inclusive
};

inline constexpr size_t kMaxAmrPatches = 20'000, kMaxAmrLevels = 64;

/// How many cells of the next level lie along a cell of `level`. Throws Error unless these are whole numbers.
std::array<int64_t, 3> refinementOf(const std::string& file, size_t level, std::span<const double> ratio);

/// Returns for each patch the cells that patches of the next level cover, with indices from the patch's
/// first cell. `ratios[level]` is the number of cells of the next level along a cell. A cell that is covered
/// in part is not hidden.
std::vector<std::vector<VtkExtent>> refinedCellsOf(const std::vector<AmrPatch>& patches,
                                                   const std::vector<std::array<int64_t, 3>>& ratios);

/// The type of an array's numbers.
enum class VtkType : uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64
};

size_t bytesOf(VtkType type);

/// An array of a VTK file: tuples of numbers, of any type and encoding.
struct VtkArray {
  std::string name;
  VtkType type = VtkType::kFloat32;
  uint32_t components = 1;
  uint64_t tuples = 0;
  ByteOrder order = ByteOrder::kLittle;
  std::shared_ptr<const ByteSource> bytes;
  std::vector<std::string> component_names;  // empty, or one for each component

  uint64_t tupleBytes() const { return components * bytesOf(type); }
};

/// Limit that keeps a tuple within the buffer of a reading thread.
inline constexpr uint32_t kMaxComponents = 4096;

/// A component, or the magnitude, of an array's tuples, and its destination.
template <typename Value>
struct WantedComponent {
  int component = 0;  // or kMagnitude (scalar_list.h): the Euclidean norm of the tuple
  Value* to = nullptr;
};

/// Reads tuples [first, first + count), each wanted component to its to[0 .. count). Value: double or float.
/// Throws Error as the array's bytes do. Needs a buffer of 256 KiB per thread.
template <typename Value>
void readTuples(const VtkArray& array, uint64_t first, uint64_t count,
                std::span<const WantedComponent<Value>> wanted);

extern template void readTuples(const VtkArray&, uint64_t, uint64_t,
                                std::span<const WantedComponent<double>>);
extern template void readTuples(const VtkArray&, uint64_t, uint64_t, std::span<const WantedComponent<float>>);

/// Parses the `count` numbers of the array `name` and passes them to `sink` as `type` in the machine's byte
/// order. Throws Error if there are fewer, or if one is not a number of that type.
void packNumbers(TextReader& text, const std::string& name, uint64_t count, VtkType type,
                 const SpoolFile::Sink& sink);

/// The nodes of a uniform grid: origin + direction (spacing * index).
struct VtkUniformNodes {
  glm::dvec3 origin{0}, spacing{1};
  glm::dmat3 direction{1};
};
/// The nodes of a rectilinear grid: the coordinates along i, j and k.
using VtkAxes = std::array<VtkArray, 3>;
/// The nodes of a curvilinear grid: three components per node.
using VtkPoints = VtkArray;

struct VtkPiece {
  VtkExtent extent;
  std::variant<VtkPoints, VtkAxes, VtkUniformNodes> nodes;
  std::vector<VtkArray> point_data, cell_data;              // one tuple per node, per cell
  std::unordered_set<std::string> point_names, cell_names;  // of these arrays
  std::optional<VtkArray> point_ghosts, cell_ghosts;        // vtkGhostType
  std::optional<VtkArray> cell_levels;                      // vtkGhostLevels: above 0 another piece's
  std::optional<VtkArray> visible;                          // one value per node; 0 hides it
  std::vector<VtkExtent>
      refined;  // cells that finer patches of an AMR set cover: indices from the piece's first cell
  std::string active_point_data, active_cell_data;  // names of arrays; may be empty
};

/// A block: a whole piece, or a part of one.
struct VtkBlock {
  std::string name;
  size_t piece = 0;
  VtkExtent extent;
};

/// The result of all readers of structured VTK files, and the input of VtkSource.
struct VtkGrid {
  std::string format;
  std::vector<std::string> files;
  std::vector<VtkPiece> pieces;
  std::vector<VtkBlock> blocks;
  std::vector<double> times;
  uint32_t time_step = 0;
  std::vector<std::string> warnings;
};

/// Resources shared by all files of a grid.
struct VtkFiles {
  explicit VtkFiles(std::filesystem::path temporary_folder)
      : spool(std::make_shared<SpoolFile>(std::move(temporary_folder))) {}

  std::shared_ptr<OpenFiles> pool = std::make_shared<OpenFiles>();
  std::shared_ptr<SpoolFile> spool;
};

/// Adds an array to the piece: vtkGhostType becomes its ghosts and vtkGhostLevels, of VTK before 7, its levels (those of points
/// are dropped), all others become data. A second array of the same name is ignored with a warning.
void addDataArray(VtkPiece& piece, bool of_cells, VtkArray array, std::vector<std::string>& warnings);

}  // namespace curvisplat
