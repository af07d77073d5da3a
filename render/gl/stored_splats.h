// The store of bricks of the painter in compute shaders, and the splats that they are drawn as: those of one slab of
// depth at a time, in the first elements of the buffer in which the painter's batch follows.
//
//   CardBricks: slabs of depth --project()--> [ a slab's elements | the batch ]
//
// All calls are on the context's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render/gl/card_bricks.h"
#include "render/gl/card_buffer.h"
#include "render/gl/gl_functions.h"
#include "render/gl/splat_tables.h"
#include "render/project/brick_store.h"

namespace curvisplat {

class StoredSplats final : public BrickStore {
 public:
  struct Memory {
    uint64_t default_bytes;  // BrickStore::defaultBytes()
    uint64_t buffer_bytes;   // the most of a buffer of bricks, if OpenGL allows as many
    uint64_t batch_bytes;    // that are left behind the stored elements, or more where more splats wait
  };
  /// `tables` are the frame's, and `timers` measure projections as work of the kind `stage`; both outlive this.
  StoredSplats(const GlFunctions& gl, const Memory& memory, const SplatTables& tables, GlTimers& timers,
               size_t stage);

  void open(uint64_t content, const StepPosition& step) override { bricks_.open(content, step); }
  size_t makeRoom(std::span<const StoredPart> parts, uint64_t bytes) override {
    return bricks_.makeRoom(parts, bytes, splats_, memory_.batch_bytes);
  }
  bool giveMemoryUp() override;
  uint64_t defaultBytes() const override { return memory_.default_bytes; }
  bool has(uint32_t brick) const override { return bricks_.has(brick); }
  void put(const StoredPart& part, const GeometryArrays<const float>& geometry, const BrickValues& values,
           const BrickPieces& pieces) override {
    bricks_.put(part, geometry, values, pieces);
  }
  void drawStored(const ProjectionSettings& settings, const DepthKeys& keys,
                  std::span<const StoredPart> parts) override;
  ProjectionCounts counts() const override { return elements_ > 0 ? bricks_.counts() : ProjectionCounts{}; }

  /// Compiles the shaders now instead of when they are first needed. Throws Error if the driver refuses them.
  void compile() { bricks_.compile(); }
  /// Begins a frame without stored splats, which drawStored() may add. `table` outlives it.
  void begin(const ClassificationTable& table);
  /// Elements of the buffer before the batch.
  size_t elements() const { return elements_; }
  size_t slabs() const { return slabs_.size(); }
  /// The last key that the slab in the buffer has.
  uint32_t front() const { return elements_ > 0 ? slabs_[slab_].front : UINT32_MAX; }
  void goToFirstSlab() { goTo(0); }
  void goToNextSlab() { goTo(slab_ + 1); }
  /// Writes the batch behind the slab. `most`: elements of any batch. False if OpenGL has no buffer that is large enough
  /// for both.
  bool write(std::span<const ScreenSplat> batch, size_t most);

  const CardBuffer& buffer() const { return splats_; }
  uint64_t cardBytes() const { return splats_.bytes() + bricks_.cardBytes(); }
  /// Bytes of bricks that were sent since the last call.
  uint64_t takeSentBytes();
  /// Seconds that drawStored() has taken since begin().
  double seconds() const { return seconds_; }

 private:
  void goTo(size_t slab);

  const GlFunctions& gl_;
  const Memory memory_;
  const SplatTables& tables_;
  GlTimers& timers_;
  const size_t stage_;
  CardBuffer splats_;
  CardBricks bricks_;
  const ClassificationTable* table_ = nullptr;
  size_t elements_ = 0;
  std::vector<CardSlab> slabs_;
  size_t slab_ = 0;  // the one in the buffer
  std::function<void()> project_slab_;
  double seconds_ = 0;
  uint64_t told_bytes_ = 0;  // CardBricks::sentBytes() of the last takeSentBytes()
};

}  // namespace curvisplat
