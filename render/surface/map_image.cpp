#include "render/surface/map_image.h"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <string>
#include <utility>

#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxPixels = uint64_t{1} << 26;

// Bytes that the file of a map has for a pixel at most, and for all else.
constexpr uint64_t kMaxPixelBytes = 32, kMaxOtherBytes = 64 << 20;

void requireMapSize(ImageSize size, const std::string& name) {
  constexpr int kApart = 2;  // pixels: some programs round
  const auto [width, height] = size;
  if (width < 2 || std::abs(width - 2 * height) > kApart)
    throw Error(
        "{}: has {} x {} pixels; a map of the whole Earth (equirectangular, from 180 degrees west and 90 "
        "degrees north on) is twice as wide as high",
        name, width, height);
  if (size.pixels() > kMaxPixels)
    throw Error("{}: has {} x {} pixels, more than the {} of a map; scale it down", name, width, height,
                kMaxPixels);
}

}  // namespace

MapImage::MapImage(const Image& image) {
  Level finest{image.size.width, image.size.height, std::vector<uint8_t>(3 * image.size.pixels())};
  for (size_t n = 0; n < image.size.pixels(); ++n)
    for (size_t c = 0; c < 3; ++c)
      finest.rgb[3 * n + c] = toByte(image.rgba[4 * n + c] + 1 - image.rgba[4 * n + 3]);
  levels_.push_back(std::move(finest));
  while (levels_.back().width > 2 && levels_.back().height > 1) levels_.push_back(halved(levels_.back()));
}

/// Half of an odd side is rounded up: its last pixels are the mean of fewer.
MapImage::Level MapImage::halved(const Level& level) {
  Level half{(level.width + 1) / 2, (level.height + 1) / 2, {}};
  half.rgb.reserve(size_t{3} * static_cast<size_t>(half.width) * static_cast<size_t>(half.height));
  const auto at = [&](int x, int y, size_t c) {
    const int column = std::min(x, level.width - 1), row = std::min(y, level.height - 1);
    return unsigned{level.rgb[3 * (static_cast<size_t>(row) * static_cast<size_t>(level.width) +
                                   static_cast<size_t>(column)) +
                              c]};
  };
  for (int y = 0; y < half.height; ++y)
    for (int x = 0; x < half.width; ++x)
      for (size_t c = 0; c < 3; ++c) {
        const unsigned sum = at(2 * x, 2 * y, c) + at(2 * x + 1, 2 * y, c) + at(2 * x, 2 * y + 1, c) +
                             at(2 * x + 1, 2 * y + 1, c);
        half.rgb.push_back(static_cast<uint8_t>((sum + 2) / 4));
      }
  return half;
}

/// The colour between the middles of four pixels; longitudes go round.
glm::vec3 MapImage::between(const Level& level, double longitude, double latitude) {
  const double east = longitude / 360 + 0.5, column = (east - std::floor(east)) * level.width - 0.5;
  const double row = std::clamp((0.5 - latitude / 180) * level.height - 0.5, 0.0, level.height - 1.0);
  const int left = static_cast<int>(std::floor(column)), top = static_cast<int>(row);
  const auto part_x = static_cast<float>(column - left), part_y = static_cast<float>(row - top);
  const auto pixel = [&](int x, int y) {
    const int around = (x % level.width + level.width) % level.width, within = std::min(y, level.height - 1);
    const uint8_t* const rgb =
        &level.rgb[3 * (static_cast<size_t>(within) * static_cast<size_t>(level.width) +
                        static_cast<size_t>(around))];
    return glm::vec3(rgb[0], rgb[1], rgb[2]);
  };
  const glm::vec3 upper = glm::mix(pixel(left, top), pixel(left + 1, top), part_x);
  const glm::vec3 lower = glm::mix(pixel(left, top + 1), pixel(left + 1, top + 1), part_x);
  return glm::mix(upper, lower, part_y) / 255.0f;
}

glm::vec3 MapImage::at(double longitude, double latitude, double degrees) const {
  const double pixels = degrees * levels_.front().height / 180;
  const double last = static_cast<double>(levels_.size() - 1);
  const double level = pixels > 1 ? std::min(std::log2(pixels), last) : 0.0;
  const auto finer = static_cast<size_t>(level);
  const auto part = static_cast<float>(level - static_cast<double>(finer));
  const glm::vec3 colour = between(levels_[finer], longitude, latitude);
  return part > 0 ? glm::mix(colour, between(levels_[finer + 1], longitude, latitude), part) : colour;
}

uint64_t MapImage::bytes() const {
  uint64_t bytes = 0;
  for (const Level& level : levels_) bytes += level.rgb.size();
  return bytes;
}

glm::vec3 PlacedMap::at(const glm::dvec3& point, double pixel) const {
  const glm::dvec3 place = globe.geographic(point);
  return image.at(place.x, place.y, pixel / globe.radius_km * 180 / std::numbers::pi);
}

MapImage readMapImage(const std::filesystem::path& path) {
  // The header comes first: decoded, an image takes up to 24 bytes a pixel, an EXR file up to 48, however
  // short it is.
  const ImageSize size = readImageSize(path);
  requireMapSize(size, path.string());
  const uint64_t bytes = InputFile(path).size(), most = kMaxPixelBytes * size.pixels() + kMaxOtherBytes;
  if (bytes > most)
    throw Error("{}: has {} bytes for {} x {} pixels; expected at most {}", path.string(), bytes, size.width,
                size.height, most);
  const Image image = readImage(path);
  requireMapSize(image.size, path.string());
  return MapImage(image);
}

TriangleMesh meshOfGlobe(const Globe& globe, double height_km) {
  constexpr uint32_t kRows = 180, kColumns = 360;
  TriangleMesh mesh;
  for (uint32_t row = 0; row <= kRows; ++row)
    for (uint32_t column = 0; column <= kColumns; ++column) {
      // A flat map is cut where longitudes turn over.
      const double most = globe.sphere() ? 180 : 180 - 1e-7;
      const double east = std::clamp(column - 180.0, -most, most);
      const glm::dvec3 at = globe.column(globe.middle_longitude + east, 90.0 - row);
      mesh.positions.emplace_back(globe.place(at, height_km));
      mesh.normals.push_back(globe.sphere() ? glm::vec3(at) : glm::vec3(0, 0, 1));
    }
  for (uint32_t row = 0; row < kRows; ++row)
    for (uint32_t column = 0; column < kColumns; ++column) {
      const uint32_t a = row * (kColumns + 1) + column, b = a + 1, c = a + kColumns + 1, d = c + 1;
      mesh.triangles.insert(mesh.triangles.end(), {{a, c, b}, {b, c, d}});
    }
  return mesh;
}

}  // namespace curvisplat
