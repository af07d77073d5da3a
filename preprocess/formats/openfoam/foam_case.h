// Finds what a case of OpenFOAM consists of by the names of its folders: regions, processors, times. Reads no mesh. A missing
// folder is an empty one; all throw Error for one that is there and cannot be read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace curvisplat {

/// The meaning of a user's path: a case, and a region of it if that is CASE/constant/REGION.
struct FoamCasePath {
  std::filesystem::path folder;
  std::string region;
};
FoamCasePath foamCaseOf(const std::filesystem::path& path);

/// Whether a region has a mesh of its own; "" is the region that has no name.
bool hasFoamMesh(const std::filesystem::path& folder, const std::filesystem::path& region);
/// Whether any region has a mesh.
bool hasFoamMesh(const std::filesystem::path& folder);
/// The regions with names that have a mesh of their own, in the order of their names.
std::vector<std::string> foamRegionsIn(const std::filesystem::path& folder);
/// The meshes of which the file of the faces is missing, though that of the points is there, as folders: "constant/fluid/polyMesh".
std::vector<std::string> foamMeshesWithoutFaces(const std::filesystem::path& folder);

/// Names the place of a processor's files.
struct FoamProcessor {
  std::filesystem::path folder;
  uint32_t part = 0;  // of collated files
};
/// The processors of a decomposed case that have folders, in their order. Empty if none has a mesh.
std::vector<FoamProcessor> foamProcessorsOf(const std::filesystem::path& folder);
/// Throws Error unless these are processors 0, 1, 2, ..., with a mesh each.
void requireAllProcessors(const std::vector<FoamProcessor>& processors);

/// The times that have a folder, in their order, with the folders' names.
std::vector<std::pair<double, std::string>> foamTimesIn(const std::filesystem::path& folder);

}  // namespace curvisplat
