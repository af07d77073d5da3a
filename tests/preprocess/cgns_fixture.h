// A CGNS file in a folder of its own, HDF5 or ADF, with coordinates and fields that are known at every node: what its tests share.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/cgns_writer.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

inline CgnsFunction linear(double scale, double offset = 0) {
  return [=](int64_t i, int64_t j, int64_t k) {
    return offset + scale * static_cast<double>(i + 100 * j + 10'000 * k);
  };
}

inline std::vector<CgnsWriterField> cartesian(double offset = 0) {
  return {
      {"CoordinateX", linear(0.25, offset)}, {"CoordinateY", linear(-1)}, {"CoordinateZ", linear(3, 0.5)}};
}

class Cgns : public testing::TestWithParam<CgnsFileType> {
 protected:
  CgnsWriter writer() const { return CgnsWriter(path_, GetParam()); }

  std::unique_ptr<GridSource> open(std::optional<uint32_t> step = {}) const {
    OpenGridOptions options;
    options.grid = path_;
    options.time_step = step;
    return openGrid(options);
  }

  std::string errorOf(std::optional<uint32_t> step = {}) const {
    return curvisplat::errorOf([&] { open(step); });
  }

  static NodeArrays readAll(const GridSource& source, uint32_t block, const std::vector<uint32_t>& scalars) {
    NodeArrays nodes;
    const GridBlock& dims = source.description().blocks.at(block);
    source.read(block, {0, dims.nj, 0, dims.nk}, scalars, nodes);
    return nodes;
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "grid.cgns";
};

/// Every node of `box` has the values of the functions; of a cell's, NaN where there is no cell.
inline void expectValues(const GridSource& source, uint32_t block, const NodeBox& box, uint32_t scalar,
                         const CgnsFunction& value, double x_offset = 0) {
  const GridBlock& dims = source.description().blocks.at(block);
  NodeArrays nodes;
  source.read(block, box, std::span(&scalar, 1), nodes);
  ASSERT_EQ(nodes.x.size(), dims.ni * (box.j1 - box.j0) * (box.k1 - box.k0));
  const bool cells = source.description().scalars.at(scalar).centring == Centring::kCell;
  const std::vector<CgnsWriterField> axes = cartesian(x_offset);
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = 0; i < dims.ni; ++i, ++n) {
        const auto ii = static_cast<int64_t>(i), jj = static_cast<int64_t>(j), kk = static_cast<int64_t>(k);
        ASSERT_EQ(nodes.x[n], axes[0].value(ii, jj, kk)) << i << ", " << j << ", " << k;
        ASSERT_EQ(nodes.y[n], axes[1].value(ii, jj, kk)) << i << ", " << j << ", " << k;
        ASSERT_EQ(nodes.z[n], axes[2].value(ii, jj, kk)) << i << ", " << j << ", " << k;
        ASSERT_EQ(nodes.blank[n], 0);
        if (cells && (i + 1 == dims.ni || j + 1 == dims.nj || k + 1 == dims.nk))
          ASSERT_TRUE(std::isnan(nodes.scalars[0][n])) << i << ", " << j << ", " << k;
        else
          ASSERT_EQ(nodes.scalars[0][n], static_cast<float>(value(ii, jj, kk)))
              << i << ", " << j << ", " << k;
      }
}

}  // namespace curvisplat
