#include "render/frame/joined_tiles.h"

#include <algorithm>

#include "render/project/tile_set.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

/// Calls use(first float, count) for each row of pixels of each tile of `rank`, in order.
template <typename Use>
void forRowsOf(uint32_t rank, const std::vector<uint32_t>& owners, Image& image, const Use& use) {
  const auto columns = static_cast<size_t>(TileSet::tilesAlong(image.size.width, kSharedTileSide));
  for (size_t tile = 0; tile < owners.size(); ++tile) {
    if (owners[tile] != rank) continue;
    const int x0 = static_cast<int>(tile % columns) * kSharedTileSide,
              y0 = static_cast<int>(tile / columns) * kSharedTileSide;
    const auto floats = 4 * static_cast<size_t>(std::min(kSharedTileSide, image.size.width - x0));
    for (int y = y0; y < std::min(y0 + kSharedTileSide, image.size.height); ++y)
      use(image.pixel(x0, y), floats);
  }
}

}  // namespace

void joinTiles(Image& image, const std::vector<uint32_t>& owners, Ranks& ranks) {
  std::vector<float> own;
  if (!ranks.isFirst())
    forRowsOf(ranks.rank(), owners, image,
              [&](const float* row, size_t floats) { own.insert(own.end(), row, row + floats); });
  const std::vector<Ranks::Bytes> parts = ranks.gather(toBytes(own));
  for (uint32_t rank = 1; rank < parts.size(); ++rank) {
    const std::vector<float> part = fromBytes<float>(parts[rank]);
    size_t at = 0;
    forRowsOf(rank, owners, image, [&](float* row, size_t floats) {
      CURVISPLAT_CHECK_OP(at + floats, <=, part.size());
      std::copy_n(&part[at], floats, row);
      at += floats;
    });
    CURVISPLAT_CHECK_OP(at, ==, part.size());
  }
}

}  // namespace curvisplat
