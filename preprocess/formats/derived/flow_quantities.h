// PLOT3D's functions of the density, momentum and energy of a perfect gas: names, function numbers and
// formulas. The formulas and the normalisation are those of VTK's PLOT3D reader: the freestream has density 1
// and sound speed 1, hence pressure 1 / gamma.
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>

namespace curvisplat {

enum class Quantity {
  kI,
  kJ,
  kK,
  kJacobian,
  kVolume,
  kPressure,
  kPressureCoefficient,
  kMachNumber,
  kSoundSpeed,
  kTemperature,
  kEnthalpy,
  kInternalEnergy,
  kKineticEnergy,
  kVelocityMagnitude,
  kStagnationEnergy,
  kEntropy,
  kSwirl,
  kPressureGradientMagnitude,
  kVorticityMagnitude,
  kQCriterion,
};

/// The inputs that a quantity is computed from.
enum QuantityNeeds : unsigned {
  kNeedsDensity = 1,
  kNeedsVelocity = 2,
  kNeedsPressure = 4,
  kNeedsFreestream = 8,  // the freestream's Mach number
  kNeedsVelocityGradient = 16,
  kNeedsPressureGradient = 32,
  kNeedsJacobian = 64,
  kNeedsVolume = 128,  // of the cells around the node
};

struct QuantityInfo {
  Quantity quantity;
  const char* name;
  const char* alias;  // another name, simplified; "" if there is none
  uint32_t function;  // PLOT3D's function number; 0: none
  unsigned needs;     // QuantityNeeds
};

/// All quantities, in the order of the enumerators.
std::span<const QuantityInfo> flowQuantities();
const QuantityInfo& infoOf(Quantity quantity);

/// The flow at one sample. Members that a quantity does not need are ignored.
struct FlowState {
  double density = 0, pressure = 0;
  glm::dvec3 velocity{0.0};
};
struct FlowGradients {
  glm::dmat3 velocity{0.0};  // [c]: the gradient of the velocity's component c
  glm::dvec3 pressure{0.0};
};

struct PerfectGas {
  double gamma = 1.4;
  double constant = 1;  // R
};

/// Computes a quantity of the flow (any but i, j, k, jacobian and volume). Not finite where it is undefined
/// (density 0, negative pressure).
double flowQuantity(Quantity quantity, const FlowState& flow, const FlowGradients& gradients,
                    const PerfectGas& gas, double freestream_mach);

/// Pressure from the conserved quantities: (gamma - 1) times the energy that is not kinetic.
inline double pressureOf(double density, const glm::dvec3& velocity, double energy, double gamma) {
  const double speed2 = velocity.x * velocity.x + velocity.y * velocity.y + velocity.z * velocity.z;
  return (gamma - 1) * (energy - 0.5 * density * speed2);
}

}  // namespace curvisplat
