// A grid whose faces are in files of their own, as FV3 and FMS write a cubed sphere: NAME.tile1.nc to NAME.tile6.nc,
// with the coordinates (grid_lont and grid_latt, or the corners grid_lon and grid_lat) in the same files or in others
// (grid_spec.tile1.nc ..., or supergrids, supergrid.h). Files whose names have no number belong to every tile.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "preprocess/formats/netcdf/face_source.h"
#include "preprocess/formats/netcdf/netcdf_source.h"

namespace curvisplat {

/// The options of each tile with its files alone; empty if the files are not of several tiles.
std::map<uint32_t, OpenGridOptions> tilesOf(const OpenGridOptions& options);

class TileSource final : public FaceSource {
 public:
  /// Throws Error if a tile cannot be read, or if its dimensions, variables or times are not those of the first.
  explicit TileSource(const std::map<uint32_t, OpenGridOptions>& tiles);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  void readPart(uint32_t block, const CfRange& range, std::span<const uint32_t> scalars,
                NodeArrays& out) const override;
  bool onSphere() const override { return tiles_.front()->onSphere(); }
  std::vector<glm::dvec3> pointsOf(uint32_t block, const CfRange& range) const override;

 private:
  void add(uint32_t number, std::unique_ptr<NetcdfSource> tile);
  /// The tile of a block. Closes the files of the one before: the memory of open ones is that of one tile.
  const NetcdfSource& tileOf(uint32_t block) const;

  std::vector<std::unique_ptr<NetcdfSource>> tiles_;  // [block]
  GridDescription description_;
  mutable std::atomic<uint32_t> open_ = 0;  // the tile read last
};

}  // namespace curvisplat
