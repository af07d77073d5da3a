#include "preprocess/formats/netcdf/open_netcdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/formats/netcdf/fms_mosaic.h"
#include "preprocess/formats/netcdf/joined_faces.h"
#include "preprocess/formats/netcdf/netcdf_source.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"

namespace curvisplat {
namespace {

/// A grid whose faces are in files of their own, as FV3 and FMS write a cubed sphere. The coordinates
/// (grid_lont and grid_latt, or the corners grid_lon and grid_lat) are in the same files or in others
/// (grid_spec.tile1.nc, ..., or supergrids, fms_mosaic.h).
class TileSource final : public FaceSource {
 public:
  /// Throws Error if a tile cannot be read, or if its dimensions, variables or times are not those of the
  /// first.
  explicit TileSource(const std::map<uint32_t, OpenGridOptions>& tiles);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  bool onSphere() const override { return tiles_.front()->onSphere(); }
  std::vector<glm::dvec3> pointsOf(uint32_t block, const CfRange& range) const override;

 private:
  void add(uint32_t number, std::unique_ptr<NetcdfSource> tile);
  /// Whether the tiles are so few and small that all may be open at once.
  bool mayStayOpen() const;
  /// The tile of a block. Closes the files of the one before, unless all may stay open: the memory of open ones is that of one tile.
  const NetcdfSource& tileOf(uint32_t block) const;

  std::vector<std::unique_ptr<NetcdfSource>> tiles_;  // [block]
  GridDescription description_;
  bool stay_open_ = false;
  mutable std::atomic<uint32_t> open_ = 0;  // the tile read last
};

std::string describeNodes(const GridBlock& block) {
  return fmt::format("{} x {} x {} nodes", block.ni, block.nj, block.nk);
}

bool sameNames(const std::vector<GridScalar>& a, const std::vector<GridScalar>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const GridScalar& one, const GridScalar& other) { return one.name == other.name; });
}

std::string namesOf(const std::vector<GridScalar>& scalars) {
  std::vector<std::string> names;
  for (const GridScalar& scalar : scalars) names.push_back(scalar.name);
  return listed(names);
}

/// The options of each tile with its files alone; empty if the files are not of several tiles. Files whose
/// names have no number belong to every tile.
std::map<uint32_t, OpenGridOptions> tilesOf(const OpenGridOptions& options) {
  std::vector<std::filesystem::path> files{options.grid};
  files.insert(files.end(), options.solutions.begin(), options.solutions.end());
  std::map<uint32_t, std::vector<std::filesystem::path>> numbered;
  for (const auto& file : files)
    if (const auto number = tileNumber(file)) numbered[*number].push_back(file);
  if (numbered.size() < 2) return {};
  std::map<uint32_t, OpenGridOptions> tiles;
  for (auto& [number, own] : numbered) {
    for (const auto& file : files)
      if (!tileNumber(file)) own.push_back(file);
    OpenGridOptions tile = options;
    tile.grid = own.front();
    tile.solutions.assign(own.begin() + 1, own.end());
    tiles.emplace(number, std::move(tile));
  }
  return tiles;
}

TileSource::TileSource(const std::map<uint32_t, OpenGridOptions>& tiles) {
  for (const auto& [number, options] : tiles)
    add(number, std::make_unique<NetcdfSource>(options, tiles_.empty() ? nullptr : tiles_.front().get()));
  stay_open_ = mayStayOpen();
}

// The gaps between tiles are read from each tile in turn, a few nodes at a time: to open its files takes a millisecond each time.
bool TileSource::mayStayOpen() const {
  constexpr size_t kFiles = 16;
  constexpr uint64_t kFileBytes = uint64_t{4} << 20;  // of all files: what HDF5 knows of them is less
  constexpr uint64_t kNodes = uint64_t{1} << 16;  // of all tiles: half a MiB of each variable that is read
  uint64_t bytes = 0, nodes = 0;
  for (const std::string& file : description_.files) {
    std::error_code is_no_file;  // a folder of Zarr
    bytes += std::filesystem::file_size(file, is_no_file);
    if (is_no_file) return false;
  }
  for (const GridBlock& block : description_.blocks) nodes += block.nodes();
  return description_.files.size() <= kFiles && bytes <= kFileBytes && nodes <= kNodes;
}

void TileSource::add(uint32_t number, std::unique_ptr<NetcdfSource> tile) {
  const GridDescription& own = tile->description();
  const std::string& file = own.files.front();
  if (own.blocks.size() > 1)
    throw Error("{}: has {} faces in one file; give it alone", file, own.blocks.size());
  if (!tile->placesColumns())
    throw Error(
        "{0}: is one of several tiles, but has no longitude and latitude of each column; give the files that "
        "have them, too (FV3's grid_lont and grid_latt, in grid_spec.tile{1}.nc, or x and y, in "
        "C96_grid.tile{1}.nc)",
        file, number);
  GridBlock block = own.blocks[0];
  block.name = fmt::format("tile {}", number);
  if (tiles_.empty()) {
    description_ = own;
    description_.blocks = {block};
  } else {
    const GridBlock& first = description_.blocks[0];
    if (block.ni != first.ni || block.nj != first.nj || block.nk != first.nk)
      throw Error("{}: has {}; expected {}, as {} has: leave out tiles that are nested in others", file,
                  describeNodes(block), describeNodes(first), first.name);
    if (!sameNames(own.scalars, description_.scalars))
      throw Error("{}: has the variables {}; expected those of {}: {}", file, namesOf(own.scalars),
                  first.name, namesOf(description_.scalars));
    if (own.times != description_.times)
      throw Error("{}: has other times than {}; give the tiles of the same times", file, first.name);
    for (const std::string& path : own.files)
      if (std::find(description_.files.begin(), description_.files.end(), path) == description_.files.end())
        description_.files.push_back(path);
    for (const std::string& warning : own.warnings)
      if (std::find(description_.warnings.begin(), description_.warnings.end(), warning) ==
          description_.warnings.end())
        description_.warnings.push_back(warning);
    description_.coordinate_bytes = std::max(description_.coordinate_bytes, own.coordinate_bytes);
    description_.blocks.push_back(block);
  }
  tile->release();
  tiles_.push_back(std::move(tile));
}

const NetcdfSource& TileSource::tileOf(uint32_t block) const {
  CURVISPLAT_CHECK_OP(block, <, tiles_.size());
  if (stay_open_) return *tiles_[block];
  if (const uint32_t before = open_.exchange(block); before != block) tiles_[before]->release();
  return *tiles_[block];
}

void TileSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  tileOf(block).read(0, box, scalars, out);
}

std::vector<glm::dvec3> TileSource::pointsOf(uint32_t block, const CfRange& range) const {
  return tileOf(block).pointsOf(0, range);
}

}  // namespace

std::unique_ptr<GridSource> openNetcdf(const OpenGridOptions& given) {
  std::vector<std::filesystem::path> files{given.grid};
  files.insert(files.end(), given.solutions.begin(), given.solutions.end());
  files = withGridsOfMosaics(files);
  OpenGridOptions options = given;
  options.solutions.assign(files.begin() + 1, files.end());
  if (const auto tiles = tilesOf(options); !tiles.empty())
    return joinFaces(std::make_unique<TileSource>(tiles));
  auto source = std::make_unique<NetcdfSource>(options);
  if (source->description().blocks.size() > 1) return joinFaces(std::move(source));
  if (const auto closure = source->closure())
    return std::make_unique<ClosedGrid>(std::move(source), *closure);
  return source;
}

}  // namespace curvisplat
