// Finds, for each pixel, the depth at which it has half of its opacity, and the values at that depth. Draws on the
// processor, front to back, splat by splat, in vectors (render/cpu/half_depths.h); not what lies behind that depth.
//
// The splats have to have ScreenDepths, all of them: their picture has layers (everywhere()) that lie before everything.
// The real layers, if there are any, take their part of the opacity where their depth is reached.
#pragma once

#include <memory>

#include "render/frame/backend.h"
#include "render/project/painter.h"
#include "render/project/screen_view.h"

namespace curvisplat {

/// What the painter needs to know; borrowed.
struct ValueInputs {
  const Image& picture;       // that has been drawn, over a transparent background: its opacities
  const PixelLayers* layers;  // the real ones; may be null
  const ScreenView& view;
};

/// Layers that make all splats have ScreenDepths.
PixelLayers everywhere(ImageSize size, double depth_origin);

/// What its backend takes, and the layers everywhere.
uint64_t valueBytes(ImageSize size, const PaintResources& resources);

/// end() returns an image as pixelValuesOf() takes it.
std::unique_ptr<PaintingBackend> makeValueBackend(const ValueInputs& inputs);

}  // namespace curvisplat
