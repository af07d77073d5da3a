#include "preprocess/formats/netcdf/netcdf_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;

/// The times of a file's data are its own, whatever those of a grid file before it are.
bool countsTime(const NetcdfVariable& variable) {
  return variable.dims.size() == 1 && variable.text("units").find(" since ") != std::string::npos;
}

}  // namespace

NetcdfFiles::NetcdfFiles(const std::vector<std::filesystem::path>& paths) {
  for (const std::filesystem::path& path : paths) {
    if (!files_.empty() && !NetcdfFile::recognises(InputFile(path)))
      throw Error("{}: is not a NetCDF file; expected one, like {}, for further variables of its grid",
                  path.string(), paths.front().string());
    files_.push_back(std::make_unique<NetcdfFile>(path));
    add(*files_.back());
  }
}

void NetcdfFiles::add(const NetcdfFile& file) {
  std::vector<size_t> merged;  // [the file's dimension]
  for (const NetcdfDimension& dimension : file.dimensions()) {
    const auto same = std::find_if(dimensions_.begin(), dimensions_.end(), [&](const NetcdfDimension& other) {
      return !dimension.name.empty() && other.name == dimension.name && other.length == dimension.length;
    });
    merged.push_back(static_cast<size_t>(same - dimensions_.begin()));
    if (same == dimensions_.end()) dimensions_.push_back(dimension);
  }
  std::vector<std::string> twice;
  for (const NetcdfVariable& variable : file.variables()) {
    if (find(variable.name) && !countsTime(variable)) {
      if (variable.dims.size() >= 3) twice.push_back(variable.name);
      continue;
    }
    numbers_.try_emplace(variable.name, variables_.size());
    NetcdfVariable& added = variables_.emplace_back(variable);
    added.file = files_.size() - 1;
    for (size_t& dim : added.dims) dim = merged.at(dim);
  }
  if (twice.empty()) return;
  const size_t listed = std::min(kNamesListed, twice.size());
  std::string names =
      fmt::format("{}", fmt::join(twice.begin(), twice.begin() + static_cast<ptrdiff_t>(listed), ", "));
  if (twice.size() > listed) names += fmt::format(" and {} more", twice.size() - listed);
  duplicates_.push_back(
      fmt::format("left out: {} of {}: an earlier file has the same variables", names, file.path().string()));
}

std::vector<std::string> NetcdfFiles::paths() const {
  std::vector<std::string> paths;
  for (const auto& file : files_) paths.push_back(file->path().string());
  return paths;
}

const NetcdfVariable* NetcdfFiles::find(std::string_view name) const {
  const auto found = numbers_.find(name);
  return found == numbers_.end() ? nullptr : &variables_[found->second];
}

const NetcdfVariable* NetcdfFiles::coordinateOf(size_t dimension, const NetcdfVariable& data) const {
  const NetcdfVariable* found = nullptr;
  for (const NetcdfVariable& variable : variables_) {
    if (variable.name != dimensions_[dimension].name || variable.dims != std::vector{dimension}) continue;
    if (!found || variable.file == data.file) found = &variable;
  }
  return found;
}

const NetcdfDimension& NetcdfFiles::dimension(const NetcdfVariable& variable, size_t axis) const {
  return dimensions_.at(variable.dims.at(axis));
}

std::string NetcdfFiles::text(const char* attribute) const {
  for (const auto& file : files_)
    if (std::string text = file->text(attribute); !text.empty()) return text;
  return "";
}

bool NetcdfFiles::hasAttribute(const char* attribute) const {
  return std::any_of(files_.begin(), files_.end(),
                     [&](const auto& file) { return file->hasAttribute(attribute); });
}

std::optional<double> NetcdfFiles::number(const char* attribute) const {
  for (const auto& file : files_)
    if (const auto number = file->number(attribute)) return number;
  return std::nullopt;
}

std::string NetcdfFiles::missingValues(const NetcdfVariable& variable) const {
  return files_.at(variable.file)->missingValues(variable);
}

void NetcdfFiles::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const {
  files_.at(variable.file)->read(variable, box, to);
}

void NetcdfFiles::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const {
  files_.at(variable.file)->read(variable, box, to);
}

std::string NetcdfFiles::readText(const NetcdfVariable& variable) const {
  return files_.at(variable.file)->readText(variable);
}

void NetcdfFiles::release() const {
  for (const auto& file : files_) file->release();
}

namespace {

bool hasDimensions(const NetcdfFiles& file, std::initializer_list<const char*> names) {
  return std::all_of(names.begin(), names.end(), [&](const char* name) {
    return std::any_of(file.dimensions().begin(), file.dimensions().end(),
                       [&](const NetcdfDimension& dimension) { return dimension.name == name; });
  });
}

bool anyVariable(const NetcdfFiles& file, const char* attribute, const char* value) {
  return std::any_of(file.variables().begin(), file.variables().end(),
                     [&](const NetcdfVariable& variable) { return variable.text(attribute) == value; });
}

bool mentions(const NetcdfFiles& file, std::initializer_list<const char*> attributes, const char* word) {
  return std::any_of(attributes.begin(), attributes.end(), [&](const char* attribute) {
    return file.text(attribute).find(word) != std::string::npos;
  });
}

}  // namespace

std::optional<std::string> foreignNetcdf(const NetcdfFiles& file) {
  if (hasDimensions(file, {"num_dim", "num_nodes"}) &&
      (file.hasAttribute("api_version") || file.hasAttribute("floating_point_word_size")))
    return "a finite-element mesh (Exodus)";
  // FVCOM's and ICON's own marks come first: their files may follow the UGRID conventions too.
  if (mentions(file, {"source", "title"}, "FVCOM") || hasDimensions(file, {"node", "nele", "siglay"}))
    return "an unstructured mesh (FVCOM)";
  if (file.hasAttribute("uuidOfHGrid") || file.hasAttribute("number_of_grid_used"))
    return "an unstructured grid (ICON)";
  if (mentions(file, {"Conventions"}, "UGRID") || anyVariable(file, "cf_role", "mesh_topology"))
    return "an unstructured mesh (UGRID)";
  if (anyVariable(file, "CDI_grid_type", "unstructured"))
    return mentions(file, {"source", "title"}, "ICON") ? "an unstructured grid (ICON)"
                                                       : "an unstructured grid";
  if (hasDimensions(file, {"nCells", "nVertices"})) return "an unstructured mesh (MPAS)";
  const std::vector<std::string>& groups = file.groups();
  if (file.plainHdf5() && std::find(groups.begin(), groups.end(), "VTKHDF") != groups.end())
    return "a VTKHDF file (save it as .vts, .vti or .vtu)";
  if (file.plainHdf5()) return "an HDF5 file, but neither NetCDF-4 nor CGNS";
  return std::nullopt;
}

}  // namespace curvisplat
