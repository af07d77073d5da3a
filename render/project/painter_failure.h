// The exception of a painter that cannot go on, though another one may.
#pragma once

#include "stream/base/error.h"

namespace curvisplat {

/// OpenGL or its card has failed: it has no memory left, was reset, or refuses what is asked of it. Frames are drawn by the
/// next way then (FramePipeline::fallBack()).
class PainterFailure : public Error {
 public:
  using Error::Error;
};

/// The card refuses memory: the same painter may go on with less of it (BrickStore::giveMemoryUp()).
class CardMemoryFailure final : public PainterFailure {
 public:
  using PainterFailure::PainterFailure;
};

/// The painter of another rank has failed. This rank draws the same picture again with the others, by its own painter.
class OtherPainterFailure final : public PainterFailure {
 public:
  using PainterFailure::PainterFailure;
};

}  // namespace curvisplat
