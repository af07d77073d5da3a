// The faces between drawn and blanked cells of a grid, as a surface: a sea's floor and coasts, a body that iblank cuts
// out. faces.blanks.bin has them, in the form of faces.bin (stream/FORMAT.md).
//
//   slabs --add()--> quads, sorted by plane and row --write()--> strips of quads, 32 in a patch
//
// Where blocks meet, a drawn cell of one may have a blanked cell of another beside it: the ends of all cells are matched, and
// those of the drawn ones alone. A quad that abuts on another, but not on a drawn cell's, is such a face.
// They are strips, since such a face lies in many planes, with few quads in each. There are no levels of detail: where a floor
// slopes, a plane has a narrow strip of it, which a coarser lattice would lose.
// Memory: `sort_bytes`, a patch, and two bits for each face at the end of a block. The bytes depend neither on memory nor on threads.
#pragma once

#include <filesystem>
#include <optional>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/coincidence/record_sorter.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/mutex.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

class BlankFaces {
 public:
  static constexpr Halo kHalo = kNodeHalo;  // of the slabs

  /// `sort_bytes`: beside twice the AbuttingFaces::Needs of the grid's blocks.
  BlankFaces(const GridDescription& grid, const FaceBox& box, uint64_t sort_bytes,
             const std::filesystem::path& temporary);

  /// Adds the quads whose lowest nodes are in the slab's box. In parallel; one thread calls.
  void add(const LoadedSlab& loaded, const GridBlock& block, bool of_cells);
  /// Returns the manifest's entry; none, and no file, if there is no quad.
  std::optional<FileInfo> write(const std::filesystem::path& output, const Progress& progress);

 private:
  struct Window;
  void addInside(const Window& window, uint64_t k);
  void addEnds(const Window& window, uint64_t k);
  void addCoastsBetweenBlocks(const Progress& progress);

  const FaceBox box_;
  RecordSorter quads_;
  RecordSorter end_quads_;  // of drawn cells at the ends of blocks; the number of their face beside them
  AbuttingFaces ends_, drawn_ends_;
  Mutex adding_;
};

}  // namespace curvisplat
