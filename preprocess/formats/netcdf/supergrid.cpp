#include "preprocess/formats/netcdf/supergrid.h"

#include <algorithm>
#include <string>
#include <string_view>

#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

/// By its units, else by its name: MOM6's are "degrees".
bool hasRole(const NetcdfFiles& file, const NetcdfVariable& variable, CfRole role) {
  if (!variable.numeric) return false;
  const CfRole own = cfRole(file, variable);
  if (own == CfRole::kLongitude || own == CfRole::kLatitude) return own == role;
  const std::string units = lowerCase(variable.text("units"));
  return (units == "degrees" || units == "degree") &&
         lowerCase(variable.name) == (role == CfRole::kLongitude ? "x" : "y");
}

/// The names in a mosaic's `gridfiles`: one for each of its first dimension.
std::vector<std::string> gridsOf(const std::filesystem::path& path) {
  const NetcdfFile file(path);
  const NetcdfVariable* const names = file.find("gridfiles");
  if (!names || names->dims.size() != 2) return {};
  const std::string text = file.readText(*names);
  const uint64_t length = file.dimension(*names, 1).length;
  std::vector<std::string> grids;
  for (uint64_t at = 0; length > 0 && at + length <= text.size(); at += length) {
    std::string name = text.substr(at, length);
    name.resize(std::min(name.size(), name.find('\0')));
    name.erase(name.find_last_not_of(' ') + 1);
    if (!name.empty()) grids.push_back(std::move(name));
  }
  return grids;
}

bool isMosaic(const std::filesystem::path& path) {
  return lowerCase(path.filename().string()).find("mosaic") != std::string::npos &&
         NetcdfFile::recognises(InputFile(path));
}

}  // namespace

std::optional<CfTerm> supergridOf(const NetcdfFiles& file, const NetcdfVariable& variable,
                                  const CfDimensions& dims, CfRole role) {
  for (const NetcdfVariable& other : file.variables()) {
    if (other.file == variable.file || !hasRole(file, other, role)) continue;
    if (const auto term = CfTerm::ofSupergrid(file, other, dims)) return term;
  }
  return std::nullopt;
}

std::vector<std::filesystem::path> withGridsOfMosaics(const std::vector<std::filesystem::path>& files) {
  std::vector<std::filesystem::path> all = files;
  for (const std::filesystem::path& mosaic : files) {
    if (!isMosaic(mosaic)) continue;
    for (const std::string& name : gridsOf(mosaic)) {
      // Only files beside the mosaic: a file that names others must not reach elsewhere.
      const std::filesystem::path grid = mosaic.parent_path() / std::filesystem::path(name).filename();
      std::error_code unreadable;
      if (!std::filesystem::is_regular_file(grid, unreadable))
        throw Error(
            "{}: names the grid file {}, which is not beside it; put it there, or leave the mosaic out",
            mosaic.string(), grid.filename().string());
      const bool given = std::any_of(all.begin(), all.end(), [&](const std::filesystem::path& one) {
        std::error_code error;
        return std::filesystem::equivalent(one, grid, error);
      });
      if (!given) all.push_back(grid);
    }
  }
  return all;
}

}  // namespace curvisplat
