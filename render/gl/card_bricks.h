// The bricks that stay on the card, and their projection there (project_shader.h).
//
// All lie in one buffer, of which each has a piece. Where there is no piece that is large enough among those that
// are free, all bricks are sent again. On the context's thread.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "render/gl/card_buffer.h"
#include "render/gl/splat_tables.h"
#include "render/project/brick_store.h"

namespace curvisplat {

class CardBricks {
 public:
  explicit CardBricks(const GlFunctions& gl);

  /// Compiles what is otherwise compiled when it is first needed. Throws Error where the driver refuses it.
  void compile();
  /// These are BrickStore's.
  void open(uint64_t content);
  size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes);
  bool has(uint32_t brick) const;
  bool hasPieces(uint32_t brick) const { return bricks_.at(brick).has_pieces; }
  void put(uint32_t brick, const GeometryArrays<const float>& geometry,
           const VariableArrays<const float>& values);
  /// Projects the parts into the first elements of `splats`, one for each of the parts' splats, drawn or not. `tables`
  /// has those of the frame.
  void project(const ProjectionSettings& settings, const DepthKeys& keys, std::span<const StoredPart> parts,
               const SplatTables& tables, float largest_scalar, const CardBuffer& splats);
  /// The counts of the last project(), for which it waits.
  ProjectionCounts counts() const;
  uint64_t cardBytes() const { return words_.bytes() + parts_.bytes() + groups_.bytes(); }

 private:
  struct Stored {
    uint64_t begin = 0, words = 0;
    uint64_t used = 0;  // the number of the frame that asked for it last
    bool filled = false, has_pieces = false;
  };
  bool place(std::span<const StoredPart> parts, uint64_t capacity);
  std::optional<uint64_t> freePlace(uint64_t words, uint64_t capacity) const;
  const GlProgram& program(bool perspective);
  void setView(const GlProgram& program, const ProjectionSettings& settings,
               const DepthKeys::Linear& keys) const;

  const GlFunctions& gl_;
  std::array<std::optional<GlProgram>, 2> programs_;  // [perspective]
  CardBuffer words_, parts_, groups_, fates_, frames_;
  std::map<uint32_t, Stored> bricks_;      // by number
  std::map<uint64_t, uint32_t> by_place_;  // by their begin
  uint64_t content_ = 0, frame_ = 0;
};

}  // namespace curvisplat
