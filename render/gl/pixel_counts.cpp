#include "render/gl/pixel_counts.h"

#include <cstdlib>
#include <span>
#include <string_view>
#include <vector>

#include "render/gl/splat_shader.h"
#include "render/project/tile_set.h"

namespace curvisplat {
namespace {

std::string_view asked() {
  const char* const value = std::getenv("CURVISPLAT_COUNT_PIXELS");
  return value ? value : "";
}

}  // namespace

PixelCounts::PixelCounts(const GlFunctions& gl)
    : gl_(gl), are_wanted_(!asked().empty()), are_alone_(asked() == "alone"), counters_(gl) {}

void PixelCounts::begin(ImageSize size) {
  if (!are_wanted_) return;
  counters_.release();  // its size is the number of tiles
  counters_.reserve(2 * sizeof(uint32_t) * TileSet::tilesOf(size, kLargeTile));
  counters_.clear();
}

void PixelCounts::bind() const {
  if (are_wanted_) counters_.bind(kPixelCountsBinding);
}

void PixelCounts::finish() {
  listed_ = blended_ = 0;
  if (!are_wanted_) return;
  std::vector<uint32_t> counts(counters_.bytes() / sizeof(uint32_t));
  counters_.bind();
  gl_.GetBufferSubData(GL_SHADER_STORAGE_BUFFER, 0, static_cast<GLsizeiptr>(std::span(counts).size_bytes()),
                       counts.data());
  for (size_t n = 0; n < counts.size(); n += 2) {
    listed_ += counts[n];
    blended_ += counts[n + 1];
  }
}

}  // namespace curvisplat
