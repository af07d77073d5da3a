// A transfer function as command-line options state it: a colour map, the range that it spans, a curve of
// opacities over that range and the opacity unit. It is short enough to print, and what is printed gives the
// same function: roundedTo() makes numbers of few digits, which people can read and type. Plain values; any
// thread.
#pragma once

#include <glm/vec4.hpp>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "render/colour/scalar_axis.h"
#include "render/colour/transfer_function.h"
#include "stream/base/json_document.h"

namespace curvisplat {

/// A definition over 0..1 spread over `range`: linearly, or by `asinh`, where its curves are replaced by
/// short straight lines. Throws UsageError if the range is reversed or empty.
TransferFunctionDefinition spreadOver(TransferFunctionDefinition definition, std::pair<double, double> range,
                                      const std::optional<AsinhScale>& asinh);

/// The colour maps of a picture that names none. Rare values are mostly the highest, or those at both ends: these stand
/// out against the background.
struct DefaultMaps {
  const char* sequential;
  const char* diverging;
};
constexpr DefaultMaps kMapsOnDark{"glow", "cool-warm"};
constexpr DefaultMaps kMapsOnLight{"matter", "cool-warm-extended"};
/// `background`: premultiplied. A transparent one counts as light: such pictures are for pages.
DefaultMaps mapsOn(const glm::vec4& background);
/// #15171c, the background of pictures that name none.
constexpr glm::vec4 kDefaultBackground{0x15 / 255.0f, 0x17 / 255.0f, 0x1c / 255.0f, 1};

/// A transfer function in the terms of the options of `render`.
struct FunctionParts {
  std::string map = kMapsOnDark.sequential;  // a preset
  std::pair<double, double> range{0, 1};
  std::optional<AsinhScale> asinh;
  std::vector<OpacityPoint> opacities;  // x: 0..1 along the range; empty: those of the preset
  double opacity_unit = 1;

  /// The points as scalars. Throws UsageError if the preset does not exist, or a range that is reversed or
  /// empty.
  TransferFunctionDefinition definition() const;
  TransferFunction function() const;
};

/// Parses "0.2:0,0.5:0.8,1:0.1": position along the range and opacity, each 0..1, positions not decreasing,
/// two or more. Points at 0 and 1 are added where the list lacks them. Throws UsageError that begins with
/// `option`.
std::vector<OpacityPoint> parseOpacities(std::string_view option, std::string_view text);
/// Writes the text that parseOpacities() reads.
std::string textOf(const std::vector<OpacityPoint>& opacities);

/// The parts as the JSON of view files and of films has them: map, range, asinh, opacities and opacity_unit.
nlohmann::ordered_json jsonOf(const FunctionParts& parts);
/// Reads that. Throws Error with the field; whether the map exists is not checked.
FunctionParts functionPartsFrom(const JsonField& fields);
/// The list of parseOpacities(). Throws Error with the field.
std::vector<OpacityPoint> opacitiesFrom(const JsonField& field);

/// `value` rounded to `digits` decimal digits of `scale` (> 0): 0.1234 for (0.12344, 0.5, 4). The result is
/// the double nearest to the decimal number, so that it prints with few digits.
double roundedTo(double value, double scale, int digits);

}  // namespace curvisplat
