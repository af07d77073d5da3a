#include "preprocess/formats/openfoam/foam_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <tuple>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/openfoam/foam_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// Returns the paths in the folder; none if there is no such folder.
std::vector<fs::path> entriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  if (!isThere(folder)) return entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    entries.push_back(entry->path());
  if (error) throw Error("{}: cannot be listed: {}", folder.string(), error.message());
  return entries;
}

/// The number in "processor7".
std::optional<uint32_t> processorNumber(const std::string& name) {
  constexpr std::string_view kBegin = "processor";
  uint32_t number = 0;
  const char* const end = name.data() + name.size();
  if (!name.starts_with(kBegin)) return std::nullopt;
  const auto [stop, error] = std::from_chars(name.data() + kBegin.size(), end, number);
  return error == std::errc{} && stop == end ? std::optional(number) : std::nullopt;
}

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
  for (const fs::path& entry : entriesOf(folder / "constant"))
    if (const std::string name = entry.filename().string(); hasFoamMesh(folder, name))
      regions.push_back(name);
  std::sort(regions.begin(), regions.end());
  return regions;
}

std::vector<std::string> foamMeshesWithoutFaces(const fs::path& folder) {
  std::vector<fs::path> meshes{fs::path("constant") / "polyMesh"};
  for (const fs::path& entry : entriesOf(folder / "constant"))
    meshes.push_back("constant" / entry.filename() / "polyMesh");
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
  const std::vector<fs::path> entries = entriesOf(folder);
  std::set<uint32_t> numbers;
  for (const fs::path& entry : entries)
    if (const auto number = processorNumber(entry.filename().string())) numbers.insert(*number);
  for (const uint32_t number : numbers) processors.push_back({folder / fmt::format("processor{}", number)});
  const auto has_mesh = [](const FoamProcessor& processor) { return hasFoamMesh(processor.folder); };
  if (std::any_of(processors.begin(), processors.end(), has_mesh)) return processors;
  processors.clear();
  // "processors8", "processors8_0-3", or "processors" alone
  for (const fs::path& entry : entries) {
    if (!entry.filename().string().starts_with("processors") || !hasFoamMesh(entry)) continue;
    const fs::path region = hasFoamMesh(entry, "") ? "" : foamRegionsIn(entry).front();
    const uint32_t parts = FoamFile::processorsIn(entry / "constant" / region / "polyMesh" / "faces");
    for (uint32_t part = 0; part < parts; ++part) processors.push_back({entry, part});
  }
  std::sort(processors.begin(), processors.end(), [](const FoamProcessor& a, const FoamProcessor& b) {
    return std::tie(a.folder, a.part) < std::tie(b.folder, b.part);
  });
  return processors;
}

void requireAllProcessors(const std::vector<FoamProcessor>& processors) {
  uint32_t next = 0;
  for (const FoamProcessor& processor : processors) {
    const auto number = processorNumber(processor.folder.filename().string());
    if (!number) return;  // collated
    if (*number != next)
      throw Error("{}: is missing; the case has processors up to {}: copy it here, or reconstruct the case",
                  (processor.folder.parent_path() / fmt::format("processor{}", next)).string(),
                  processors.back().folder.filename().string());
    if (!hasFoamMesh(processor.folder))
      throw Error("{}: has no mesh (constant/polyMesh/faces), as the other processors have",
                  processor.folder.string());
    ++next;
  }
}

std::vector<std::pair<double, std::string>> foamTimesIn(const fs::path& folder) {
  std::vector<std::pair<double, std::string>> times;
  for (const fs::path& entry : entriesOf(folder)) {
    double time = 0;
    // A run that diverges may leave a folder "nan", which has no place among times.
    const std::string name = entry.filename().string();
    if (parseNumber(name, time) && std::isfinite(time) && isThere(entry) && fs::is_directory(entry))
      times.emplace_back(time, name);
  }
  std::sort(times.begin(), times.end());
  return times;
}

}  // namespace curvisplat
