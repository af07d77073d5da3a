#include "preprocess/formats/netcdf/fms_mosaic.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <string>
#include <string_view>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxDigits = 4;

bool isLetter(char c) {
  return c >= 'a' && c <= 'z';
}

bool isDigit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

std::optional<uint32_t> tileNumber(const std::filesystem::path& path) {
  static const std::string word = "tile";
  const std::string name = lowerCase(path.filename().string());
  for (size_t at = name.rfind(word); at != std::string::npos; at = at > 0 ? name.rfind(word, at - 1) : at) {
    const size_t begin = at + word.size();
    size_t end = begin;
    while (end < name.size() && isDigit(name[end])) ++end;
    const bool whole = (at == 0 || !isLetter(name[at - 1])) && (end == name.size() || !isLetter(name[end]));
    if (whole && end > begin && end - begin <= kMaxDigits) {
      uint32_t number = 0;
      std::from_chars(name.data() + begin, name.data() + end, number);
      return number;
    }
    if (at == 0) break;
  }
  return std::nullopt;
}

namespace {

using std::filesystem::path;

/// Whether a variable has a role by its units, else by its name: MOM6's are "degrees".
bool hasRole(const NetcdfFiles& file, const NetcdfVariable& variable, CfRole role) {
  if (!variable.numeric) return false;
  const CfRole own = cfRole(file, variable);
  if (own == CfRole::kLongitude || own == CfRole::kLatitude) return own == role;
  const std::string units = lowerCase(variable.text("units"));
  return (units == "degrees" || units == "degree") &&
         lowerCase(variable.name) == (role == CfRole::kLongitude ? "x" : "y");
}

/// The strings of a variable that are not empty; none if there is no such variable.
std::vector<std::string> namesIn(const NetcdfFile& file, std::string_view variable) {
  std::vector<std::string> names;
  if (const NetcdfVariable* const found = file.find(variable)) names = file.readStrings(*found);
  std::erase(names, "");
  return names;
}

std::vector<std::string> gridsOf(const NetcdfFile& mosaic) {
  return namesIn(mosaic, "gridfiles");
}

/// Only files beside `file`: one that names others must not reach elsewhere.
path beside(const path& file, const std::string& name) {
  return file.parent_path() / path(name).filename();
}

bool isFile(const path& file) {
  std::error_code unreadable;
  return std::filesystem::is_regular_file(file, unreadable);
}

/// Whether its name is one that mosaics and the grids of coupled models have: other files are not opened to
/// look.
bool mayBeMosaic(const path& file) {
  const std::string name = lowerCase(file.filename().string());
  return (name.find("mosaic") != std::string::npos || name.find("grid_spec") != std::string::npos) &&
         !tileNumber(file) && isFile(file) && NetcdfFile::recognises(InputFile(file));
}

bool numbered(const std::vector<std::string>& names) {
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return tileNumber(name).has_value(); });
}

/// The grid files of the component of a coupled model that the data are of: those with tiles if the data are
/// in tiles.
std::vector<std::string> gridsOfComponent(const path& coupled, const std::vector<std::string>& mosaics,
                                          bool tiles) {
  std::vector<std::vector<std::string>> fitting;
  for (const std::string& name : mosaics) {
    const path mosaic = beside(coupled, name);
    if (!isFile(mosaic) || !NetcdfFile::recognises(InputFile(mosaic))) continue;
    std::vector<std::string> grids = gridsOf(NetcdfFile(mosaic));
    if (!grids.empty() && numbered(grids) == tiles &&
        std::find(fitting.begin(), fitting.end(), grids) == fitting.end())
      fitting.push_back(std::move(grids));
  }
  if (fitting.empty())
    throw Error(
        "{}: names the mosaics {}; none of them with {} is beside it; put it there, or give the grid files "
        "of the data",
        coupled.string(), listed(mosaics), tiles ? "tiles" : "a grid of one tile");
  if (fitting.size() > 1)
    throw Error("{}: names several grids ({}, {}); give the one of the data in its place", coupled.string(),
                fitting[0][0], fitting[1][0]);
  return fitting[0];
}

/// The names of the grid files that `file` names, itself or by the mosaics that it names.
std::vector<std::string> gridsNamedBy(const path& file, bool tiles) {
  const NetcdfFile opened(file);
  if (std::vector<std::string> grids = gridsOf(opened); !grids.empty()) return grids;
  std::vector<std::string> mosaics;
  for (const char* component : {"atm_mosaic_file", "ocn_mosaic_file", "lnd_mosaic_file"})
    for (const std::string& name : namesIn(opened, component))
      if (std::find(mosaics.begin(), mosaics.end(), name) == mosaics.end()) mosaics.push_back(name);
  return mosaics.empty() ? mosaics : gridsOfComponent(file, mosaics, tiles);
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

std::vector<path> withGridsOfMosaics(const std::vector<path>& files) {
  std::vector<path> all = files;
  std::set<uint32_t> tiles;
  for (const path& file : files)
    if (const auto number = tileNumber(file)) tiles.insert(*number);
  for (const path& mosaic : files) {
    if (!mayBeMosaic(mosaic)) continue;
    for (const std::string& name : gridsNamedBy(mosaic, !tiles.empty())) {
      const path grid = beside(mosaic, name);
      if (const auto number = tileNumber(grid); number && !tiles.empty() && !tiles.contains(*number))
        continue;
      if (!isFile(grid))
        throw Error(
            "{}: names the grid file {}, which is not beside it; put it there, or leave the mosaic out",
            mosaic.string(), grid.filename().string());
      const bool given = std::any_of(all.begin(), all.end(), [&](const path& one) {
        std::error_code error;
        return std::filesystem::equivalent(one, grid, error);
      });
      if (!given) all.push_back(grid);
    }
  }
  return all;
}

}  // namespace curvisplat
