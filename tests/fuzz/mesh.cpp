// Surfaces: a byte that chooses the file's extension, and the file. What is read has normals and valid corners.
#include "render/mesh/mesh_file.h"

#include <cmath>

#include "stream/base/check.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzMesh(std::span<const std::byte> bytes) {
  constexpr const char* kNames[] = {"a.stl", "a.ply", "a.obj", "a"};
  FuzzInput input(bytes);
  const char* const name = kNames[input.take<uint8_t>() % 4];
  const TriangleMesh mesh = meshOf(parseMesh(input.rest(), name));
  CURVISPLAT_CHECK_OP(mesh.normals.size(), ==, mesh.positions.size());
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t corner : triangle) CURVISPLAT_CHECK_OP(corner, <, mesh.positions.size());
  for (const glm::vec3& normal : mesh.normals)
    for (int axis = 0; axis < 3; ++axis) CURVISPLAT_CHECK(std::abs(normal[axis]) <= 1.0001f);
}

const RegisteredFuzzTarget mesh_target("mesh", fuzzMesh);

}  // namespace
}  // namespace curvisplat
