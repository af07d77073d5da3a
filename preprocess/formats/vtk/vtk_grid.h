// The result of all readers of VTK files, and the input of VtkSource: pieces, each with its nodes and arrays,
// and the blocks into which they are divided.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "preprocess/formats/common/open_files.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/vtk/vtk_array.h"
#include "preprocess/formats/vtk/vtk_extent.h"

namespace curvisplat {

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
  std::vector<VtkArray> point_data, cell_data;        // one tuple per node, per cell
  std::optional<VtkArray> point_ghosts, cell_ghosts;  // vtkGhostType
  std::optional<VtkArray> visible;                    // one value per node; 0 hides it
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

/// Adds an array to the piece: vtkGhostType becomes its ghosts, obsolete ghost levels are dropped, all others
/// become data. A second array of the same name is ignored with a warning.
void addDataArray(VtkPiece& piece, bool of_cells, VtkArray array, std::vector<std::string>& warnings);

}  // namespace curvisplat
