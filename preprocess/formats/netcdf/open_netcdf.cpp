#include "preprocess/formats/netcdf/open_netcdf.h"

#include <filesystem>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/formats/netcdf/joined_faces.h"
#include "preprocess/formats/netcdf/netcdf_source.h"
#include "preprocess/formats/netcdf/supergrid.h"
#include "preprocess/formats/netcdf/tile_source.h"

namespace curvisplat {

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
