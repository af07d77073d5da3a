#include "render/annotate/canvas.h"

#include <fontconfig/fontconfig.h>

#include <cstdlib>
#include <filesystem>

#include "stream/base/plugin.h"

namespace curvisplat {
namespace {

/// Makes a bundle's font the only one that its own libfontconfig knows. The system's settings and caches may be of a version that this
/// library does not understand, or missing.
bool useBundledFont() {
  const std::filesystem::path font = bundledFile("DejaVuSans.ttf");
  if (font.empty() || std::getenv("FONTCONFIG_FILE")) return false;
  FcConfig* const config = FcConfigCreate();
  return FcConfigAppFontAddFile(config, reinterpret_cast<const FcChar8*>(font.c_str())) &&
         FcConfigSetCurrent(config);
}

}  // namespace

void selectFont(cairo_t* cairo, cairo_font_weight_t weight) {
  [[maybe_unused]] static const bool once = useBundledFont();
  cairo_select_font_face(cairo, "sans", CAIRO_FONT_SLANT_NORMAL, weight);
}

}  // namespace curvisplat
