// A scalar and a density on a regular lattice, as two sparse OpenVDB grids of floats in one file.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <ostream>
#include <string>

namespace curvisplat {

/// The grids are called "density", a fog volume, and "value". Not for several threads at once.
class FogVolume {
 public:
  virtual ~FogVolume() = default;

  /// Fills a voxel; those that are never set stay inactive.
  virtual void set(const std::array<uint32_t, 3>& voxel, float value, float density) = 0;
  /// Memory of both grids. Walks all nodes.
  virtual uint64_t bytes() const = 0;
  virtual uint64_t activeVoxels() const = 0;
  /// Metadata of "value".
  virtual void describe(const std::string& scalar, const std::string& unit, double time) = 0;
  /// Throws what `file` throws if it has exceptions on, and OpenVDB's exceptions.
  virtual void write(std::ostream& file) const = 0;
};

/// The middle of voxel (0, 0, 0) is `origin`; voxels are cubes of `side` world units.
std::unique_ptr<FogVolume> makeFogVolume(const glm::dvec3& origin, double side);

}  // namespace curvisplat
