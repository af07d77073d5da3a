// A PLOT3D grid with its Q and function files, as a GridSource; or the files that a .p3d file lists. The
// layout of each file is detected when it is opened (plot3d_detect.h); reads go by position, and any number
// of threads may read.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/plot3d/plot3d_file.h"
#include "preprocess/grid/box_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Scalars by kind of file:
///
///   Q          density, momentum_x, momentum_y, momentum_z, energy
///   OVERFLOW   the same, gamma, species_1, ..., turbulence_1, ...
///   function   the names in its .nam file (in the same directory, one per line), else 1, 2, ...
///
/// A name that occurs in two files becomes FILE:NAME, FILE being the stem of the file.
class Plot3dSource final : public BoxSource {
 public:
  /// Detects the layout of every file. Throws Error.
  explicit Plot3dSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override;

 private:
  struct Component {
    size_t file = 0;  // index into solutions_
    uint32_t component = 0;
  };

  Plot3dFile openGridFile(const OpenGridOptions& options);
  void addSolution(const std::filesystem::path& path, const OpenGridOptions& options);
  void addOverflowScalars(const Plot3dFile& file);
  void addFunctionNames(const std::filesystem::path& path, const Plot3dFile& file);
  void describe(const std::filesystem::path& path, const Plot3dFile& file);
  void makeNamesUnique();

  GridDescription description_;
  std::filesystem::path grid_path_;
  std::vector<std::string> function_names_;
  Plot3dFile grid_;
  std::vector<Plot3dFile> solutions_;
  std::vector<std::filesystem::path> solution_paths_;
  std::vector<Component> components_;  // [description_.scalars]
};

/// Whether the file may be a .p3d file: it is text that begins with '{'.
bool isPlot3dMeta(const InputFile& file);

/// Opens the files of the chosen time step of a .p3d file: JSON with ParaView's keys that lists the PLOT3D
/// files of each time step and their layout. Properties that it does not set are detected as usual.
///
///   {"filenames": [{"time": 0.5, "xyz": "a.xyz", "q": "a.q", "function": "a.f"}, ...],
///    "function-names": ["u", ...], "gamma": 1.4, "R": 1, "auto-detect-format": true,
///    "format": "binary", "language": "fortran", "byte-order": "big", "precision": 32, "multi-grid": true,
///    "blanking": false, "2D": false, "functions": [110]}
///
/// options.force overrides the file. A Q or function file that does not exist is left out with a warning.
/// Throws Error with the file and the key.
std::unique_ptr<DataSource> openPlot3dMeta(const OpenGridOptions& options);

}  // namespace curvisplat
