#include "render/gl/stored_splats.h"

#include <algorithm>
#include <utility>

#include "render/project/screen_splat.h"
#include "render/project/splat_chooser.h"
#include "stream/base/trace.h"

namespace curvisplat {

StoredSplats::StoredSplats(const GlFunctions& gl, const Memory& memory, const SplatTables& tables,
                           GlTimers& timers, size_t stage)
    : gl_(gl),
      memory_(memory),
      tables_(tables),
      timers_(timers),
      stage_(stage),
      splats_(gl),
      bricks_(gl, memory.buffer_bytes) {}

bool StoredSplats::giveMemoryUp() {
  if (!bricks_.giveMemoryUp()) return false;
  splats_.release();
  return true;
}

void StoredSplats::begin(const ClassificationTable& table) {
  table_ = &table;
  elements_ = 0;
  seconds_ = 0;
  slabs_.clear();
}

void StoredSplats::drawStored(const ProjectionSettings& settings, const DepthKeys& keys,
                              std::span<const StoredPart> parts) {
  const StageTimer timer(seconds_, "project bricks");
  slabs_ = bricks_.beginFrame(parts);
  for (const CardSlab& each : slabs_) elements_ = std::max(elements_, each.elements);
  project_slab_ = [this, &settings, &keys] {
    timers_.measure(stage_, [&] {
      // An element that is not written now is no splat, and no shader draws it.
      if (slabs_[slab_].elements < elements_)
        splats_.fill(elements_ * sizeof(ScreenSplat), ScreenDepth{}.record().l11);
      bricks_.project(settings, keys, slabs_[slab_], tables_, SplatChooser::largestScalar(*table_), splats_);
    });
  };
  splats_.reserve(elements_ * sizeof(ScreenSplat) + memory_.batch_bytes);
  slab_ = 0;
  project_slab_();
}

void StoredSplats::goTo(size_t slab) {
  if (elements_ == 0 || slab == slab_) return;
  slab_ = slab;
  project_slab_();
}

bool StoredSplats::write(std::span<const ScreenSplat> batch, size_t most) {
  const uint64_t bytes = (elements_ + most) * sizeof(ScreenSplat);
  if (elements_ > 0 && bytes > CardBuffer::largest(gl_)) return false;
  if (bytes > splats_.bytes()) {  // more wait than there was space for
    splats_.reserve(bytes);
    if (elements_ > 0) project_slab_();
  }
  splats_.write(elements_ * sizeof(ScreenSplat), batch);
  return true;
}

uint64_t StoredSplats::takeSentBytes() {
  const uint64_t before = std::exchange(told_bytes_, bricks_.sentBytes());
  return told_bytes_ - before;
}

}  // namespace curvisplat
