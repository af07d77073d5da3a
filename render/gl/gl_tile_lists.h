// Lists of the splats of tiles on the card, each sorted by the splats' keys in the tile, in compute shaders.
//
//   count -> scan -> emit -> (histogram -> scan -> scatter) a digit -> ranges
//
// The sort is a stable radix sort of (tile, key in the tile); entries are written in the order of the splats. So splats with
// equal keys come in that order, and the lists are the same from run to run. On the context's thread.
#pragma once

#include <array>
#include <cstdint>

#include "render/gl/gl_functions.h"
#include "render/gl/tile_list_shaders.h"
#include "render/project/tile_set.h"

namespace curvisplat {

/// Memory on the card that grows as it is needed; what was in it is lost then.
class CardBuffer {
 public:
  explicit CardBuffer(const GlFunctions& gl) : gl_(gl), object_(makeBuffer(gl)) {}

  void reserve(uint64_t bytes);
  /// Binds the buffer for shaders, at the binding.
  void bind(GLuint binding) const { gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, object_.name()); }
  /// Binds the buffer for glBufferSubData and the like, at GL_SHADER_STORAGE_BUFFER.
  void bind() const { gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, object_.name()); }
  /// Sets it all to 0.
  void clear() const;
  uint64_t bytes() const { return bytes_; }

 private:
  const GlFunctions& gl_;
  GlObject object_;
  uint64_t bytes_ = 0;
};

/// The splats to be listed.
struct ListedSplats {
  const CardBuffer* splats;  // ScreenSplats
  uint32_t first, count;     // in those
  uint32_t waiting;          // of them, the first: they were listed before, with their keys up to `before`
  uint32_t before, front;    // keys: those up to `front` are listed
  uint32_t least_key;        // of those that are listed; in `key_bits` bits lie all from it on
  uint32_t key_bits;         // 0: all splats have one order, in which they come
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
  /// Kinds of its timers.
  enum Stage : size_t { kList, kSort, kOtherStages };

  /// `timers`: of at least those stages; outlive the lists.
  GlTileLists(const GlFunctions& gl, GlTimers& timers);

  /// How many entries the lists of the tiles in `box` have, which are not closed.
  uint64_t count(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box);
  /// Makes the lists of what was counted last.
  void make(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box, uint64_t entries);

  /// [entry] the number of its splat; [tile of the box] where its entries begin and end.
  const CardBuffer& numbers() const { return numbers_[sorted_]; }
  const CardBuffer& ranges() const { return ranges_; }
  uint64_t cardBytes() const;
  /// The entries listed since resetCounts(), and that number times the digits that they were sorted by.
  uint64_t listedEntries() const { return listed_entries_; }
  uint64_t movedEntries() const { return moved_entries_; }
  void resetCounts() { listed_entries_ = moved_entries_ = 0; }

 private:
  const GlProgram& use(TileListStep step) const;
  void setInputs(const GlProgram& program, const ListedSplats& splats, const CardTiles& tiles,
                 const TileBox& box, bool writes) const;
  void dispatch(uint32_t groups) const;
  void scan(uint32_t rows, uint32_t length);
  void sortDigit(uint64_t entries, uint32_t shift);

  void emit(const ListedSplats& splats, const CardTiles& tiles, const TileBox& box);
  void findRanges(uint32_t key_bits, uint64_t entries);

  const GlFunctions& gl_;
  GlTimers& timers_;
  const std::array<GlProgram, 5> programs_;  // [TileListStep]
  CardBuffer counts_, sums_, totals_, ranges_;
  std::array<CardBuffer, 2> keys_, numbers_;  // as they are, and sorted by the next digit
  size_t sorted_ = 0;
  uint64_t moved_entries_ = 0, listed_entries_ = 0;
};

}  // namespace curvisplat
