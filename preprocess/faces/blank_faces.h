// The faces between drawn and blanked cells of a grid, as a surface: a sea's floor and coasts, a body that iblank cuts
// out. faces.blanks.bin has them, in the form of faces.bin (stream/FORMAT.md).
//
//   slabs --add()--> quads, sorted by plane and row --write()--> strips of quads, 32 in a patch
//
// Strips, since such a face lies in many planes, with few quads in each. There are no levels of detail: where a floor
// slopes, a plane has a narrow strip of it, which a coarser lattice would lose.
// Memory: `sort_bytes`, and a patch. The bytes depend neither on memory nor on threads.
#pragma once

#include <filesystem>
#include <optional>

#include "preprocess/coincidence/record_sorter.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

class BlankFaces {
 public:
  static constexpr Halo kHalo = kNodeHalo;  // of the slabs

  BlankFaces(const FaceBox& box, uint64_t sort_bytes, const std::filesystem::path& temporary);

  /// Adds the quads whose lowest nodes are in the slab's box. In parallel; one thread calls.
  void add(const LoadedSlab& loaded, const GridBlock& block, bool of_cells);
  /// Returns the manifest's entry; none, and no file, if there is no quad.
  std::optional<FileInfo> write(const std::filesystem::path& output, const Progress& progress);

 private:
  const FaceBox box_;
  RecordSorter quads_;
};

}  // namespace curvisplat
