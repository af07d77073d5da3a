#include "preprocess/formats/columns/columns_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string_view>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxSides = 64;

std::optional<size_t> dimensionNamed(const NetcdfFiles& file, std::string_view name) {
  for (size_t n = 0; n < file.dimensions().size(); ++n)
    if (file.dimensions()[n].name == name) return n;
  return std::nullopt;
}

double numberIn(const NetcdfVariable& variable, const char* attribute, double otherwise) {
  const auto found = variable.attributes.find(attribute);
  return found == variable.attributes.end() || found->second.numbers.empty() ? otherwise
                                                                             : found->second.numbers[0];
}

/// The variable whose attribute says what it is.
const NetcdfVariable* withText(const NetcdfFiles& file, const char* attribute, std::string_view text) {
  for (const NetcdfVariable& variable : file.variables())
    if (variable.text(attribute) == text) return &variable;
  return nullptr;
}

const NetcdfVariable& required(const NetcdfFiles& file, std::string_view name, const std::string& format) {
  const NetcdfVariable* const found = file.find(name);
  if (!found)
    throw Error("{}: is a grid of {} without {}; give the file that has it, too (convert DATA GRID)",
                file.path().string(), format, name);
  return *found;
}

/// Sets faces, nodes and sides from the variables.
void setSizes(const NetcdfFiles& file, ColumnsMap& map) {
  const NetcdfVariable &nodes = *map.nodes_of_face, &longitude = *map.longitude;
  if (nodes.dims.size() != 2 || !hasDimension(nodes, map.face_dim) || longitude.dims.size() != 1 ||
      map.latitude->dims != longitude.dims)
    throw Error("{}: {} or {} has other dimensions than faces and their nodes; the file is damaged",
                file.path().string(), nodes.name, longitude.name);
  const size_t side_axis = nodes.dims[0] == map.face_dim ? 1 : 0;
  map.node_dim = longitude.dims[0];
  map.faces = file.dimensions()[map.face_dim].length;
  map.nodes = file.dimensions()[map.node_dim].length;
  map.most_sides = file.dimension(nodes, side_axis).length;
  if (map.most_sides < 3 || map.most_sides > kMaxSides || map.faces == 0 || map.nodes == 0)
    throw Error("{}: has {} faces of up to {} nodes; expected 3 to {}", file.path().string(), map.faces,
                map.most_sides, kMaxSides);
}

ColumnsMap ugridOf(const NetcdfFiles& file, const NetcdfVariable& topology) {
  ColumnsMap map;
  map.format = "UGRID";
  if (numberIn(topology, "topology_dimension", 2) != 2)
    throw Error("{}: is a mesh of UGRID of topology_dimension {}; expected 2, faces with layers",
                file.path().string(), numberText(numberIn(topology, "topology_dimension", 2)));
  map.nodes_of_face = &required(file, topology.text("face_node_connectivity"), "UGRID");
  map.first_node = numberIn(*map.nodes_of_face, "start_index", 0);
  std::istringstream names(topology.text("node_coordinates"));
  std::string first, second;
  names >> first >> second;
  map.longitude = &required(file, first, "UGRID");
  map.latitude = &required(file, second, "UGRID");
  const CfRole role = cfRole(file, *map.longitude);
  if (role == CfRole::kLatitude || role == CfRole::kY) std::swap(map.longitude, map.latitude);
  const std::vector<size_t>& dims = map.nodes_of_face->dims;
  if (dims.empty())
    throw Error("{}: {} has no dimensions; the file is damaged", file.path().string(),
                map.nodes_of_face->name);
  // Faces come first unless the file says otherwise, or has fields of the other dimension alone.
  const auto hasFields = [&](size_t dim) {
    return std::any_of(file.variables().begin(), file.variables().end(), [&](const NetcdfVariable& variable) {
      return &variable != map.nodes_of_face && hasDimension(variable, dim) &&
             variable.text("cf_role").empty();
    });
  };
  const bool last = dims.size() == 2 && hasFields(dims[1]) && !hasFields(dims[0]);
  map.face_dim = dimensionNamed(file, topology.text("face_dimension")).value_or(dims[last ? 1 : 0]);
  return map;
}

/// The triangles of FESOM's mesh file as it was before it had the attributes of UGRID; null if it is none.
const NetcdfVariable* fesomElements(const NetcdfFiles& file) {
  const NetcdfVariable* const elements = file.find("elements");
  const auto elem = dimensionNamed(file, "elem");
  return elements && elem && hasDimension(*elements, *elem) && file.find("nlevels_nod2D") ? elements
                                                                                          : nullptr;
}

}  // namespace

bool hasDimension(const NetcdfVariable& variable, size_t dim) {
  return std::find(variable.dims.begin(), variable.dims.end(), dim) != variable.dims.end();
}

std::optional<ColumnsMap> findColumnsMap(const NetcdfFiles& file) {
  ColumnsMap map;
  const NetcdfVariable* const topology = withText(file, "cf_role", "mesh_topology");
  if (const NetcdfVariable* const of_cell = file.find("vertex_of_cell")) {
    map.format = "ICON";
    map.nodes_of_face = of_cell;
    map.first_node = 1;
    map.longitude = &required(file, "vlon", map.format);
    map.latitude = &required(file, "vlat", map.format);
    const auto cell = dimensionNamed(file, "cell"), ncells = dimensionNamed(file, "ncells");
    if (!cell && !ncells) throw Error("{}: has no dimension cell; the file is damaged", file.path().string());
    map.face_dim = cell && hasDimension(*of_cell, *cell) ? *cell : ncells.value_or(0);
  } else if (const NetcdfVariable* const on_cell = file.find("verticesOnCell")) {
    map.format = "MPAS";
    map.nodes_of_face = on_cell;
    map.first_node = 1;
    map.sides = &required(file, "nEdgesOnCell", map.format);
    const bool plane = file.text("on_a_sphere").starts_with("NO");
    map.longitude = &required(file, plane ? "xVertex" : "lonVertex", map.format);
    map.latitude = &required(file, plane ? "yVertex" : "latVertex", map.format);
    if (on_cell->dims.empty())
      throw Error("{}: verticesOnCell has no dimensions; the file is damaged", file.path().string());
    map.face_dim = on_cell->dims[0];
  } else if (topology) {
    map = ugridOf(file, *topology);
  } else if (const NetcdfVariable* const elements = fesomElements(file)) {
    map.format = "FESOM";
    map.nodes_of_face = elements;
    map.first_node = 1;
    map.longitude = &required(file, "lon", map.format);
    map.latitude = &required(file, "lat", map.format);
    map.face_dim = *dimensionNamed(file, "elem");
  } else {
    return std::nullopt;
  }
  setSizes(file, map);
  return map;
}

ColumnsBottom findColumnsBottom(const NetcdfFiles& file, const ColumnsMap& map,
                                const ColumnsScalars& scalars) {
  const bool cells = scalars.centring == Centring::kCell;
  const std::string_view format_of_map = map.format == "FESOM" ? "UGRID" : std::string_view(map.format);
  const auto levels = dimensionNamed(file, "nz");
  const bool between = levels && file.dimensions()[*levels].length == scalars.layers + 1;
  const struct {
    const char *format, *name;
    bool of_cells;
    double surplus;
  } known[] = {{"MPAS", "maxLevelCell", true, 0},
               {"UGRID", "nlevels", true, between ? 1.0 : 0.0},
               {"UGRID", "nlevels_nod2D", false, between ? 1.0 : 0.0}};
  for (const auto& [format, name, of_cells, surplus] : known) {
    const NetcdfVariable* const found = file.find(name);
    if (found && format_of_map == format && of_cells == cells && found->numeric &&
        found->dims == std::vector{cells ? map.face_dim : map.node_dim})
      return {found, surplus};
  }
  return {};
}

ColumnsReader::ColumnsReader(const NetcdfFiles& file, const NetcdfVariable& variable, size_t across_dim,
                             size_t layer_dim, size_t step)
    : file_(file), variable_(variable) {
  for (size_t axis = 0; axis < variable.dims.size(); ++axis) {
    if (variable.dims[axis] == across_dim) across_axis_ = axis;
    if (variable.dims[axis] == layer_dim) layer_axis_ = axis;
    const bool other = variable.dims[axis] != across_dim && variable.dims[axis] != layer_dim;
    const uint64_t length = file.dimension(variable, axis).length;
    box_.start.push_back(other && step < length ? step : 0);
    box_.count.push_back(1);
  }
}

template <typename Value>
ColumnsReader::Box<Value> ColumnsReader::read(uint64_t across, uint64_t count, uint64_t layer,
                                              uint64_t layers) const {
  NetcdfBox box = box_;
  box.start[across_axis_] = across;
  box.count[across_axis_] = count;
  box.start[layer_axis_] = layer;
  box.count[layer_axis_] = layers;
  Box<Value> read;
  read.values.resize(count * layers);
  (across_axis_ < layer_axis_ ? read.across_stride : read.layer_stride) =
      across_axis_ < layer_axis_ ? layers : count;
  if (!read.values.empty()) file_.read(variable_, box, std::span(read.values));
  return read;
}

template ColumnsReader::Box<float> ColumnsReader::read<float>(uint64_t, uint64_t, uint64_t, uint64_t) const;
template ColumnsReader::Box<double> ColumnsReader::read<double>(uint64_t, uint64_t, uint64_t, uint64_t) const;

}  // namespace curvisplat
