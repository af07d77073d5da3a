// The bricks that stay on the card, and their projection there (project_shader.h).
//
// Each brick has a range of one buffer: its arrays, then its BrickPieces. If no free range is large enough for a new
// brick, all bricks are sent again. All calls are on the context's thread.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "render/gl/card_buffer.h"
#include "render/gl/project_shader.h"
#include "render/gl/splat_tables.h"
#include "render/project/brick_store.h"

namespace curvisplat {

class CardBricks {
 public:
  explicit CardBricks(const GlFunctions& gl);

  /// Compiles the shaders now instead of when they are first needed. Throws Error if the driver refuses them.
  void compile();
  /// The functions of BrickStore (render/project/brick_store.h).
  void open(uint64_t content);
  size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes);
  bool has(uint32_t brick) const;
  void put(uint32_t brick, const GeometryArrays<const float>& geometry, const BrickValues& values,
           const BrickPieces& pieces);
  /// The number of elements that project() writes for a part of a stored brick: those of its splats and of its
  /// pieces.
  size_t elementsOf(const StoredPart& part) const;
  /// Projects the parts into the first elements of `splats`, whether they are drawn or not. `tables` are the
  /// frame's.
  void project(const ProjectionSettings& settings, const DepthKeys& keys, std::span<const StoredPart> parts,
               const SplatTables& tables, float largest_scalar, const CardBuffer& splats);
  /// Waits for the last project() and returns its counts.
  ProjectionCounts counts() const;
  uint64_t cardBytes() const {
    return words_.bytes() + parts_.bytes() + groups_.bytes() + planes_.bytes() + shading_.bytes();
  }

 private:
  /// The pieces of a brick that was put at any time, whether it is still stored or not.
  struct Known {
    std::vector<uint32_t> splats;  // numbers of those that have pieces
    std::vector<uint32_t> first;   // [splat, and beyond the last] its first piece
    uint64_t words() const {
      return 4 * splats.size() + sizeof(StoredPiece) / sizeof(uint32_t) * first.back();
    }
  };
  struct Stored {
    uint64_t begin = 0, words = 0;
    uint64_t used = 0;  // number of the frame that last needed it
  };
  /// Splats with pieces: numbers in Known.
  struct PieceRange {
    size_t begin, end;
  };
  PieceRange piecesIn(const Known& known, const SplatRange& range) const;
  uint64_t wordsOf(const StoredPart& part) const;
  uint64_t mostElements(const StoredPart& part) const;
  std::optional<uint64_t> placeFor(uint64_t words);
  std::optional<uint64_t> freePlace(uint64_t words) const;
  const GlProgram& program(bool perspective);
  void setView(const GlProgram& program, const ProjectionSettings& settings,
               const DepthKeys::Linear& keys) const;
  void sendShading(const GlProgram& program, const ProjectionSettings& settings);

  const GlFunctions& gl_;
  std::array<std::optional<GlProgram>, 2> programs_;  // [perspective]
  CardBuffer words_, parts_, groups_, fates_, frames_, planes_, shading_;
  std::shared_ptr<const ShadowGrid> shadows_;  // that `shading_` has, from `shadows_begin_` on
  uint64_t shadows_begin_ = 0;
  std::map<uint32_t, Known> known_;        // [number]
  std::map<uint32_t, Stored> bricks_;      // [number]
  std::map<uint64_t, uint32_t> by_place_;  // [Stored::begin] number
  bool is_scattered_ = false;              // there was no place for a brick
  uint64_t content_ = 0, frame_ = 0;
};

}  // namespace curvisplat
