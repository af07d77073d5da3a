#include "preprocess/formats/xdmf/xdmf_cell_types.h"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

namespace curvisplat {
namespace {

constexpr XdmfCellType kCellTypes[] = {{"polyvertex", 1, CellKind::kNone, 0, true},
                                       {"polyline", 2, CellKind::kNone, 0, true},
                                       {"polygon", 3, CellKind::kNone, 0, true},
                                       {"triangle", 4, CellKind::kNone, 3},
                                       {"quadrilateral", 5, CellKind::kNone, 4},
                                       {"tetrahedron", 6, CellKind::kTetrahedron, 4},
                                       {"pyramid", 7, CellKind::kPyramid, 5},
                                       {"wedge", 8, CellKind::kWedge, 6},
                                       {"hexahedron", 9, CellKind::kHexahedron, 8},
                                       {"polyhedron", 16, CellKind::kPolyhedron, 0, true},
                                       {"edge_3", 34, CellKind::kNone, 3},
                                       {"quadrilateral_9", 35, CellKind::kNone, 9},
                                       {"triangle_6", 36, CellKind::kNone, 6},
                                       {"quadrilateral_8", 37, CellKind::kNone, 8},
                                       {"tetrahedron_10", 38, CellKind::kTetrahedron, 10},
                                       {"pyramid_13", 39, CellKind::kPyramid, 13},
                                       {"wedge_15", 40, CellKind::kWedge, 15},
                                       {"wedge_18", 41, CellKind::kWedge, 18},
                                       {"hexahedron_20", 48, CellKind::kHexahedron, 20},
                                       {"hexahedron_24", 49, CellKind::kHexahedron, 24},
                                       {"hexahedron_27", 50, CellKind::kHexahedron, 27}};

}  // namespace

const XdmfCellType* xdmfCellType(uint64_t number) {
  const auto found = std::find_if(std::begin(kCellTypes), std::end(kCellTypes),
                                  [&](const XdmfCellType& type) { return number == type.number; });
  return found == std::end(kCellTypes) ? nullptr : found;
}

const XdmfCellType* xdmfCellTypeNamed(std::string name) {
  for (const auto& [brief, full] : {std::pair("tet_", "tetrahedron_"), std::pair("hex_", "hexahedron_"),
                                    std::pair("tri_", "triangle_"), std::pair("quad_", "quadrilateral_")})
    if (name.starts_with(brief)) name = full + name.substr(std::string_view(brief).size());
  const auto found = std::find_if(std::begin(kCellTypes), std::end(kCellTypes),
                                  [&](const XdmfCellType& type) { return name == type.name; });
  return found == std::end(kCellTypes) ? nullptr : found;
}

}  // namespace curvisplat
