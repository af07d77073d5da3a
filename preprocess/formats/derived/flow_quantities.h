// What PLOT3D derives from density, momentum and energy of a perfect gas, by name and by its function
// numbers: one place for the formulas. They are those of VTK's PLOT3D reader, normalised as it does: the
// freestream has density 1 and sound speed 1, and so the pressure 1 / gamma.
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

/// What a quantity is computed from.
enum QuantityNeeds : unsigned {
  kNeedsDensity = 1,
  kNeedsVelocity = 2,
  kNeedsPressure = 4,
  kNeedsFreestream = 8,  // its Mach number
  kNeedsVelocityGradient = 16,
  kNeedsPressureGradient = 32,
  kNeedsJacobian = 64,
};

struct QuantityInfo {
  Quantity quantity;
  const char* name;
  const char* alias;  // another name, simplified; "" if there is none
  uint32_t function;  // PLOT3D's number; 0: it has none
  unsigned needs;     // QuantityNeeds
};

/// All of them.
std::span<const QuantityInfo> flowQuantities();
const QuantityInfo& infoOf(Quantity quantity);

/// A node's flow. What a quantity does not need may be anything.
struct FlowState {
  double density = 0, pressure = 0;
  glm::dvec3 velocity{0.0};
};
struct FlowGradients {
  glm::dmat3 velocity{0.0};  // [c]: of the velocity's component c
  glm::dvec3 pressure{0.0};
};

struct PerfectGas {
  double gamma = 1.4;
  double constant = 1;  // R
};

/// Of the flow: not i, j, k, jacobian and volume. Not finite where the flow does not exist (a density of 0, a
/// negative pressure).
double flowQuantity(Quantity quantity, const FlowState& flow, const FlowGradients& gradients,
                    const PerfectGas& gas, double freestream_mach);

/// From conserved quantities: of the energy a volume has, what is not in its motion.
inline double pressureOf(double density, const glm::dvec3& velocity, double energy, double gamma) {
  const double speed2 = velocity.x * velocity.x + velocity.y * velocity.y + velocity.z * velocity.z;
  return (gamma - 1) * (energy - 0.5 * density * speed2);
}

}  // namespace curvisplat
