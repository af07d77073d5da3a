// The scalars of a VTK data set: the numeric arrays of the points and cells of its pieces, by name.
//
//   1 component         NAME
//   2 or 3 components   NAME:mag, NAME:x, NAME:y (and NAME:z)
//   more                NAME:0, NAME:1, ...
//
// If points and cells have arrays of the same name, that of the cells is NAME:cell. A file's active arrays
// come first. An array that is missing in some pieces is NaN there, which blanks their samples.
//
// VtkFields is immutable once it has described them, and any number of threads may use it. describeFiles()
// describes what the grids and the meshes of VTK files have in common besides.
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The scalars, and the arrays that they are read from.
class VtkFields {
 public:
  /// An array that occurs in one or more pieces.
  struct Field {
    std::string name;
    Centring centring = Centring::kNode;
    uint32_t components = 1;
    std::vector<int32_t> array_of_piece;  // [piece]: index in the piece's data; -1: missing
  };

  /// Adds the scalars to the description, and a warning for each field that some blocks lack; `blocks`: the
  /// piece of each.
  void describe(const std::vector<VtkPiece>& pieces, std::span<const size_t> blocks,
                GridDescription& description);

  /// The array of a field in a piece; null if it is missing there.
  static const VtkArray* arrayOf(const Field& field, const std::vector<VtkPiece>& pieces, size_t piece);

  /// Calls read(field, wanted components) for each field that some of the scalars belong to: all requested
  /// components of an array are read together. to[n]: where the values of scalars[n] go.
  template <typename Read>
  void forEachWanted(std::span<const uint32_t> scalars, std::vector<std::vector<float>>& to,
                     const Read& read) const {
    std::vector<bool> done(scalars.size());
    for (size_t n = 0; n < scalars.size(); ++n) {
      if (done[n]) continue;
      const size_t field = scalars_.at(scalars[n]).field;
      std::vector<WantedComponent<float>> wanted;
      for (size_t m = n; m < scalars.size(); ++m) {
        if (scalars_.at(scalars[m]).field != field) continue;
        wanted.push_back({scalars_[scalars[m]].component, to[m].data()});
        done[m] = true;
      }
      read(fields_[field], std::span<const WantedComponent<float>>(wanted));
    }
  }

 private:
  struct Scalar {
    size_t field = 0;
    int component = 0;
  };

  void addFields(const std::vector<VtkPiece>& pieces, std::span<const size_t> blocks, Centring centring);
  void addScalars(const std::vector<VtkPiece>& pieces, size_t number, ScalarList& scalars);

  std::vector<Field> fields_;
  std::vector<Scalar> scalars_;  // [description.scalars]
};

/// Adds the format, files, times and warnings of a VtkGrid or a VtkMesh to the description. Moves the
/// warnings out of `data`; one that many pieces give is added once.
template <typename Data>
void describeFiles(Data& data, GridDescription& description) {
  description.format = data.format;
  description.files = data.files;
  description.times = data.times;
  description.time_step = data.time_step;
  for (std::string& warning : data.warnings)
    if (std::find(description.warnings.begin(), description.warnings.end(), warning) ==
        description.warnings.end())
      description.warnings.push_back(std::move(warning));
}

}  // namespace curvisplat
