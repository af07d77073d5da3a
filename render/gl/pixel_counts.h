// Counts what the pixels of a picture do in compute shaders, for bench/card_frames.py, which sets the environment variable
// CURVISPLAT_COUNT_PIXELS. Without it, splatTileShader() has no counters, and nothing is allocated. As "alone", pixels
// count what they would blend and blend nothing, which is less work in software: as if nothing were opaque.
//
// All calls are on the context's thread.
#pragma once

#include <cstdint>

#include "render/gl/card_buffer.h"
#include "render/gl/gl_functions.h"
#include "render/image/image.h"

namespace curvisplat {

class PixelCounts {
 public:
  explicit PixelCounts(const GlFunctions& gl);

  bool areWanted() const { return are_wanted_; }
  bool areAlone() const { return are_alone_; }
  /// Begins a picture, of which nothing is counted yet.
  void begin(ImageSize size);
  /// Binds the counters: two for each large tile, since the sum of a picture may exceed 32 bits.
  void bind() const;
  /// Waits for OpenGL and adds the counters up.
  void finish();

  /// How often a pixel looked at a splat of its tile's list, and how often it blended one.
  uint64_t listed() const { return listed_; }
  uint64_t blended() const { return blended_; }

 private:
  const GlFunctions& gl_;
  const bool are_wanted_, are_alone_;
  CardBuffer counters_;
  uint64_t listed_ = 0, blended_ = 0;
};

}  // namespace curvisplat
