#include "preprocess/formats/derived/flow_quantities.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr unsigned kThermal = kNeedsDensity | kNeedsPressure;

constexpr QuantityInfo kQuantities[] = {
    {Quantity::kI, "i", "", 0, 0},
    {Quantity::kJ, "j", "", 0, 0},
    {Quantity::kK, "k", "", 0, 0},
    {Quantity::kJacobian, "jacobian", "", 0, kNeedsJacobian},
    {Quantity::kVolume, "volume", "", 0, kNeedsVolume},
    {Quantity::kPressure, "pressure", "p", 110, kNeedsPressure},
    {Quantity::kPressureCoefficient, "pressure_coefficient", "cp", 111, kNeedsPressure | kNeedsFreestream},
    {Quantity::kMachNumber, "mach_number", "mach", 112, kThermal | kNeedsVelocity},
    {Quantity::kSoundSpeed, "sound_speed", "speedofsound", 113, kThermal},
    {Quantity::kTemperature, "temperature", "", 120, kThermal},
    {Quantity::kEnthalpy, "enthalpy", "", 130, kThermal},
    {Quantity::kInternalEnergy, "internal_energy", "", 140, kThermal},
    {Quantity::kKineticEnergy, "kinetic_energy", "", 144, kNeedsVelocity},
    {Quantity::kVelocityMagnitude, "velocity_magnitude", "speed", 153, kNeedsVelocity},
    {Quantity::kStagnationEnergy, "stagnation_energy", "", 163, kThermal | kNeedsVelocity},
    {Quantity::kEntropy, "entropy", "", 170, kThermal},
    {Quantity::kSwirl, "swirl", "", 184, kNeedsDensity | kNeedsVelocity | kNeedsVelocityGradient},
    {Quantity::kPressureGradientMagnitude, "pressure_gradient_magnitude", "pressuregradient", 210,
     kNeedsPressureGradient},
    {Quantity::kVorticityMagnitude, "vorticity_magnitude", "vorticity", 211, kNeedsVelocityGradient},
    {Quantity::kQCriterion, "q_criterion", "q", 0, kNeedsVelocityGradient},
};

glm::dvec3 curl(const glm::dmat3& gradient) {
  return {gradient[2].y - gradient[1].z, gradient[0].z - gradient[2].x, gradient[1].x - gradient[0].y};
}

/// (|rotation tensor|² - |strain tensor|²) / 2 = -1/2 sum over a, b of (∂a u_b) (∂b u_a).
double qCriterion(const glm::dmat3& gradient) {
  double sum = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) sum += gradient[a][b] * gradient[b][a];
  return -0.5 * sum;
}

}  // namespace

std::span<const QuantityInfo> flowQuantities() {
  return kQuantities;
}

const QuantityInfo& infoOf(Quantity quantity) {
  const QuantityInfo& info = kQuantities[static_cast<size_t>(quantity)];
  CURVISPLAT_CHECK(info.quantity == quantity);
  return info;
}

double flowQuantity(Quantity quantity, const FlowState& flow, const FlowGradients& gradients,
                    const PerfectGas& gas, double freestream_mach) {
  const double gamma = gas.gamma, p = flow.pressure, rho = flow.density;
  const double speed2 = glm::dot(flow.velocity, flow.velocity);
  switch (quantity) {
    case Quantity::kPressure:
      return p;
    case Quantity::kPressureCoefficient:
      return (p - 1 / gamma) / (0.5 * freestream_mach * freestream_mach);
    case Quantity::kMachNumber:
      return std::sqrt(speed2 * rho / (gamma * p));
    case Quantity::kSoundSpeed:
      return std::sqrt(gamma * p / rho);
    case Quantity::kTemperature:
      return p / (rho * gas.constant);
    case Quantity::kEnthalpy:
      return gamma / (gamma - 1) * p / rho;
    case Quantity::kInternalEnergy:
      return p / ((gamma - 1) * rho);
    case Quantity::kKineticEnergy:
      return 0.5 * speed2;
    case Quantity::kVelocityMagnitude:
      return std::sqrt(speed2);
    case Quantity::kStagnationEnergy:
      return p / (gamma - 1) + 0.5 * rho * speed2;
    case Quantity::kEntropy:
      return gas.constant / (gamma - 1) * std::log(gamma * p / std::pow(rho, gamma));
    case Quantity::kSwirl:
      return speed2 > 0 ? rho * glm::dot(curl(gradients.velocity), flow.velocity) / speed2 : 0.0;
    case Quantity::kPressureGradientMagnitude:
      return glm::length(gradients.pressure);
    case Quantity::kVorticityMagnitude:
      return glm::length(curl(gradients.velocity));
    case Quantity::kQCriterion:
      return qCriterion(gradients.velocity);
    case Quantity::kI:
    case Quantity::kJ:
    case Quantity::kK:
    case Quantity::kJacobian:
    case Quantity::kVolume:
      break;
  }
  CURVISPLAT_CHECK(!"a quantity of the grid, not of the flow");
  return 0;
}

}  // namespace curvisplat
