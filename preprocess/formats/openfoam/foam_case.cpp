#include "preprocess/formats/openfoam/foam_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <system_error>
#include <tuple>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/openfoam/foam_file.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

}  // namespace

bool hasFoamMesh(const fs::path& folder, const fs::path& region) {
  return FoamFile::exists(folder / "constant" / region / "polyMesh" / "faces");
}

FoamCasePath foamCaseOf(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error))
    return {path.parent_path().empty() ? fs::path(".") : path.parent_path(), ""};
  const fs::path region = path.has_filename() ? path : path.parent_path(), constant = region.parent_path();
  if (constant.filename() == "constant" && FoamFile::exists(region / "polyMesh" / "faces"))
    return {constant.has_parent_path() ? constant.parent_path() : fs::path("."), region.filename().string()};
  return {path, ""};
}

std::vector<std::string> foamRegionsIn(const fs::path& folder) {
  std::vector<std::string> regions;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder / "constant", error))
    if (const std::string name = entry.path().filename().string(); hasFoamMesh(folder, name))
      regions.push_back(name);
  std::sort(regions.begin(), regions.end());
  return regions;
}

std::vector<std::string> foamMeshesWithoutFaces(const fs::path& folder) {
  std::vector<fs::path> meshes{fs::path("constant") / "polyMesh"};
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder / "constant", error))
    meshes.push_back("constant" / entry.path().filename() / "polyMesh");
  std::vector<std::string> found;
  for (const fs::path& mesh : meshes)
    if (FoamFile::exists(folder / mesh / "points") && !FoamFile::exists(folder / mesh / "faces"))
      found.push_back(mesh.string());
  std::sort(found.begin(), found.end());
  return found;
}

bool hasFoamMesh(const fs::path& folder) {
  return hasFoamMesh(folder, "") || !foamRegionsIn(folder).empty();
}

std::vector<FoamProcessor> foamProcessorsOf(const fs::path& folder) {
  std::vector<FoamProcessor> processors;
  for (int n = 0; hasFoamMesh(folder / fmt::format("processor{}", n)); ++n)
    processors.push_back({folder / fmt::format("processor{}", n)});
  if (!processors.empty()) return processors;
  // "processors8", "processors8_0-3", or "processors" alone
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (!entry.path().filename().string().starts_with("processors") || !hasFoamMesh(entry.path())) continue;
    const fs::path region = hasFoamMesh(entry.path(), "") ? "" : foamRegionsIn(entry.path()).front();
    const uint32_t parts = FoamFile::processorsIn(entry.path() / "constant" / region / "polyMesh" / "faces");
    for (uint32_t part = 0; part < parts; ++part) processors.push_back({entry.path(), part});
  }
  std::sort(processors.begin(), processors.end(), [](const FoamProcessor& a, const FoamProcessor& b) {
    return std::tie(a.folder, a.part) < std::tie(b.folder, b.part);
  });
  return processors;
}

std::vector<std::pair<double, std::string>> foamTimesIn(const fs::path& folder) {
  std::vector<std::pair<double, std::string>> times;
  for (const auto& entry : fs::directory_iterator(folder)) {
    double time = 0;
    // A run that diverges may leave a folder "nan", which has no place among times.
    if (entry.is_directory() && parseNumber(entry.path().filename().string(), time) && std::isfinite(time))
      times.emplace_back(time, entry.path().filename().string());
  }
  std::sort(times.begin(), times.end());
  return times;
}

}  // namespace curvisplat
