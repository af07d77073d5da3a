// What the readers of VTK's files make of them: pieces, each with its nodes and arrays, and the blocks that
// they are. VtkSource reads it.
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
/// Those of a rectilinear one: the coordinates along i, j and k.
using VtkAxes = std::array<VtkArray, 3>;
/// Those of a curvilinear one: three components a node.
using VtkPoints = VtkArray;

struct VtkPiece {
  VtkExtent extent;
  std::variant<VtkPoints, VtkAxes, VtkUniformNodes> nodes;
  std::vector<VtkArray> point_data, cell_data;        // of as many tuples as there are nodes, cells
  std::optional<VtkArray> point_ghosts, cell_ghosts;  // vtkGhostType
  std::optional<VtkArray> visible;                    // of the nodes: 0 hides
  std::string active_point_data, active_cell_data;    // names of arrays; may be empty
};

/// A block: all of a piece, or a part.
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

/// What all files of a grid share.
struct VtkFiles {
  explicit VtkFiles(std::filesystem::path temporary_folder)
      : spool(std::make_shared<SpoolFile>(std::move(temporary_folder))) {}

  std::shared_ptr<OpenFiles> pool = std::make_shared<OpenFiles>();
  std::shared_ptr<SpoolFile> spool;
};

/// Puts an array where it belongs: vtkGhostType into the piece's ghosts, old ghost levels nowhere, the others
/// into its data, unless one of that name is there.
void addDataArray(VtkPiece& piece, bool of_cells, VtkArray array, std::vector<std::string>& warnings);

}  // namespace curvisplat
