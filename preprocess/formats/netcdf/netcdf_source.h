// A curvilinear grid by the CF conventions (ocean, atmosphere, ...) in one or more NetCDF files, as a
// GridSource of one time step: of one block, or of one for each face of a cubed sphere and the like.
//
// If a file has several grids (a staggered mesh), the source uses that of the first scalar that the user
// requests, else the grid with most fields of the first file; warnings list the others. Nodes where that scalar (else
// the grid's first) is missing, or that the files' mask hides, are blanked; where another scalar is missing, it is NaN. So
// fields that models fill with zeros on land are not drawn there.
//
// NetCDF is not thread-safe: reads by several threads run one after the other.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/netcdf/cf_grid.h"
#include "preprocess/formats/netcdf/cf_nodes.h"
#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/formats/netcdf/joined_faces.h"
#include "preprocess/formats/netcdf/map_projection.h"
#include "preprocess/formats/netcdf/netcdf_files.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

class NetcdfSource final : public FaceSource {
 public:
  /// `beside`: a source that this one lies beside on the same map; null if there is none. Throws Error.
  explicit NetcdfSource(const OpenGridOptions& options, const NetcdfSource* beside = nullptr);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;
  bool onSphere() const override { return globe_.sphere() && grid_.levels == 2; }
  std::vector<glm::dvec3> pointsOf(uint32_t block, const CfRange& range) const override;
  /// Whether longitude and latitude are given for each column of nodes.
  bool placesColumns() const { return grid_.longitude.axes() == 2 && grid_.latitude.axes() == 2; }

  /// Closes the files until they are read again.
  void release() const { file_.release(); }

  /// How the grid closes if it runs around the Earth; of grids of one block on a sphere.
  std::optional<GridClosure> closure() const;

 private:
  static CfGrid chooseGrid(const NetcdfFiles& file, const OpenGridOptions& options,
                           GridDescription& description, size_t& mask);
  Globe globeOf(const GlobeOptions& options) const;
  void describe(const OpenGridOptions& options);
  double shareOfZeros() const;
  double deepestCell(const CfNodes& block) const;
  double thinnestLayer(const CfNodes& block) const;
  std::string noteOnSagitta() const;

  NetcdfFiles file_;
  GridDescription description_;
  size_t mask_ = 0;  // the scalar whose missing values blank nodes
  CfGrid grid_;      // of the first block
  Globe globe_;
  std::vector<CfNodes> blocks_;  // one, or one for each face
};

}  // namespace curvisplat
