// OpenFOAM cases: constant/polyMesh, moving ones in the folders of times, and fields of cells; ASCII and binary,
// compressed or not; decomposed cases (processor0, processor1, ..., or collated: processors8), which are pieces of one
// mesh. A case that also has its mesh in its own folder is read from there, unless only the processors have the last times.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/cells_of_faces.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/openfoam/foam_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Whether `path` is a case: its folder, or ParaView's empty file NAME.foam in it.
bool isFoamCase(const std::filesystem::path& path);

/// Scalars are the fields of the time step: volScalarField NAME; volVectorField NAME:mag, NAME:x, NAME:y, NAME:z;
/// tensors NAME:0, NAME:1, ... Without fields there are none.
class FoamSource final : public MeshSource {
 public:
  /// Reads the mesh and spools it: numbers of 8 bytes, and the faces of each cell. Fields are spooled when they are
  /// first read. Throws Error if a file is missing or damaged.
  explicit FoamSource(const OpenGridOptions& options);

  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  struct Piece {
    std::filesystem::path folder;  // the case's, a processor's, or that of several (collated)
    uint32_t processor = 0;        // its part of the files of several
    FoamList points;               // 3 numbers each
    FoamFile::Faces faces;
    CellFaces cells;
  };
  struct Field {
    std::string name;
    size_t components = 1;
  };
  struct Scalar {
    size_t field = 0;
    int component = 0;  // -1: the magnitude
  };

  void choosePieces(const std::filesystem::path& folder);
  void findTimes(std::optional<uint32_t> asked, const std::filesystem::path& shown);
  std::filesystem::path meshFile(const std::filesystem::path& folder, const char* name) const;
  FoamFile open(const Piece& piece, const std::filesystem::path& path) const {
    return FoamFile(path, spools_, temporary_folder_, piece.processor);
  }
  void openPiece(Piece& piece);
  void listFacesOfCells(Piece& piece, const FoamList& owner, const FoamList& neighbour);
  void findFields();
  void addField(const std::string& name, size_t components);
  const FoamList& valuesOf(uint32_t piece, size_t field, std::vector<double>& uniform) const;

  ListSpools spools_;
  std::filesystem::path temporary_folder_;
  std::vector<std::string> time_names_;
  std::vector<Piece> pieces_;
  bool decomposed_ = false;
  std::vector<Field> fields_;
  std::vector<Scalar> scalars_;  // [description_.scalars]
  GridDescription description_;
  /// The values of a field in a piece, once they have been read.
  struct Values {
    bool read = false;
    FoamList list;
    std::vector<double> uniform;
  };
  mutable Mutex mutex_;
  mutable std::vector<std::vector<Values>> values_ GUARDED_BY(mutex_);  // [piece][field]
};

}  // namespace curvisplat
