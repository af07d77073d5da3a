// A picture in memory that Cairo draws on.
#pragma once

#include <cairo/cairo.h>

#include <memory>

#include "stream/base/error.h"

namespace curvisplat {

/// Sizes in pixels.
class CairoSurface {
 public:
  /// Throws Error if Cairo cannot make one of this size.
  CairoSurface(cairo_format_t format, int width, int height)
      : surface_(cairo_image_surface_create(format, width, height)), cairo_(cairo_create(surface_.get())) {
    if (const cairo_status_t status = cairo_status(cairo_.get()); status != CAIRO_STATUS_SUCCESS)
      throw Error("cannot draw on a picture of {}x{} pixels: {}", width, height,
                  cairo_status_to_string(status));
  }

  cairo_t* cairo() const { return cairo_.get(); }
  /// All that was drawn is in its pixels.
  cairo_surface_t* flushed() const {
    cairo_surface_flush(surface_.get());
    return surface_.get();
  }

 private:
  struct Destroy {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
  };
  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> cairo_;
};

}  // namespace curvisplat
