// The built-in transfer functions; most are in published_maps.cpp. The colours of viridis, inferno and plasma are matplotlib's (CC0), those
// of cool-warm are Moreland's, as in ParaView.
#include <fmt/format.h>
#include <algorithm>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/colour/transfer_function.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// Every eighth of matplotlib's 256 colours, and the last: linear interpolation is within 1/255 of the others.
using MatplotlibTable = std::array<uint32_t, 33>;
constexpr MatplotlibTable kViridis{0x440154, 0x470d60, 0x48186a, 0x482374, 0x472d7b, 0x453781, 0x424086,
                                   0x3e4989, 0x3b528b, 0x375b8d, 0x33638d, 0x2f6b8e, 0x2c728e, 0x297a8e,
                                   0x26828e, 0x23898e, 0x21918c, 0x1f988b, 0x1fa088, 0x22a785, 0x28ae80,
                                   0x32b67a, 0x3fbc73, 0x4ec36b, 0x5ec962, 0x70cf57, 0x84d44b, 0x98d83e,
                                   0xaddc30, 0xc2df23, 0xd8e219, 0xece51b, 0xfde725};
constexpr MatplotlibTable kInferno{0x000004, 0x040312, 0x0b0724, 0x150b37, 0x210c4a, 0x2f0a5b, 0x3d0965,
                                   0x4a0c6b, 0x57106e, 0x64156e, 0x71196e, 0x7d1e6d, 0x8a226a, 0x972766,
                                   0xa32c61, 0xb0315b, 0xbc3754, 0xc73e4c, 0xd24644, 0xdb503b, 0xe45a31,
                                   0xeb6628, 0xf1731d, 0xf68013, 0xf98e09, 0xfb9d07, 0xfcac11, 0xfbbc21,
                                   0xf9cb35, 0xf5db4c, 0xf2ea69, 0xf3f68a, 0xfcffa4};
constexpr MatplotlibTable kPlasma{0x0d0887, 0x220690, 0x310597, 0x3f049c, 0x4c02a1, 0x5901a5, 0x6600a7,
                                  0x7201a8, 0x7e03a8, 0x8a09a5, 0x9511a1, 0xa01a9c, 0xaa2395, 0xb32c8e,
                                  0xbc3587, 0xc43e7f, 0xcc4778, 0xd35171, 0xda5a6a, 0xe06363, 0xe66c5c,
                                  0xeb7655, 0xf0804e, 0xf58b47, 0xf89540, 0xfba139, 0xfdac33, 0xfeb82c,
                                  0xfdc527, 0xfcd225, 0xf8df25, 0xf4ed27, 0xf0f921};

glm::dvec3 fromHex(uint32_t rgb) {
  return glm::dvec3(rgb >> 16 & 255, rgb >> 8 & 255, rgb & 255) / 255.0;
}

std::vector<ColourPoint> fromTable(const MatplotlibTable& table) {
  std::vector<ColourPoint> points;
  for (size_t n = 0; n < table.size(); ++n)
    points.push_back({n + 1 == table.size() ? 1.0 : static_cast<double>(8 * n) / 255, fromHex(table[n])});
  return points;
}

/// Inferno without its darkest quarter, which cannot be told from a dark background.
std::vector<ColourPoint> glow() {
  std::vector<ColourPoint> points = fromTable(kInferno);
  points.erase(points.begin(), points.begin() + 8);
  const double begin = points.front().x;
  for (ColourPoint& point : points) point.x = (point.x - begin) / (1 - begin);
  return points;
}

// Diverging data is about both ends, so the middle is transparent.
const std::vector<OpacityPoint> kDivergingOpacities{{0, 0.4},      {0.125, 0.2}, {0.25, 0.08},
                                                    {0.375, 0.02}, {0.5, 0},     {0.625, 0.02},
                                                    {0.75, 0.08},  {0.875, 0.2}, {1, 0.4}};

struct Preset {
  const char* name;
  ColourSpace space;
  std::vector<ColourPoint> colours;
  std::vector<OpacityPoint> opacities;
};

const std::vector<Preset>& presets() {
  static const std::vector<Preset> all{
      {"viridis", ColourSpace::kRgb, fromTable(kViridis), defaultOpacityRamp(0, 1)},
      {"inferno", ColourSpace::kRgb, fromTable(kInferno), defaultOpacityRamp(0, 1)},
      {"glow", ColourSpace::kRgb, glow(), defaultOpacityRamp(0, 1)},
      {"plasma", ColourSpace::kRgb, fromTable(kPlasma), defaultOpacityRamp(0, 1)},
      {"cool-warm",
       ColourSpace::kDiverging,
       {{0, fromHex(0x3b4cc0)}, {0.5, glm::dvec3(0.865)}, {1, fromHex(0xb40426)}},
       kDivergingOpacities},
      {"grey", ColourSpace::kRgb, {{0, glm::dvec3(0)}, {1, glm::dvec3(1)}}, defaultOpacityRamp(0, 1)},
  };
  return all;
}

std::optional<TransferFunctionDefinition> findPreset(std::string_view name) {
  TransferFunctionDefinition definition;
  const auto named = [&](std::string_view found) {
    definition.name = found;
    definition.origin = fmt::format("preset '{}'", found);
  };
  for (const Preset& preset : presets()) {
    if (!isSameIgnoringCase(preset.name, name)) continue;
    named(preset.name);
    definition.colour_space = preset.space;
    definition.colours = preset.colours;
    definition.opacities = preset.opacities;
    return definition;
  }
  for (const PublishedMap& map : publishedMaps()) {
    if (!isSameIgnoringCase(map.name, name)) continue;
    named(map.name);
    definition.colour_space = map.space;
    for (const PublishedMap::Point& point : map.points)
      definition.colours.push_back({point.x, {point.red, point.green, point.blue}});
    definition.opacities =
        map.category == MapCategory::kDiverging ? kDivergingOpacities : defaultOpacityRamp(0, 1);
    return definition;
  }
  return std::nullopt;
}

/// Turns the colours round; the opacities stay.
void reverse(TransferFunctionDefinition& definition) {
  std::reverse(definition.colours.begin(), definition.colours.end());
  for (ColourPoint& point : definition.colours) point.x = 1 - point.x;
}

}  // namespace

// Roughly 0.4 t², over the default opacity unit, 1/100 of the data's diagonal. Rays cross some 60 such units,
// so that the lower quarter of the range is a haze through which the upper half stands out. A linear ramp
// that shows the top at all hides it in fog, and a cubic one leaves everything else too faint.
std::vector<OpacityPoint> defaultOpacityRamp(double low, double high) {
  std::vector<OpacityPoint> points{{0, 0}, {0.25, 0.02}, {0.5, 0.08}, {0.75, 0.2}, {1, 0.4}};
  for (OpacityPoint& point : points) point.x = low + point.x * (high - low);
  return points;
}

std::span<const PublishedMap> builtInMaps() {
  static const std::vector<PublishedMap> all = [] {
    std::vector<PublishedMap> maps{{"viridis", "matplotlib", MapCategory::kSequential, true},
                                   {"inferno", "matplotlib", MapCategory::kSequential, true},
                                   {"glow", "inferno's upper part", MapCategory::kSequential, true},
                                   {"plasma", "matplotlib", MapCategory::kSequential, true},
                                   {"cool-warm", "ParaView", MapCategory::kDiverging, true},
                                   {"grey", "-", MapCategory::kSequential, true}};
    maps.insert(maps.end(), publishedMaps().begin(), publishedMaps().end());
    return maps;
  }();
  return all;
}

TransferFunctionDefinition presetDefinition(std::string_view name) {
  if (const auto definition = findPreset(name)) return *definition;
  if (name.ends_with("_r") || name.ends_with("_R"))
    if (auto definition = findPreset(name.substr(0, name.size() - 2))) {
      reverse(*definition);
      definition->name = name;
      return *definition;
    }
  std::vector<std::string> names;
  for (const PublishedMap& map : builtInMaps()) names.emplace_back(map.name);
  throw UsageError(
      "unknown transfer function '{}'{}; expected a colour map such as viridis or cool-warm (curvisplat "
      "colormaps lists them) or a file whose name ends in .json",
      name, didYouMean(name, names));
}

std::string presetNames() {
  std::string names;
  for (const PublishedMap& map : builtInMaps()) names += (names.empty() ? "" : ", ") + std::string(map.name);
  return names;
}

}  // namespace curvisplat
