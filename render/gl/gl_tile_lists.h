// Lists of the splats of tiles on the card, each sorted by the splats' keys in the tile, in compute shaders.
//
//   count the entries of each tile -> add them up -> write them, where they fall -> sort each tile's
//
// What is sorted is a tile's few entries, by the key and, of equal ones, the number of the splat. So the lists are the same
// from run to run. On the context's thread.
#pragma once

#include <array>
#include <cstdint>

#include "render/gl/card_buffer.h"
#include "render/gl/gl_functions.h"
#include "render/gl/tile_list_shaders.h"
#include "render/project/tile_set.h"

namespace curvisplat {

/// The splats to be listed.
struct ListedSplats {
  const CardBuffer* splats;  // ScreenSplats
  uint32_t count;            // of those, from the first on
  uint32_t waiting;          // of them, the first: they were listed before, with their keys up to `before`
  uint32_t before, front;    // keys: those up to `front` are listed
  bool ordered;              // false: all splats have one order, in which they come
};

/// The picture's tiles of one size, and how many pixels of each take no more.
struct CardTiles {
  int side;
  ImageSize picture;
  const CardBuffer* closed;
  uint32_t closed_begin;  // in it, [tile]
  int columns() const { return TileSet::tilesAlong(picture.width, side); }
};

class GlTileLists {
 public:
  static constexpr uint64_t kEntryBytes = 2 * sizeof(uint32_t);
  /// Kinds of its timers.
  enum Stage : size_t { kList, kSort, kOtherStages };

  /// `timers`: of at least those stages; outlive the lists.
  GlTileLists(const GlFunctions& gl, GlTimers& timers);

  /// How many entries the lists of the tiles in `box` have, which are not closed.
  uint64_t count(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box);
  /// Makes the lists of what was counted last.
  void make(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box, uint64_t entries);

  /// Binds what tileRanges() reads, and at 4 the entries: [entry] the key, and the number of its splat.
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
