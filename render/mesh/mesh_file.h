// Reads surfaces from files: STL and PLY, each as text or binary, and Wavefront OBJ.
//
// Files come from anyone. Whatever a file says of its sizes is compared with the bytes that are there before
// anything is allocated; the memory taken is at most about 20 times the file's size. What is not a surface is
// refused in one line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "render/mesh/triangle_mesh.h"

namespace curvisplat {

/// By its first bytes and its extension. Throws Error: what is wrong, what was found, what is expected.
TriangleMesh readMeshFile(const std::filesystem::path& path);

/// The same from bytes; `path` is for messages and the extension.
RawMesh parseMesh(std::span<const std::byte> bytes, const std::filesystem::path& path);

}  // namespace curvisplat
