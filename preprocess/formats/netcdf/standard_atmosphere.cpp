#include "preprocess/formats/netcdf/standard_atmosphere.h"

#include <cmath>
#include <iterator>
#include <limits>

namespace curvisplat {
namespace {

constexpr double kGravity = 9.80665, kGasConstant = 287.05287;  // of dry air, J/(kg K)
constexpr double kGeopotentialRadius = 6356766;                 // metres

/// A layer from `height` (geopotential metres) up, with the temperature at its foot and its lapse in K/m.
struct Layer {
  double height, temperature, lapse;
};
constexpr Layer kLayers[] = {
    {0, 288.15, -0.0065}, {11000, 216.65, 0},       {20000, 216.65, 0.001},  {32000, 228.65, 0.0028},
    {47000, 270.65, 0},   {51000, 270.65, -0.0028}, {71000, 214.65, -0.002},
};
constexpr double kSeaLevelPressure = 101325;

double pressureAbove(const Layer& layer, double foot, double height) {
  const double rise = height - layer.height;
  if (layer.lapse == 0) return foot * std::exp(-kGravity * rise / (kGasConstant * layer.temperature));
  return foot *
         std::pow(1 + layer.lapse * rise / layer.temperature, -kGravity / (kGasConstant * layer.lapse));
}

double heightOf(const Layer& layer, double foot, double pascals) {
  if (layer.lapse == 0)
    return layer.height - kGasConstant * layer.temperature / kGravity * std::log(pascals / foot);
  const double ratio = std::pow(pascals / foot, -kGasConstant * layer.lapse / kGravity);
  return layer.height + layer.temperature / layer.lapse * (ratio - 1);
}

}  // namespace

double standardAltitude(double pascals) {
  if (!(pascals > 0)) return std::numeric_limits<double>::quiet_NaN();
  double foot = kSeaLevelPressure;
  const Layer* layer = kLayers;
  for (; layer + 1 != std::end(kLayers); ++layer) {
    const double next = pressureAbove(*layer, foot, (layer + 1)->height);
    if (pascals > next) break;
    foot = next;
  }
  const double geopotential = heightOf(*layer, foot, pascals);
  return kGeopotentialRadius * geopotential / (kGeopotentialRadius - geopotential);
}

}  // namespace curvisplat
