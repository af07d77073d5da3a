// Writes the faces of a grid that are drawn as surfaces: the outer faces of its blocks, boundaries with names, and
// index planes that were asked for.
//
//   FaceSpool         nodes of the faces, read from the grid in one pass
//   AbuttingFaces     quads that another block closes: they are not drawn, unless a boundary has them
//   BlankFaces        faces between drawn and blanked cells, in a file of their own
//   writePatches      levels of detail, one face after the other
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

/// Nodes of one index along an axis, of a block or of all. The index is that of the files' grid, whose cells may be cut
/// (Refinement), or of the cut one.
struct IndexPlane {
  std::optional<uint32_t> block;
  int axis = 0;
  uint64_t index = 0;
  bool is_of_parts = false;  // whether the index counts the planes of the cut grid
  bool operator==(const IndexPlane&) const = default;
};

struct FacesJob {
  std::filesystem::path output;       // faces.bin
  std::filesystem::path temporary;    // folder
  glm::dvec3 lower{0.0}, upper{0.0};  // of the grid
  std::vector<IndexPlane> planes;
  std::vector<uint32_t> variables;  // their numbers in the cache
  uint64_t sort_bytes = 0;
  std::filesystem::path blanks = {};  // faces.blanks.bin; empty: not wanted, or nothing is blanked

  /// The halo of the slabs that the pass reads.
  Halo halo() const;
};

/// The manifest's entries of the files; none, and no file, where there is no face to draw.
struct FacesFiles {
  std::optional<FileInfo> faces, blanks;
};

/// The disk space that the pass takes besides the result.
uint64_t temporaryBytesOfFaces(const GridDescription& grid, std::span<const IndexPlane> planes,
                               size_t scalars);

/// The most memory that the pass takes besides its slabs: grows with the length of faces, also where they are
/// narrow.
uint64_t memoryOfFaces(const GridDescription& grid, std::span<const IndexPlane> planes);

/// Throws Error for a plane that is not in the grid: which indices there are.
void checkPlanes(const GridDescription& grid, std::span<const IndexPlane> planes);

/// The bytes depend neither on threads nor on memory. Throws Error if the disk fails or the faces do not fit in memory.
FacesFiles writeGridFaces(const NodeReader& reader, const FacesJob& job, const SlabBuffers& slabs,
                          Progress& progress);

}  // namespace curvisplat
