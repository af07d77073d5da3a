#include "tools/options/frame_arguments.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "render/colour/function_parts.h"
#include "render/project/light.h"
#include "render/project/screen_view.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

WorldBox parseClipBox(const std::string& text) {
  const auto n = parseNumbers("--clip-box", text, "x0,x1,y0,y1,z0,z1");
  const WorldBox box{{n[0], n[2], n[4]}, {n[1], n[3], n[5]}};
  for (int axis = 0; axis < 3; ++axis)
    if (box.lower[axis] > box.upper[axis])
      throw UsageError("--clip-box {}: the {} range is reversed (found {},{}; expected the smaller first)",
                       text, "xyz"[axis], box.lower[axis], box.upper[axis]);
  return box;
}

std::vector<ClipPlane> parseClipPlanes(const std::vector<std::string>& texts) {
  if (texts.size() > kMaxClipPlanes)
    throw UsageError("--clip-plane: given {} times; at most {} planes cut a picture", texts.size(),
                     kMaxClipPlanes);
  std::vector<ClipPlane> planes;
  for (const std::string& text : texts) {
    const auto n = parseNumbers("--clip-plane", text, "px,py,pz,nx,ny,nz");
    const ClipPlane plane{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
    if (!isUsable(plane))
      throw UsageError("--clip-plane {}: the normal nx,ny,nz has no direction; give one that is not 0,0,0",
                       text);
    planes.push_back(plane);
  }
  return planes;
}

float parseDarkness(const char* option, const std::optional<std::string>& text) {
  const double darkness = text ? parseNumber(option, *text) : 0;
  if (!(darkness >= 0 && darkness <= 1))
    throw UsageError("{} {}: expected a number from 0 (none) to 1", option, *text);
  return static_cast<float>(darkness);
}

std::optional<Light> parseLight(const FrameArguments& arguments) {
  Light light;
  light.shadow = parseDarkness("--shadow", arguments.shadow);
  light.ambient_occlusion = parseDarkness("--ambient-occlusion", arguments.ambient_occlusion);
  if (!arguments.shade && !arguments.light && !arguments.light_direction && light.shadow == 0 &&
      light.ambient_occlusion == 0)
    return std::nullopt;
  if (light.shadow > 0) light.towards = Light::kShadowsFrom;
  if (arguments.light) {
    const auto n = parseNumbers("--light", *arguments.light, "ambient,diffuse,specular");
    for (const double strength : n)
      if (!(strength >= 0 && strength <= 1))
        throw UsageError("--light {}: expected three numbers between 0 and 1", *arguments.light);
    if (n[0] + n[1] > 1)
      throw UsageError("--light {}: ambient and diffuse add up to {}; expected at most 1", *arguments.light,
                       n[0] + n[1]);
    light.ambient = static_cast<float>(n[0]);
    light.diffuse = static_cast<float>(n[1]);
    light.specular = static_cast<float>(n[2]);
  }
  if (arguments.light_direction) {
    light.towards = parsePoint("--light-direction", *arguments.light_direction);
    if (!(glm::length(*light.towards) > 0))
      throw UsageError("--light-direction {}: expected a direction that is not 0,0,0",
                       *arguments.light_direction);
  }
  return light;
}

}  // namespace

FrameOptions frameOptions(const FrameArguments& arguments) {
  FrameOptions options;
  options.size = parseImageSize("--size", arguments.size);
  options.lod_pixels = parseNumber("--lod-pixels", arguments.lod_pixels);
  if (options.lod_pixels < 0)
    throw UsageError("--lod-pixels {}: expected 0 (the finest level) or more", arguments.lod_pixels);
  if (arguments.max_splats) options.max_splats = parseCount("--max-splats", *arguments.max_splats);
  requireChoice("--classify", arguments.classify, {"pixel", "flat"});
  options.classification = arguments.classify == "pixel" ? Classification::kPixel : Classification::kFlat;
  options.scale = parsePoint("--scale", arguments.scale);
  for (int axis = 0; axis < 3; ++axis)
    if (!(options.scale[axis] >= kMinScale && options.scale[axis] <= kMaxScale))
      throw UsageError("--scale {}: expected three numbers between {:g} and {:g}", arguments.scale, kMinScale,
                       kMaxScale);
  if (arguments.clip_box) options.clip_box = parseClipBox(*arguments.clip_box);
  options.clip_planes = parseClipPlanes(arguments.clip_planes);
  options.light = parseLight(arguments);
  if (arguments.gradient_opacity)
    options.gradient_opacity = parseOpacities("--gradient-opacity", *arguments.gradient_opacity);
  options.background = parseBackground("--background", arguments.background);
  options.threads = arguments.threads;
  options.memory_bytes = parseMemory("--memory", arguments.memory);
  if (arguments.card_memory)
    options.card_memory_bytes =
        *arguments.card_memory == "0" ? 0 : parseByteSize("--card-memory", *arguments.card_memory);
  options.keep_going = arguments.keep_going;
  return options;
}

ValueChannels valueChannels(const std::optional<std::string>& text, const std::filesystem::path& output) {
  ValueChannels channels;
  if (!text) {
    channels.depth = extensionOf(output) == ".exr";
    return channels;
  }
  if (*text == "none") return channels;
  if (extensionOf(output) != ".exr")
    throw UsageError("--channels {}: only .exr files have channels; name -o NAME.exr", *text);
  for (size_t begin = 0; begin <= text->size();) {
    const size_t end = std::min(text->find(',', begin), text->size());
    const std::string word = text->substr(begin, end - begin);
    begin = end + 1;
    if (word == "depth")
      channels.depth = true;
    else if (word == "normal")
      channels.normal = true;
    else if (word == "scalar")
      channels.scalar = true;
    else
      throw UsageError(
          "--channels {}: unknown channel '{}'{}; expected none, or some of depth, normal and scalar", *text,
          word, didYouMean(word, std::vector<std::string>{"depth", "normal", "scalar"}));
  }
  return channels;
}

std::vector<ImageChannel> imageChannels(const ValueChannels& wanted, const PixelValues& values,
                                        ImageSize picture) {
  const auto padded = [&](const auto& valueOf, float beside) {
    std::vector<float> out(picture.pixels(), beside);
    for (int y = 0; y < values.size.height; ++y)
      for (int x = 0; x < values.size.width; ++x)
        out[static_cast<size_t>(y) * static_cast<size_t>(picture.width) + static_cast<size_t>(x)] =
            valueOf(static_cast<size_t>(y) * static_cast<size_t>(values.size.width) + static_cast<size_t>(x));
    return out;
  };
  std::vector<ImageChannel> channels;
  if (wanted.depth)
    channels.push_back(
        {"Z", padded([&](size_t n) { return values.depth[n]; }, std::numeric_limits<float>::infinity())});
  if (wanted.normal)
    for (const int axis : {0, 1, 2})
      channels.push_back(
          {std::string("N.") + "XYZ"[axis], padded([&](size_t n) { return values.normal[n][axis]; }, 0)});
  if (wanted.scalar)
    channels.push_back({"scalar", padded([&](size_t n) { return values.scalar[n]; },
                                         std::numeric_limits<float>::quiet_NaN())});
  return channels;
}

}  // namespace curvisplat
