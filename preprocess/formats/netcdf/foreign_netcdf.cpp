#include "preprocess/formats/netcdf/foreign_netcdf.h"

#include <algorithm>
#include <initializer_list>

namespace curvisplat {
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
