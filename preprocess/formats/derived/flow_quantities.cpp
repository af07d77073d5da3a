#include "preprocess/formats/derived/flow_quantities.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr unsigned kThermal = kNeedsDensity | kNeedsPressure;

constexpr QuantityInfo kQuantities[] = {
    {Quantity::i, "i", "", 0, 0},
    {Quantity::j, "j", "", 0, 0},
    {Quantity::k, "k", "", 0, 0},
    {Quantity::jacobian, "jacobian", "", 0, kNeedsJacobian},
    {Quantity::volume, "volume", "", 0, kNeedsJacobian},
    {Quantity::pressure, "pressure", "p", 110, kNeedsPressure},
    {Quantity::pressure_coefficient, "pressure_coefficient", "cp", 111, kNeedsPressure | kNeedsFreestream},
    {Quantity::mach_number, "mach_number", "mach", 112, kThermal | kNeedsVelocity},
    {Quantity::sound_speed, "sound_speed", "speedofsound", 113, kThermal},
    {Quantity::temperature, "temperature", "", 120, kThermal},
    {Quantity::enthalpy, "enthalpy", "", 130, kThermal},
    {Quantity::internal_energy, "internal_energy", "", 140, kThermal},
    {Quantity::kinetic_energy, "kinetic_energy", "", 144, kNeedsVelocity},
    {Quantity::velocity_magnitude, "velocity_magnitude", "speed", 153, kNeedsVelocity},
    {Quantity::stagnation_energy, "stagnation_energy", "", 163, kThermal | kNeedsVelocity},
    {Quantity::entropy, "entropy", "", 170, kThermal},
    {Quantity::swirl, "swirl", "", 184, kNeedsDensity | kNeedsVelocity | kNeedsVelocityGradient},
    {Quantity::pressure_gradient_magnitude, "pressure_gradient_magnitude", "pressuregradient", 210,
     kNeedsPressureGradient},
    {Quantity::vorticity_magnitude, "vorticity_magnitude", "vorticity", 211, kNeedsVelocityGradient},
    {Quantity::q_criterion, "q_criterion", "q", 0, kNeedsVelocityGradient},
};

glm::dvec3 curl(const glm::dmat3& gradient) {
  return {gradient[2].y - gradient[1].z, gradient[0].z - gradient[2].x, gradient[1].x - gradient[0].y};
}

/// Half of what the rotation's norm has over the strain's, squared: of ∂a u_b, the sum of -∂a u_b ∂b u_a / 2.
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
    case Quantity::pressure:
      return p;
    case Quantity::pressure_coefficient:
      return (p - 1 / gamma) / (0.5 * freestream_mach * freestream_mach);
    case Quantity::mach_number:
      return std::sqrt(speed2 * rho / (gamma * p));
    case Quantity::sound_speed:
      return std::sqrt(gamma * p / rho);
    case Quantity::temperature:
      return p / (rho * gas.constant);
    case Quantity::enthalpy:
      return gamma / (gamma - 1) * p / rho;
    case Quantity::internal_energy:
      return p / ((gamma - 1) * rho);
    case Quantity::kinetic_energy:
      return 0.5 * speed2;
    case Quantity::velocity_magnitude:
      return std::sqrt(speed2);
    case Quantity::stagnation_energy:
      return p / (gamma - 1) + 0.5 * rho * speed2;
    case Quantity::entropy:
      return gas.constant / (gamma - 1) * std::log(gamma * p / std::pow(rho, gamma));
    case Quantity::swirl:
      return speed2 > 0 ? rho * glm::dot(curl(gradients.velocity), flow.velocity) / speed2 : 0.0;
    case Quantity::pressure_gradient_magnitude:
      return glm::length(gradients.pressure);
    case Quantity::vorticity_magnitude:
      return glm::length(curl(gradients.velocity));
    case Quantity::q_criterion:
      return qCriterion(gradients.velocity);
    case Quantity::i:
    case Quantity::j:
    case Quantity::k:
    case Quantity::jacobian:
    case Quantity::volume:
      break;
  }
  CURVISPLAT_CHECK(!"a quantity of the grid, not of the flow");
  return 0;
}

}  // namespace curvisplat
