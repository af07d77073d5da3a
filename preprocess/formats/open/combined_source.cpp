#include "preprocess/formats/open/combined_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "preprocess/formats/exodus/exodus_names.h"
#include "preprocess/formats/gmsh/gmsh_source.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"

namespace curvisplat {
namespace {

// Further files are read for about this many nodes at a time, since their coordinates are read in vain.
constexpr uint64_t kNodesAtATime = 1 << 16;

bool isScalar(const GridScalar& a, const GridScalar& b) {
  return a.name == b.name && a.centring == b.centring;
}

}  // namespace

CombinedSource::CombinedSource(std::vector<std::unique_ptr<GridSource>> sources,
                               const std::vector<std::string>& names)
    : sources_(std::move(sources)) {
  CURVISPLAT_CHECK_OP(sources_.size(), ==, names.size());
  for (size_t s = 0; s < sources_.size(); ++s) {
    const auto group = std::find_if(groups_.begin(), groups_.end(), [&](const Group& other) {
      return sameNodes(*sources_[other.sources.front()], *sources_[s]);
    });
    if (group == groups_.end()) {
      addScalars(groups_.emplace_back(), s);
    } else if (addScalars(*group, s) == 0) {
      throw Error(
          "{}: has the nodes of {} and no further scalar; leave it out, or convert it as another time step",
          names[s], names[group->sources.front()]);
    }
  }
  describe(names);
}

bool CombinedSource::sameNodes(const GridSource& a, const GridSource& b) const {
  const auto &blocks = a.description().blocks, &others = b.description().blocks;
  if (blocks.size() != others.size()) return false;
  for (size_t n = 0; n < blocks.size(); ++n)
    if (blocks[n].ni != others[n].ni || blocks[n].nj != others[n].nj || blocks[n].nk != others[n].nk)
      return false;
  NodeArrays row, other;
  for (uint32_t n = 0; n < blocks.size(); ++n) {
    a.read(n, {0, 1, 0, 1}, {}, row);
    b.read(n, {0, 1, 0, 1}, {}, other);
    if (row.x != other.x || row.y != other.y || row.z != other.z) return false;
  }
  return true;
}

/// Returns the number of scalars that the group did not have.
size_t CombinedSource::addScalars(Group& group, size_t source) const {
  group.sources.push_back(source);
  const std::vector<GridScalar>& scalars = sources_[source]->description().scalars;
  const size_t before = group.scalars.size();
  for (uint32_t n = 0; n < scalars.size(); ++n) {
    const bool known = std::any_of(group.scalars.begin(), group.scalars.end(),
                                   [&](const GridScalar& other) { return isScalar(other, scalars[n]); });
    if (known) continue;
    group.scalars.push_back(scalars[n]);
    group.places.push_back({source, n});
  }
  return group.scalars.size() - before;
}

void CombinedSource::describe(const std::vector<std::string>& names) {
  const GridDescription& first = sources_.front()->description();
  description_.format = fmt::format("{} files: {}", sources_.size(), first.format);
  description_.gas = first.gas;
  description_.times = first.times;
  description_.time_step = first.time_step;
  description_.time_unit = first.time_unit;
  description_.calendar = first.calendar;
  description_.blanking = first.blanking;
  for (const auto& source : sources_) {
    const GridDescription& own = source->description();
    description_.files.insert(description_.files.end(), own.files.begin(), own.files.end());
    description_.flow.insert(description_.flow.end(), own.flow.begin(), own.flow.end());
    description_.warnings.insert(description_.warnings.end(), own.warnings.begin(), own.warnings.end());
    description_.coordinate_bytes = std::max(description_.coordinate_bytes, own.coordinate_bytes);
  }
  for (size_t g = 0; g < groups_.size(); ++g) {
    const size_t source = groups_[g].sources.front();
    const std::vector<GridBlock>& blocks = sources_[source]->description().blocks;
    for (GridBoundary boundary : sources_[source]->description().boundaries) {
      boundary.block += static_cast<uint32_t>(description_.blocks.size());
      description_.boundaries.push_back(std::move(boundary));
    }
    for (uint32_t b = 0; b < blocks.size(); ++b) {
      blocks_.emplace_back(g, b);
      GridBlock& block = description_.blocks.emplace_back(blocks[b]);
      if (groups_.size() == 1) continue;
      const std::string stem = std::filesystem::path(names[source]).stem().string();
      block.name = blocks.size() == 1 ? stem : fmt::format("{}/{}", stem, blocks[b].name);
    }
  }
  std::vector<std::string> partial;
  for (const Group& group : groups_)
    for (const GridScalar& scalar : group.scalars) {
      const auto has = [&](const Group& other) {
        return std::any_of(other.scalars.begin(), other.scalars.end(),
                           [&](const GridScalar& own) { return isScalar(own, scalar); });
      };
      if (std::all_of(groups_.begin(), groups_.end(), has)) {
        if (&group == &groups_.front()) description_.scalars.push_back(scalar);
      } else if (std::find(partial.begin(), partial.end(), scalar.name) == partial.end()) {
        partial.push_back(scalar.name);
      }
    }
  if (!partial.empty())
    description_.warnings.push_back(fmt::format("left out: {}: not in all of the files", listed(partial)));
  for (const Group& group : groups_) {
    std::vector<Place>& places = places_.emplace_back();
    for (const GridScalar& scalar : description_.scalars)
      for (size_t n = 0; n < group.scalars.size(); ++n)
        if (isScalar(group.scalars[n], scalar)) places.push_back(group.places[n]);
  }
}

bool CombinedSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  const auto [group, number] = blocks_.at(block);
  return sources_[groups_[group].sources.front()]->readFringe(number, box, out);
}

uint64_t CombinedSource::rowsInMemory(std::span<const uint32_t> scalars) const {
  uint64_t rows = 0;
  for (const Group& group : groups_) rows = std::max(rows, sources_[group.sources.front()]->rowsInMemory({}));
  for (const std::vector<Place>& places : places_)
    for (const uint32_t scalar : scalars) {
      const Place& place = places.at(scalar);
      rows = std::max(rows, sources_[place.source]->rowsInMemory({&place.scalar, 1}));
    }
  return rows;
}

void CombinedSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                          NodeArrays& out) const {
  const size_t group = blocks_.at(block).first;
  const uint32_t number = blocks_[block].second;
  const size_t first = groups_[group].sources.front();
  std::map<size_t, std::vector<size_t>> of_source;  // positions in `scalars`
  of_source[first];
  for (size_t n = 0; n < scalars.size(); ++n) of_source[places_[group].at(scalars[n]).source].push_back(n);

  const auto wantedOf = [&](const std::vector<size_t>& positions) {
    std::vector<uint32_t> wanted;
    for (const size_t n : positions) wanted.push_back(places_[group][scalars[n]].scalar);
    return wanted;
  };
  const std::vector<size_t>& own = of_source[first];
  std::vector<std::vector<float>> kept;
  readBox(*sources_[first], number, box, wantedOf(own), out);
  kept.swap(out.scalars);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < own.size(); ++n) out.scalars[own[n]].swap(kept[n]);
  for (const auto& [source, positions] : of_source) {
    if (source == first) continue;
    std::vector<std::vector<float>*> to;
    for (const size_t n : positions) to.push_back(&out.scalars[n]);
    readFrom(source, number, box, wantedOf(positions), to);
  }
}

void CombinedSource::readFrom(size_t source, uint32_t block, const NodeBox& box,
                              std::span<const uint32_t> scalars,
                              std::span<std::vector<float>* const> to) const {
  const uint64_t ni = box.rowNodes(sources_[source]->description().blocks[block].ni), nj = box.j1 - box.j0;
  const uint64_t rows = std::clamp<uint64_t>(kNodesAtATime / ni, 1, nj);
  const uint64_t planes = rows < nj ? 1 : std::clamp<uint64_t>(kNodesAtATime / (ni * nj), 1, box.k1 - box.k0);
  for (std::vector<float>* values : to) values->clear();
  NodeArrays piece;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += rows) {
      const NodeBox part{j, std::min(j + rows, box.j1), k, std::min(k + planes, box.k1), box.i0, box.i1};
      readBox(*sources_[source], block, part, scalars, piece);
      for (size_t n = 0; n < to.size(); ++n)
        to[n]->insert(to[n]->end(), piece.scalars[n].begin(), piece.scalars[n].end());
    }
}

namespace {

/// Whether the meshes have the same counts and begin with the same points.
bool haveSamePoints(const MeshSource& a, const MeshSource& b) {
  constexpr uint64_t kCompared = 1000;
  const auto &pieces = a.description().pieces, &others = b.description().pieces;
  if (pieces.size() != others.size()) return false;
  MeshPoints of_a, of_b;
  for (uint32_t n = 0; n < pieces.size(); ++n) {
    if (pieces[n].points != others[n].points || pieces[n].cells != others[n].cells) return false;
    a.readPoints(n, 0, std::min(kCompared, pieces[n].points), {}, of_a);
    b.readPoints(n, 0, std::min(kCompared, pieces[n].points), {}, of_b);
    if (of_a.x != of_b.x || of_a.y != of_b.y || of_a.z != of_b.z) return false;
  }
  return true;
}

}  // namespace

CombinedMeshSource::CombinedMeshSource(std::vector<std::unique_ptr<MeshSource>> sources,
                                       const std::vector<std::string>& names)
    : sources_(std::move(sources)) {
  const GridDescription& first = sources_.front()->description();
  description_.format = fmt::format("{} files: {}", sources_.size(), first.format);
  description_.times = first.times;
  description_.time_step = first.time_step;
  const auto add = [](std::vector<std::string>& to, const std::vector<std::string>& more) {
    for (const std::string& one : more)
      if (std::find(to.begin(), to.end(), one) == to.end()) to.push_back(one);
  };
  std::vector<GridScalar>& scalars = description_.scalars;
  for (size_t s = 0; s < sources_.size(); ++s) {
    for (size_t other = 0; other < s; ++other)
      if (haveSamePoints(*sources_[other], *sources_[s]))
        throw Error(
            "{}: has the points of {} and cannot be combined with it; give the file with all arrays alone, "
            "or "
            "convert it as another time step",
            names[s], names[other]);
    const GridDescription& own = sources_[s]->description();
    add(description_.files, own.files);
    add(description_.warnings, own.warnings);
    add(description_.notes, own.notes);
    description_.coordinate_bytes = std::max(description_.coordinate_bytes, own.coordinate_bytes);
    for (uint32_t n = 0; n < own.pieces.size(); ++n) {
      pieces_.emplace_back(s, n);
      MeshPiece& piece = description_.pieces.emplace_back(own.pieces[n]);
      const std::string name = std::filesystem::path(names[s]).filename().string();
      piece.name = own.pieces.size() == 1 ? name : fmt::format("{}/{}", name, piece.name);
    }
    for (const GridScalar& scalar : own.scalars)
      if (std::none_of(scalars.begin(), scalars.end(),
                       [&](const GridScalar& known) { return isScalar(known, scalar); }))
        scalars.push_back(scalar);
  }
  std::vector<size_t> without(scalars.size());
  for (const auto& source : sources_) {
    const std::vector<GridScalar>& own = source->description().scalars;
    auto& places = places_.emplace_back(scalars.size());
    for (size_t n = 0; n < scalars.size(); ++n) {
      const auto found = std::find_if(own.begin(), own.end(),
                                      [&](const GridScalar& scalar) { return isScalar(scalar, scalars[n]); });
      if (found != own.end()) places[n] = static_cast<uint32_t>(found - own.begin());
      without[n] += found == own.end();
    }
  }
  for (size_t n = 0; n < scalars.size(); ++n)
    if (without[n] > 0)
      description_.warnings.push_back(fmt::format("{} of {} files have no {}; they are not drawn with it",
                                                  without[n], sources_.size(), scalars[n].name));
}

bool CombinedMeshSource::hasCurvedCells() const {
  return std::any_of(sources_.begin(), sources_.end(),
                     [](const auto& source) { return source->hasCurvedCells(); });
}

template <typename Read>
void CombinedMeshSource::readOwn(uint32_t piece, uint64_t count, std::span<const uint32_t> scalars,
                                 const Read& read) const {
  const auto [source, number] = pieces_.at(piece);
  std::vector<uint32_t> own;
  std::vector<size_t> to;
  for (size_t n = 0; n < scalars.size(); ++n)
    if (const auto place = places_[source].at(scalars[n])) {
      own.push_back(*place);
      to.push_back(n);
    }
  std::vector<std::vector<float>>& values = read(*sources_[source], number, own);
  if (own.size() == scalars.size()) return;
  std::vector<std::vector<float>> all(scalars.size());
  for (size_t n = 0; n < to.size() && n < values.size(); ++n) all[to[n]] = std::move(values[n]);
  for (std::vector<float>& one : all) one.resize(count, std::numeric_limits<float>::quiet_NaN());
  values = std::move(all);
}

void CombinedMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                    std::span<const uint32_t> scalars, MeshPoints& out) const {
  readOwn(
      piece, count, scalars, [&](const MeshSource& source, uint32_t number, const auto& own) -> auto& {
        source.readPoints(number, first, count, own, out);
        return out.scalars;
      });
}

void CombinedMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                                   std::span<const uint32_t> scalars, MeshCells& out) const {
  readOwn(
      piece, count, scalars, [&](const MeshSource& source, uint32_t number, const auto& own) -> auto& {
        source.readCells(number, first, count, own, out);
        return out.scalars;
      });
}

std::unique_ptr<DataSource> openCombined(
    const OpenGridOptions& options,
    const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open) {
  OpenGridOptions one = options;
  one.solutions.clear();
  std::vector<std::string> names{options.grid.string()};
  for (const std::filesystem::path& path : options.solutions) names.push_back(path.string());
  one.is_part =
      exodusName(options.grid).processors <= names.size() && gmshFiles(options.grid) <= names.size();
  std::vector<std::unique_ptr<GridSource>> grids;
  std::vector<std::unique_ptr<MeshSource>> meshes;
  for (const std::string& name : names) {
    one.grid = name;
    std::unique_ptr<DataSource> source = open(one);
    if (auto* const grid = dynamic_cast<GridSource*>(source.get()))
      grids.emplace_back(grid);
    else
      meshes.emplace_back(dynamic_cast<MeshSource*>(source.get()));
    source.release();
    if (!grids.empty() && !meshes.empty())
      throw Error("{}: is {} grid, and {} is not; they cannot be combined", name,
                  grids.size() == 1 ? "a structured" : "an unstructured", names.front());
  }
  if (grids.empty()) return std::make_unique<CombinedMeshSource>(std::move(meshes), names);
  return std::make_unique<CombinedSource>(std::move(grids), names);
}

}  // namespace curvisplat
