#include "bench/real_grids_cases.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <numbers>
#include <utility>

#include "preprocess/formats/derived/derived_source.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/scenes/scenes.h"
#include "tests/reference/function_grid.h"

namespace curvisplat {
namespace {

/// n x n x n nodes of the unit cube.
std::unique_ptr<GridSource> uniformCube(uint64_t n) {
  return std::make_unique<FunctionGridSource>(std::vector{gridBlock(n, n, n)}, 1, [n](const GridNode& node) {
    const double last = static_cast<double>(n - 1);
    const glm::dvec3 at(static_cast<double>(node.i) / last, static_cast<double>(node.j) / last,
                        static_cast<double>(node.k) / last);
    return NodeValues{at, {static_cast<float>(at.z)}};
  });
}

/// Patches of cells in one another, each half as large as those around it (AMR). Nodes of a coarser patch inside of a finer
/// one are blanked.
std::unique_ptr<GridSource> nestedPatches() {
  constexpr uint64_t kCells = 32, kLevels = 3;
  struct Patch {
    glm::dvec3 lower{0.0};
    double cell = 1;
  };
  static const std::array<Patch, kLevels> patches{{{{0, 0, 0}, 1}, {{6, 8, 10}, 0.5}, {{11, 10, 13}, 0.25}}};
  GridBlock block = gridBlock(kCells + 1, kCells + 1, kCells + 1);
  block.has_blanking = true;
  return std::make_unique<FunctionGridSource>(std::vector(kLevels, block), 1, [](const GridNode& node) {
    const Patch& patch = patches[node.block];
    const glm::dvec3 at =
        patch.lower + patch.cell * glm::dvec3(static_cast<double>(node.i), static_cast<double>(node.j),
                                              static_cast<double>(node.k));
    bool is_blank = false;
    if (node.block + 1 < kLevels) {
      const Patch& finer = patches[node.block + 1];
      const glm::dvec3 upper = finer.lower + finer.cell * static_cast<double>(kCells);
      is_blank = glm::all(glm::lessThan(finer.lower, at)) && glm::all(glm::lessThan(at, upper));
    }
    return NodeValues{at, {static_cast<float>(at.x + 0.5 * at.y + 0.25 * at.z)}, is_blank};
  });
}

/// The blocks of several files as one grid. They have the same scalars.
class JoinedSource : public GridSource {
 public:
  explicit JoinedSource(std::vector<std::unique_ptr<GridSource>> parts)
      : parts_(std::move(parts)), description_(parts_.front()->description()) {
    description_.blocks.clear();
    for (uint32_t part = 0; part < parts_.size(); ++part)
      for (uint32_t b = 0; b < parts_[part]->description().blocks.size(); ++b) {
        description_.blocks.push_back(parts_[part]->description().blocks[b]);
        places_.emplace_back(part, b);
      }
  }

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    parts_[places_[block].first]->read(places_[block].second, box, scalars, out);
  }

 private:
  std::vector<std::unique_ptr<GridSource>> parts_;
  GridDescription description_;
  std::vector<std::pair<uint32_t, uint32_t>> places_;
};

/// A file of `data` with its solution, which may be empty.
struct File {
  std::string grid, solution;
};

std::unique_ptr<GridSource> opened(const std::filesystem::path& data, const std::vector<File>& files,
                                   const std::string& scalar) {
  std::vector<std::unique_ptr<GridSource>> parts;
  for (const File& file : files) {
    OpenGridOptions options;
    options.grid = data / file.grid;
    if (!file.solution.empty()) options.solutions = {data / file.solution};
    options.scalars = {scalar};
    parts.push_back(std::make_unique<DerivedSource>(openGrid(options), DerivedOptions()));
  }
  if (parts.size() == 1) return std::move(parts.front());
  return std::make_unique<JoinedSource>(std::move(parts));
}

}  // namespace

std::vector<RealGrid> realGrids(const std::filesystem::path& data) {
  std::vector<RealGrid> grids;
  grids.push_back({"cube", [] { return uniformCube(101); }, "s0"});
  const auto scene = [&](const std::string& name, SceneGridSize size) {
    grids.push_back({name,
                     [name, size]() -> std::unique_ptr<GridSource> {
                       return std::make_unique<SceneGridSource>(makeScenes(name), size, 4);
                     },
                     "f"});
  };
  scene("spectral", {49, 43, 37});
  scene("dome", {41, 25, 21});
  scene("globe", {33, 33, 6});
  scene("duct", {21, 17, 17});
  grids.push_back({"nested", nestedPatches, "s0"});
  if (data.empty()) return grids;

  const auto add = [&](const std::string& name, const std::string& scalar, const std::vector<File>& files) {
    if (std::filesystem::exists(data / files.front().grid))
      grids.push_back({name, [=] { return opened(data, files, scalar); }, scalar});
  };
  add("bluntfin", "density", {{"bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin"}});
  add("combustor", "density", {{"combustor/combxyz.bin", "combustor/combq.bin"}});
  add("lox_post", "energy", {{"lox_post/postxyz.bin", "lox_post/postq.bin"}});
  add("nek", "4", {{"nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun"}});
  add("leading_edge", "i", {{"nek/leadingEdge_block.xyz", ""}});
  add("delta_wing", "Density", {{"delta_wing/delta_vertex.cgns", ""}});
  add("sduct", "k", {{"fortran/sduct.new.x.bin", ""}});
  add("o_mesh", "k", {{"idwarp/o_mesh.cgns", ""}});
  add("symm_block", "k", {{"idwarp/symm_block.cgns", ""}});
  add("sqnz", "Density", {{"cgns/sqnz_s.hdf.cgns", ""}});
  add("5blocks", "k", {{"cgns/5blocks.cgns", ""}});
  add("abutting", "i", {{"overset/cylinder_chimera_abutting.x", ""}});
  add("overlapping", "i", {{"overset/cylinder_chimera_overlapping_singledonor.x", ""}});
  add("multi_bin", "density", {{"plot3d_multi/multi-bin.xyz", "plot3d_multi/multi-bin.q"}});
  add("mbwavelet", "density", {{"plot3d_multi/mbwavelet_ascii.xyz", "plot3d_multi/mbwavelet_ascii.q"}});
  add("vtk_sample", "scalars", {{"vtk/SampleStructGrid.vtk", ""}});
  add("multicomb", "Density",
      {{"vtk/multicomb_0.vts", ""}, {"vtk/multicomb_1.vts", ""}, {"vtk/multicomb_2.vts", ""}});
  add("ocean", "T",
      {{"vts_encodings/face1_ascii.vts", ""},
       {"vts_encodings/face2_binary_zlib.vts", ""},
       {"vts_encodings/face3_appended_raw.vts", ""},
       {"vts_encodings/face4_appended_b64_zlib.vts", ""},
       {"vts_encodings/face5_appended_raw_zlib.vts", ""},
       {"vts_encodings/face6_appended_raw_lz4_u64.vts", ""}});
  add("nemo_northsea", "1", {{"nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun"}});
  return grids;
}

std::vector<NamedView> viewsOf(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) {
  std::vector<NamedView> views;
  for (const int axis : {0, 1, 2}) {
    const std::string name{'+', "xyz"[axis]};
    const Camera along = Camera::named(name, lower, upper, size, Projection::kOrthographic);
    views.push_back({name, along});
    for (const double degrees : {0.1, 1.0, 3.0}) {
      const double off = std::sin(degrees * std::numbers::pi / 180);
      glm::dvec3 back(0.0);
      back[axis] = 1;
      back[(axis + 1) % 3] = off;
      back[(axis + 2) % 3] = 0.6 * off;
      Camera turned = along;
      turned.position =
          along.focal_point + glm::length(along.position - along.focal_point) * glm::normalize(back);
      turned.parallel_scale = turned.parallelScaleFor(lower, upper, size);
      views.push_back({fmt::format("{} {}", name, degrees), turned});
    }
  }
  views.push_back({"iso", Camera::named("iso", lower, upper, size, Projection::kOrthographic)});
  return views;
}

}  // namespace curvisplat
