// Makes a list of the splats in each tile on the card, sorted by their keys in the tile, by compute shaders.
//
//   count the entries of each tile -> add them up -> write them, where they fall -> sort each tile's
//
// A tile's entries are sorted by key, then by the number of the splat, so the lists are the same from run to
// run. All calls are on the context's thread.
#pragma once

#include <array>
#include <cstdint>

#include "render/gl/card_buffer.h"
#include "render/gl/gl_functions.h"
#include "render/gl/tile_list_shaders.h"
#include "render/project/tile_set.h"

namespace curvisplat {

/// The splats to be listed. Keys are those of render/project/tile_key.h.
struct ListedSplats {
  const CardBuffer* splats;  // ScreenSplats
  uint32_t count;            // how many, from the first on
  uint32_t waiting;          // the first ones, which were listed before, with keys up to `before`
  uint32_t before, front;    // keys in a tile up to `front` are listed now
  bool ordered;              // false: in every tile the order is that of `splats`
};

/// The picture's tiles of one size, and how many pixels of each are saturated.
struct CardTiles {
  int side;
  ImageSize picture;
  const CardBuffer* closed;
  uint32_t closed_begin;  // where the picture's tiles begin in `closed`
  int columns() const { return TileSet::tilesAlong(picture.width, side); }
};

class GlTileLists {
 public:
  static constexpr uint64_t kEntryBytes = 2 * sizeof(uint32_t);
  /// Kinds of work that `timers` measures.
  enum Stage : size_t { kList, kSort, kOtherStages };

  /// `timers` has at least these kinds, and outlives the lists.
  GlTileLists(const GlFunctions& gl, GlTimers& timers);

  /// Counts the entries that the lists of the tiles in `box` will have. Closed tiles have none.
  uint64_t count(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box);
  /// Makes the lists that count() has counted; the arguments and its result must be the same.
  void make(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box, uint64_t entries);

  /// Binds what tileRanges() reads, and at binding 4 the entries: for each the key and the number of its
  /// splat.
  void bind() const;
  uint64_t cardBytes() const { return ends_.bytes() + chunks_.bytes() + total_.bytes() + entries_.bytes(); }
  /// The entries listed since resetCounts().
  uint64_t listedEntries() const { return listed_entries_; }
  void resetCounts() { listed_entries_ = 0; }

 private:
  const GlProgram& use(TileListStep step) const;
  void list(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box, bool writes) const;
  void dispatch(uint32_t columns, uint32_t rows = 1) const;
  void scan(const CardBuffer& sums, const CardBuffer& totals, uint32_t rows, uint32_t length) const;

  const GlFunctions& gl_;
  GlTimers& timers_;
  const std::array<GlProgram, 3> programs_;  // [TileListStep]
  CardBuffer ends_, chunks_, total_, entries_;
  uint64_t listed_entries_ = 0;
};

}  // namespace curvisplat
