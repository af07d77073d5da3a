// The bricks that stay on the card, and their projection there (project_shader.h).
//
//   CardPlaces: pages (buffers) of geometry, of values at steps -> slabs of depth -> project() -> elements of a slab
//
// A brick's geometry has a range of one page: its arrays, then its BrickPieces; its values at a step another, of any page.
// Steps share the geometry, and values of earlier steps stay as long as there is space. If no free range is large enough
// for a new brick, all bricks are sent again. What the bricks are drawn as need not fit into the card's memory at once, nor
// into one buffer: it is projected in slabs of depth (CardSlab). All calls are on the context's thread.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "render/gl/card_buffer.h"
#include "render/gl/card_places.h"
#include "render/gl/project_shader.h"
#include "render/gl/splat_tables.h"
#include "render/project/brick_store.h"

namespace curvisplat {

/// Parts that may have keys up to `front` which lie behind the front of the slab before it.
struct CardSlab {
  uint32_t front = 0;
  std::vector<uint32_t> parts;  // numbers, ascending
  size_t elements = 0;          // that project() writes for them
};

class CardBricks {
 public:
  /// Buffers have at most `buffer_bytes`, and what OpenGL allows.
  CardBricks(const GlFunctions& gl, uint64_t buffer_bytes);

  /// Compiles the shaders now instead of when they are first needed. Throws Error if the driver refuses them.
  void compile();
  /// The functions of BrickStore (render/project/brick_store.h).
  void open(uint64_t content, const StepPosition& step);
  /// makeRoom() also makes `splats` large enough for project(), with `other_bytes` behind, which are no part of `bytes`.
  size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes, CardBuffer& splats,
                  uint64_t other_bytes);
  bool giveMemoryUp();
  bool has(uint32_t brick) const;
  void put(const StoredPart& part, const GeometryArrays<const float>& geometry, const BrickValues& values,
           const BrickPieces& pieces);
  /// Divides the parts of the last makeRoom(), all of which are stored, for a frame. The last front is kLastKey. They must
  /// stay until the last project().
  std::vector<CardSlab> beginFrame(std::span<const StoredPart> parts);
  /// Projects a slab of the frame's parts into the first elements of `splats`, whether they are drawn or not. `tables` are the
  /// frame's.
  void project(const ProjectionSettings& settings, const DepthKeys& keys, const CardSlab& slab,
               const SplatTables& tables, float largest_scalar, const CardBuffer& splats);
  /// Waits for the last project() and returns the counts of the frame: each part's once.
  ProjectionCounts counts() const;
  uint64_t cardBytes() const {
    return pageBytes() + parts_.bytes() + groups_.bytes() + frames_.bytes() + shading_.bytes();
  }
  /// The bytes of geometry and of values that were sent so far.
  uint64_t sentBytes() const { return sent_bytes_; }

  static constexpr uint32_t kLastKey = INT32_MAX;

 private:
  /// The pieces of a brick that was put since open(), whether it is still stored or not: how many splats have some, and how
  /// many there are, before each octant and beyond the last.
  struct Known {
    std::array<uint32_t, 9> begins, splats, pieces;
  };
  /// This is what fits: parts from the first on, the words of their pages, and the elements of the largest slab.
  struct Room {
    size_t parts = 0;
    uint64_t page_bytes = 0, drawn_bytes = 0;
  };
  struct Groups;
  struct Sent;
  CardPlaces::Item geometryOf(uint32_t brick) const { return {brick, false, 0, 0}; }
  CardPlaces::Item valuesOf(uint32_t brick) const { return {brick, true, step_.step, step_.part}; }
  uint64_t geometryWords(const StoredPart& part) const;
  uint64_t valueWords(const StoredPart& part) const;
  uint64_t mostElements(const StoredPart& part) const;
  size_t elementsOf(const StoredPart& part) const;
  static size_t octantAt(const Known& known, uint32_t splat);
  template <typename T>
  void write(const CardPlaces::Place& place, uint64_t& at, std::span<const T> some);
  Room roomFor(std::span<const StoredPart> parts, uint64_t bytes) const;
  bool makeSplats(const Room& room, uint64_t bytes, CardBuffer& splats, uint64_t other_bytes);
  bool makePages(std::span<const StoredPart> parts, const Room& room);
  void keepPlaces(std::span<const StoredPart> parts);
  bool addPage(uint64_t wanted_bytes);
  uint64_t pageBytes() const;
  void removePagesBeyond(uint64_t bytes);
  void takeAtMost(uint64_t bytes);
  std::optional<CardPlaces::Place> placeFor(const CardPlaces::Item& item, uint64_t words);
  void putGeometry(const CardPlaces::Place& place, const GeometryArrays<const float>& geometry,
                   const BrickPieces& pieces);
  void putValues(const CardPlaces::Place& place, size_t count, const BrickValues& values,
                 const BrickPieces& pieces);
  const GlProgram& program(bool perspective);
  void setView(const GlProgram& program, const ProjectionSettings& settings,
               const DepthKeys::Linear& keys) const;
  void sendShading(const GlProgram& program, const ProjectionSettings& settings);
  void addPart(const StoredPart& part, const ProjectionSettings& settings, const DepthKeys& keys,
               bool is_counted, Sent& sent) const;
  void send(Sent& sent);
  void dispatch(const GlProgram& program, const Sent& sent) const;

  const GlFunctions& gl_;
  const uint64_t largest_;                            // bytes of a buffer
  std::array<std::optional<GlProgram>, 2> programs_;  // [perspective]
  std::vector<CardBuffer> pages_;                     // as those of places_
  CardPlaces places_;
  CardBuffer parts_, groups_, fates_, frames_, shading_;
  std::shared_ptr<const ShadowGrid> shadows_;  // that `shading_` has, from `shadows_begin_` on
  uint64_t shadows_begin_ = 0;
  std::map<uint32_t, Known> known_;  // [number]
  std::span<const StoredPart> frame_parts_;
  std::vector<uint8_t> counted_;  // [part] whether a slab of the frame has counted it
  bool is_scattered_ = false;     // there was no place for a brick
  uint64_t content_ = 0, sent_bytes_ = 0;
  uint64_t most_page_bytes_ = 0;         // since the last makeRoom()
  uint64_t granted_bytes_ = UINT64_MAX;  // of pages; less once the card has refused some
  size_t slab_elements_ = 0;             // the most that a slab has
  StepPosition step_;
};

}  // namespace curvisplat
