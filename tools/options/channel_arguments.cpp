#include "tools/options/channel_arguments.h"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/paths.h"
#include "stream/base/suggestion.h"

namespace curvisplat {
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
