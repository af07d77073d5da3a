// The inputs of a frame, except the cache and the camera: what a picture shows, how it looks, and which
// resources drawing it may use.
//
// DrawnScalars are fixed for a renderer, apart from the opacities' function; FrameOptions are given with
// each frame. Plain values; the ranks are borrowed.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/project/projection.h"
#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"
#include "stream/base/ranks.h"

namespace curvisplat {

/// A variable of the cache, and the transfer function that it is drawn with.
struct DrawnScalar {
  size_t variable = 0;  // of the cache
  TransferFunction function;
};

/// The scalars of a picture. A picture of one scalar takes colours and opacities from its function. In a
/// picture of two, `opacity` gives the opacities, isosurfaces and light, and `colour` the colours, also those
/// of slices and surfaces.
struct DrawnScalars {
  DrawnScalar opacity;
  std::optional<DrawnScalar> colour = std::nullopt;  // none: `opacity` gives the colours, too

  DrawnScalars(size_t variable, const TransferFunction& function) : opacity{variable, function} {}
  DrawnScalars(DrawnScalar of_opacity, DrawnScalar of_colour)
      : opacity(std::move(of_opacity)), colour(std::move(of_colour)) {}
};

enum class Classification { kPixel, kFlat };  // flat: one colour and extinction per splat, as in the paper

/// How a frame looks, and which resources it may use.
struct FrameOptions {
  ImageSize size;  // pixels
  Classification classification = Classification::kPixel;
  double lod_pixels = 1;               // pixels of error allowed, by weight (errorWeight()); 0: finest level
  std::optional<uint64_t> max_splats;  // splat limit; the largest screen error is refined first
  glm::dvec3 scale{1.0};               // factors of x, y and z about the world's origin
  std::optional<WorldBox> clip_box;    // nothing outside it is drawn
  std::vector<ClipPlane> clip_planes;  // nothing on their outer sides is drawn
  std::optional<Light> light;          // none: unlit, the colours of the transfer function
  // Factors of the extinction (OpacityPoint::opacity) by how steep the gradient is: OpacityPoint::x is the
  // share of the volume, 0 to 1, where it is less steep. Empty: none.
  std::vector<OpacityPoint> gradient_opacity;
  std::shared_ptr<const SurfaceScene> scene;  // surfaces and slices; null: none
  glm::vec4 background{1, 1, 1, 1};           // premultiplied
  double low_pass_px2 = kLowPass;  // λ: added to the diagonal of S₂ (DESIGN.md, "Projection"), px²
  unsigned threads = 0;            // that compute at a time; 0: one per core
  uint64_t memory_bytes = 512 << 20;
  // The memory of a graphics card for bricks that stay there, and for their projected splats. None: three
  // quarters of what the card has free. 0: the processor projects all splats.
  std::optional<uint64_t> card_memory_bytes;
  uint64_t output_bytes = 0;  // part of memory_bytes that is reserved for the use of the finished image
  bool keep_going = false;    // draw damaged bricks from an ancestor, and report them
  /// The processes that draw the picture together, each some of its tiles. Never null.
  Ranks* ranks = &oneRank();
  std::stop_token stop;  // ends the drawing with Interrupted
};

}  // namespace curvisplat
