// Several files of one instant as one grid: fields of the same nodes in several files, blocks in several
// files, or pieces of an unstructured grid.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/box_source.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Structured files as one grid. A file with the same blocks as an earlier one (their dimensions and their
/// first rows are compared) adds to these blocks the scalars that they lack. The blocks of any other file
/// follow those before. The grid has the scalars that all of its blocks have; a warning names the others.
class CombinedSource final : public BoxSource {
 public:
  /// `names`: the files', for the names of blocks and for messages. Throws Error if a file has the nodes of
  /// an earlier one and no further scalar: it may be another time step.
  CombinedSource(std::vector<std::unique_ptr<GridSource>> sources, const std::vector<std::string>& names);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override;
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override;

 private:
  /// A scalar of a group: the file that has it, and its index there.
  struct Place {
    size_t source = 0;
    uint32_t scalar = 0;
  };
  /// Files of the same nodes. The first one's coordinates and blanking count.
  struct Group {
    std::vector<size_t> sources;
    std::vector<GridScalar> scalars;
    std::vector<Place> places;  // [scalars]
  };

  bool sameNodes(const GridSource& a, const GridSource& b) const;
  size_t addScalars(Group& group, size_t source) const;
  void describe(const std::vector<std::string>& names);
  void readFrom(size_t source, uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                std::span<std::vector<float>* const> to) const;

  std::vector<std::unique_ptr<GridSource>> sources_;
  std::vector<Group> groups_;
  std::vector<std::pair<size_t, uint32_t>> blocks_;  // [block]: its group, and its number there
  std::vector<std::vector<Place>> places_;           // [group][scalar of the description]
  GridDescription description_;
};

/// Unstructured files as the pieces of one mesh: what the processors of a run write. A scalar that a file
/// lacks is NaN there.
class CombinedMeshSource final : public MeshSource {
 public:
  /// `names`: the files', for messages. Throws Error if two have the same points.
  CombinedMeshSource(std::vector<std::unique_ptr<MeshSource>> sources, const std::vector<std::string>& names);

  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override;
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  /// Calls read(source, its piece, its scalars), which returns what it has read, and sorts that into the
  /// order of `scalars`.
  template <typename Read>
  void readOwn(uint32_t piece, uint64_t count, std::span<const uint32_t> scalars, const Read& read) const;

  std::vector<std::unique_ptr<MeshSource>> sources_;
  std::vector<std::pair<size_t, uint32_t>> pieces_;           // [piece]: its source, and its number there
  std::vector<std::vector<std::optional<uint32_t>>> places_;  // [source][scalar of the description]
  GridDescription description_;
};

/// Opens the grid file and the further files of `options` each by itself with `open`, and combines them: all
/// are structured, or all are not.
std::unique_ptr<DataSource> openCombined(
    const OpenGridOptions& options,
    const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open);

}  // namespace curvisplat
