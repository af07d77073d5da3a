#include "preprocess/formats/plot3d/plot3d_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "preprocess/formats/plot3d/plot3d_detect.h"
#include "stream/base/check.h"
#include "stream/base/error.h"
#include "stream/base/words.h"

namespace curvisplat {
namespace {

const std::vector<GridScalar>& qScalars() {
  static const std::vector<GridScalar> scalars = {
      {"density", "", {"rho"}, 0},
      {"momentum_x", "", {"xmomentum", "rhou"}, 0},
      {"momentum_y", "", {"ymomentum", "rhov"}, 0},
      {"momentum_z", "", {"zmomentum", "rhow"}, 0},
      {"energy", "", {"stagnationenergy", "rhoe"}, 0},
  };
  return scalars;
}

/// The lines of a .nam file. FieldView's suffix after a semicolon (the name of the vector) is cut off.
std::vector<std::string> variableNames(const std::filesystem::path& path) {
  std::vector<std::string> names;
  const std::string text = readTextFile(path, 1 << 20);
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    const std::string_view name = trimmed(line.substr(0, line.find(';')));
    if (!name.empty()) names.emplace_back(name);
    begin = end + 1;
  }
  return names;
}

}  // namespace

Plot3dSource::Plot3dSource(const OpenGridOptions& options)
    : grid_path_(options.grid), function_names_(options.function_names), grid_(openGridFile(options)) {
  for (const std::filesystem::path& path : options.solutions) addSolution(path, options);
  makeNamesUnique();
}

Plot3dFile Plot3dSource::openGridFile(const OpenGridOptions& options) {
  DetectedPlot3d detected =
      detectPlot3dGrid(std::make_shared<InputFile>(options.grid), options.force, options.temporary_folder);
  description_.coordinate_bytes = detected.written_precision_bytes;
  Plot3dFile file(std::move(detected.fit));
  for (const Plot3dBlock& block : file.blocks())
    description_.blocks.push_back({fmt::format("block {}", description_.blocks.size() + 1), block.ni,
                                   block.nj, block.nk, file.layout().blanking});
  description_.format = "PLOT3D";
  describe(options.grid, file);
  return file;
}

void Plot3dSource::addSolution(const std::filesystem::path& path, const OpenGridOptions& options) {
  Plot3dFile file(detectPlot3dSolution(std::make_shared<InputFile>(path), options.force,
                                       options.temporary_folder, grid_path_, grid_.blocks())
                      .fit);
  describe(path, file);
  for (uint32_t component = 0; component < file.components(); ++component)
    components_.push_back({solutions_.size(), component});
  if (file.layout().kind != Plot3dKind::kFunction) {
    description_.scalars.insert(description_.scalars.end(), qScalars().begin(), qScalars().end());
    if (file.layout().kind == Plot3dKind::kOverflow) addOverflowScalars(file);
    for (uint32_t block = 0; block < file.blocks().size(); ++block) {
      description_.flow.push_back(file.conditions(block));
      description_.flow.back().file = path.string();
    }
  } else {
    addFunctionNames(path, file);
  }
  solutions_.push_back(std::move(file));
  solution_paths_.push_back(path);
}

/// Adds the scalars of an OVERFLOW file that follow the five of every Q file.
void Plot3dSource::addOverflowScalars(const Plot3dFile& file) {
  const auto add = [&](std::string name) {
    GridScalar scalar;
    scalar.name = std::move(name);
    description_.scalars.push_back(std::move(scalar));
  };
  if (const double gamma = file.freestreamGamma(); gamma > 1 && gamma < 10) description_.gas.gamma = gamma;
  if (file.components() == 5) return;
  add("gamma");
  for (uint32_t n = 6; n < file.components(); ++n)
    add(n - 6 < file.species() ? fmt::format("species_{}", n - 5)
                               : fmt::format("turbulence_{}", n - 5 - file.species()));
  description_.warnings.push_back(
      fmt::format("{}: gamma varies between nodes; derived quantities use one value (--gamma)",
                  description_.files.back()));
}

void Plot3dSource::addFunctionNames(const std::filesystem::path& path, const Plot3dFile& file) {
  std::filesystem::path names_path = path;
  names_path.replace_extension(".nam");
  std::vector<std::string> names = function_names_;
  if (!names.empty()) names_path = path;
  std::error_code none_there;
  if (names.empty() && std::filesystem::exists(names_path, none_there)) names = variableNames(names_path);
  if (!names.empty()) {
    if (names.size() != file.components())
      description_.warnings.push_back(fmt::format("{}: has {} names for the {} variables of {}",
                                                  names_path.string(), names.size(), file.components(),
                                                  path.string()));
  }
  for (uint32_t n = 0; n < file.components(); ++n) {
    GridScalar scalar;
    scalar.number = n + 1;
    scalar.name = n < names.size() ? names[n] : std::to_string(n + 1);
    description_.scalars.push_back(std::move(scalar));
  }
}

void Plot3dSource::describe(const std::filesystem::path& path, const Plot3dFile& file) {
  description_.files.push_back(path.string());
  description_.format += fmt::format("{} {} {}: {}", description_.files.size() == 1 ? "" : ";",
                                     curvisplat::describe(file.layout().kind), path.filename().string(),
                                     curvisplat::describe(file.layout()));
  if (file.trailingBytes() == 0) return;
  if (file.layout().ascii)
    description_.warnings.push_back(fmt::format("{}: {} trailing numbers ignored", path.filename().string(),
                                                file.trailingBytes() / sizeof(double)));
  else
    description_.warnings.push_back(
        fmt::format("{}: {} trailing bytes ignored", path.filename().string(), file.trailingBytes()));
}

void Plot3dSource::makeNamesUnique() {
  std::vector<GridScalar>& scalars = description_.scalars;
  std::multiset<std::string> names;
  for (const GridScalar& scalar : scalars) names.insert(scalar.name);
  std::set<std::string> unique;
  for (size_t n = 0; n < scalars.size(); ++n) {
    if (names.count(scalars[n].name) > 1)
      scalars[n].name = solution_paths_[components_[n].file].stem().string() + ":" + scalars[n].name;
    if (!unique.insert(scalars[n].name).second)
      throw Error("{}: two scalars have the name {}; rename the file, or a variable in its .nam file",
                  solution_paths_[components_[n].file].string(), scalars[n].name);
  }
}

bool Plot3dSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  if (!grid_.layout().blanking) return false;
  std::vector<int32_t> iblank(static_cast<size_t>(nodesOf(description_.blocks[block], box)));
  grid_.readIblank(block, box, iblank);
  // -n: interpolated from block n. From its own one at a cut, where it meets itself.
  const int64_t own = -int64_t{block} - 1;
  out.resize(iblank.size());
  std::transform(iblank.begin(), iblank.end(), out.begin(),
                 [&](int32_t value) { return static_cast<uint8_t>(value < 0 && value != own); });
  return true;
}

void Plot3dSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                        NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, <, description_.blocks.size());
  const auto nodes = static_cast<size_t>(nodesOf(description_.blocks[block], box));
  std::vector<double>* const coordinates[] = {&out.x, &out.y, &out.z};
  for (uint32_t axis = 0; axis < 3; ++axis) {
    coordinates[axis]->resize(nodes);
    grid_.read(block, axis, box, *coordinates[axis]);
  }
  if (grid_.layout().blanking) {
    out.blank.resize(nodes);
    grid_.readBlank(block, box, out.blank);
  } else {
    out.blank.assign(nodes, 0);
  }
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, components_.size());
    const Component& component = components_[scalars[n]];
    out.scalars[n].resize(nodes);
    solutions_[component.file].read(block, component.component, box, out.scalars[n]);
  }
}

}  // namespace curvisplat
