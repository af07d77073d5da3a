#include "preprocess/formats/netcdf/netcdf_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <set>
#include <utility>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/netcdf/zarr_file.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kRepeatsListed = 3, kValuesListed = 12;
constexpr size_t kMaxValues = 1 << 20;  // of a dimension of which one is chosen
constexpr double kNearValue = 1e-6;     // of itself: coordinates may be in single precision

/// The times of a file's data are its own, whatever those of a grid file before it are.
bool countsTime(const NetcdfVariable& variable) {
  return variable.dims.size() == 1 && variable.text("units").find(" since ") != std::string::npos;
}

/// ICON's grid files call the cells otherwise than its data do.
bool isCellsOfIcon(const std::string& name) {
  return name == "cell" || name == "ncells";
}

}  // namespace

NetcdfFiles::NetcdfFiles(const OpenGridOptions& options) {
  std::vector<std::filesystem::path> paths{options.grid};
  paths.insert(paths.end(), options.solutions.begin(), options.solutions.end());
  for (const std::filesystem::path& path : paths) {
    if (!files_.empty() && !isNetcdf(path))
      throw Error("{}: is not a NetCDF file; expected one, like {}, for further variables of its grid",
                  path.string(), paths.front().string());
    auto file = openNetcdfFile(path);
    const std::optional<NetcdfDomain> domain = NetcdfDomain::of(*file);
    const auto whole = std::find_if(files_.begin(), files_.end(),
                                    [&](const NetcdfTiles& tiles) { return tiles.includes(*file, domain); });
    if (whole == files_.end())
      files_.emplace_back(std::move(file), domain);
    else
      whole->add(std::move(file), *domain);
  }
  for (size_t n = 0; n < files_.size(); ++n) add(n);
  first_.assign(dimensions_.size(), 0);
  for (const std::string& choice : options.select) select(choice);
}

void NetcdfFiles::select(const std::string& choice) {
  const size_t sign = choice.find('=');
  const std::string name = choice.substr(0, sign);
  if (sign == std::string::npos || name.empty() || sign + 1 == choice.size())
    throw UsageError("--select {}: expected DIMENSION=VALUE, such as month=3", choice);
  if (lowerCase(name).starts_with("time"))
    throw UsageError("--select {}: time steps are chosen with --time-step or --steps", choice);
  std::vector<std::string> names;
  bool found = false;
  for (size_t dim = 0; dim < dimensions_.size(); ++dim) {
    NetcdfDimension& dimension = dimensions_[dim];
    if (dimension.length > 1) names.push_back(dimension.name);
    if (dimension.name != name || dimension.length == 0) continue;
    found = true;
    first_[dim] += indexOf(dim, choice.substr(sign + 1));
    dimension.length = 1;
    dimension.unlimited = false;
  }
  if (!found)
    throw UsageError("--select {}: {} has no dimension '{}'{}; it has {}", choice, path().string(), name,
                     didYouMean(name, names), listed(names));
  selected_ += fmt::format("{}{} {}", selected_.empty() ? "" : ", ", name, choice.substr(sign + 1));
}

/// The index of a value of a dimension: of its coordinate, which may be of text, or, without one, its number.
size_t NetcdfFiles::indexOf(size_t dimension, const std::string& value) const {
  const auto& [name, length, unlimited] = dimensions_[dimension];
  const NetcdfVariable* coordinate = nullptr;
  for (const NetcdfVariable& variable : variables_)
    if (variable.name == name && !variable.dims.empty() && variable.dims[0] == dimension &&
        variable.dims.size() <= (variable.numeric ? 1 : 2))
      coordinate = &variable;
  double wanted = 0;
  const bool is_number = parseNumber(value, wanted);
  std::vector<std::string> found;
  if (coordinate && !coordinate->numeric) {
    found = files_.at(coordinate->file).front().readStrings(*coordinate);
    const auto at = std::find(found.begin(), found.end(), value);
    if (at != found.end()) return static_cast<size_t>(at - found.begin());
  } else if (coordinate && length <= kMaxValues) {
    std::vector<double> values(length);
    read(*coordinate, {{0}, {length}}, values);
    for (size_t n = 0; n < length; ++n)
      if (is_number && std::abs(values[n] - wanted) <= kNearValue * std::abs(wanted)) return n;
    for (const double number : values) found.push_back(fmt::format("{:g}", number));
  } else if (is_number && wanted >= 0 && wanted < static_cast<double>(length) &&
             wanted == std::floor(wanted)) {
    return static_cast<size_t>(wanted);
  }
  if (found.empty())
    throw UsageError("--select {0}={1}: {0} has {2} values; expected a number from 0 to {3}", name, value,
                     length, length - 1);
  if (found.size() > kValuesListed) found.resize(kValuesListed);
  throw UsageError("--select {0}={1}: {0} has no such value; it has {2} values: {3}{4}", name, value, length,
                   fmt::join(found, ", "), found.size() < length ? ", ..." : "");
}

void NetcdfFiles::add(size_t number) {
  const NetcdfTiles& tiles = files_[number];
  const NetcdfFile& file = tiles.front();
  if (tiles.size() < tiles.total())
    warnings_.push_back(fmt::format("{}: {} of the {} parts of its map {} given; {}", file.path().string(),
                                    tiles.size(), tiles.total(), tiles.size() == 1 ? "is" : "are",
                                    tiles.size() == 1 ? "give all of them together (NAME_*.nc)"
                                                      : "the nodes of the others are left out"));
  std::vector<size_t> merged;  // [the file's dimension]
  for (size_t dim = 0; dim < file.dimensions().size(); ++dim) {
    NetcdfDimension dimension = file.dimensions()[dim];
    dimension.length = tiles.length(dim);
    const auto same = std::find_if(dimensions_.begin(), dimensions_.end(), [&](const NetcdfDimension& other) {
      const bool same_name =
          other.name == dimension.name || (isCellsOfIcon(other.name) && isCellsOfIcon(dimension.name));
      return !dimension.name.empty() && same_name && other.length == dimension.length;
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
    added.file = number;
    for (size_t& dim : added.dims) dim = merged.at(dim);
    // What has one dimension twice, f(x, x), is no samples of a grid, and no coordinate.
    if (std::set(added.dims.begin(), added.dims.end()).size() < added.dims.size()) added.numeric = false;
  }
  if (twice.empty()) return;
  warnings_.push_back(fmt::format("left out: {} of {}: an earlier file has the same variables",
                                  listed(twice, kRepeatsListed), file.path().string()));
}

std::vector<std::string> NetcdfFiles::paths() const {
  std::vector<std::string> paths;
  for (const NetcdfTiles& tiles : files_)
    for (std::string& path : tiles.paths()) paths.push_back(std::move(path));
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
    if (std::string text = file.front().text(attribute); !text.empty()) return text;
  return "";
}

bool NetcdfFiles::hasAttribute(const char* attribute) const {
  return std::any_of(files_.begin(), files_.end(),
                     [&](const auto& file) { return file.front().hasAttribute(attribute); });
}

std::optional<double> NetcdfFiles::number(const char* attribute) const {
  for (const auto& file : files_)
    if (const auto number = file.front().number(attribute)) return number;
  return std::nullopt;
}

std::vector<double> NetcdfFiles::numbers(const char* attribute) const {
  for (const auto& file : files_)
    if (std::vector<double> numbers = file.front().numbers(attribute); !numbers.empty()) return numbers;
  return {};
}

std::string NetcdfFiles::missingValues(const NetcdfVariable& variable) const {
  return files_.at(variable.file).front().missingValues(variable);
}

template <typename Value>
void NetcdfFiles::readFrom(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const {
  NetcdfBox stored = box;
  for (size_t d = 0; d < stored.start.size(); ++d) stored.start[d] += first_[variable.dims[d]];
  files_.at(variable.file).read(variable, stored, to);
}

void NetcdfFiles::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const {
  readFrom(variable, box, to);
}

void NetcdfFiles::read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const {
  readFrom(variable, box, to);
}

std::string NetcdfFiles::readText(const NetcdfVariable& variable) const {
  return files_.at(variable.file).front().readText(variable);
}

void NetcdfFiles::release() const {
  for (const auto& file : files_) file.release();
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
    return anyVariable(file, "cf_role", "mesh_topology")
               ? "an unstructured mesh (FVCOM)"
               : "an unstructured mesh (FVCOM) without UGRID's mesh_topology, by which faces are found";
  if (file.find("elementConn") && file.find("nodeCoords"))
    return "a mesh of ESMF, whose faces have neither layers nor scalars, and so no volume";
  if (file.hasAttribute("uuidOfHGrid") || file.hasAttribute("number_of_grid_used"))
    return "an unstructured grid (ICON)";
  if (mentions(file, {"Conventions"}, "UGRID") || anyVariable(file, "cf_role", "mesh_topology"))
    return "an unstructured mesh (UGRID)";
  if (anyVariable(file, "CDI_grid_type", "unstructured"))
    return mentions(file, {"source", "title"}, "ICON") ? "an unstructured grid (ICON)"
                                                       : "an unstructured grid";
  if (hasDimensions(file, {"nCells", "nVertices"})) return "an unstructured mesh (MPAS)";
  if (mentions(file, {"Type", "Origin"}, "TUFLOWFV")) return "an unstructured mesh (TUFLOW FV)";
  if (file.plainHdf5()) return "an HDF5 file, but neither NetCDF-4 nor CGNS";
  return std::nullopt;
}

}  // namespace curvisplat
