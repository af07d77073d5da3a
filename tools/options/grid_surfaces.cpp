#include "tools/options/grid_surfaces.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"
#include "stream/cache/faces_file.h"
#include "tools/options/picture_choice.h"
#include "tools/options/still_faces.h"

namespace curvisplat {
namespace {

std::optional<uint64_t> wholeNumber(std::string_view text) {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// "i=0-20"
bool parseRange(std::string_view text, FaceName& name) {
  const size_t dash = text.find('-');
  if (text.size() < 5 || text[1] != '=' || dash == std::string_view::npos) return false;
  const size_t axis = std::string_view("ijk").find(text[0]);
  const auto first = wholeNumber(text.substr(2, dash - 2)), last = wholeNumber(text.substr(dash + 1));
  if (axis == std::string_view::npos || static_cast<int>(axis) == name.axis || !first || !last ||
      *first >= *last)
    return false;
  name.ranges[axis] = FaceName::Range{*first, *last};
  return true;
}

}  // namespace

std::optional<FaceName> parseFaceName(std::string_view text) {
  FaceName name;
  if (text.starts_with("block")) {
    const size_t colon = text.find(':');
    if (colon == std::string_view::npos) return std::nullopt;
    const size_t from = text.find_first_not_of(' ', 5);
    const auto block = wholeNumber(text.substr(from, colon - from));
    if (!block || *block == 0 || *block > UINT32_MAX) return std::nullopt;
    name.block = static_cast<uint32_t>(*block - 1);
    text.remove_prefix(colon + 1);
  }
  std::string_view ranges;
  if (const size_t colon = text.find(':'); colon != std::string_view::npos) {
    ranges = text.substr(colon + 1);
    text = text.substr(0, colon);
  }
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  if (text.empty()) return std::nullopt;
  const size_t axis = std::string_view("ijk").find(text[0]);
  if (axis == std::string_view::npos) return std::nullopt;
  name.axis = static_cast<int>(axis);
  text.remove_prefix(1);
  const bool has_equals = text.starts_with('=');
  if (has_equals) text.remove_prefix(1);
  if (text == "min" || text == "max") {
    name.at = text == "min" ? FaceName::At::kMin : FaceName::At::kMax;
  } else {
    const auto index = wholeNumber(text);
    if (!has_equals || !index) return std::nullopt;
    name.at = FaceName::At::kIndex;
    name.index = *index;
  }
  while (!ranges.empty()) {
    const size_t colon = std::min(ranges.find(':'), ranges.size());
    if (!parseRange(ranges.substr(0, colon), name)) return std::nullopt;
    ranges.remove_prefix(std::min(colon + 1, ranges.size()));
  }
  return name;
}

namespace {

constexpr size_t kNamesListed = 8, kMaxOffered = 400;

/// The parts that cells of the files' grid, whose indices names have, are cut into.
uint64_t partsOf(const Manifest& manifest, size_t block, int axis) {
  return block < manifest.blocks.size() ? manifest.refinement.ofBlock(block)[static_cast<size_t>(axis)] : 1;
}

std::string nameOf(const GridFace& face, const Manifest& manifest) {
  const char axis = "ijk"[face.axis];
  if (face.side == FaceSide::kPlane)
    return fmt::format(
        "block {}:{}={}", face.block + 1, axis,
        static_cast<double>(face.index) / static_cast<double>(partsOf(manifest, face.block, face.axis)));
  return fmt::format("{}{}", axis, face.side == FaceSide::kMin ? "min" : "max");
}

bool isWall(const FaceRegion& region) {
  return region.type.starts_with("BCWall");
}

/// The parts of a grid without boundary conditions where its flow rests: in the last step, since all of it may rest in the first.
std::vector<GridSurface::Part> wallsByFlow(const CacheReader& cache, const FacesReader& faces) {
  const uint64_t last = cache.series().steps.size() - 1;
  const CacheReader at_last = cache.atStep(last);
  return stillParts(at_last.manifest(), faces,
                    [&](const std::string& scalar) { return facesWith(scalar, at_last); });
}

/// Whether it has such parts. Damaged faces have none: an error says so where they are drawn.
bool hasWallsByFlow(const CacheReader& cache, const FacesReader& faces) {
  try {
    return !wallsByFlow(cache, faces).empty();
  } catch (const Error&) {
    return false;
  }
}

/// Lists the faces of the cache, for messages.
std::string whatThereIs(const FacesReader& faces, const Manifest& manifest) {
  std::vector<std::string> names;
  std::set<std::string> known;
  for (const GridFace& face : faces.faces())
    if (const std::string name = nameOf(face, manifest); known.insert(name).second) names.push_back(name);
  std::string text = "it has the faces " + listed(names, kNamesListed);
  std::vector<std::string> boundaries;
  for (const FaceRegion& region : faces.regions())
    if (const std::string name = fmt::format("{} ({})", region.name, region.type); known.insert(name).second)
      boundaries.push_back(name);
  text += boundaries.empty() ? ", and no boundary conditions"
                             : ", and the boundaries " + listed(boundaries, kNamesListed);
  return text;
}

uint64_t lastIndexOf(const Manifest& manifest, size_t n, int axis) {
  const BlockInfo& block = manifest.blocks[n];
  return ((axis == 0 ? block.ni : axis == 1 ? block.nj : block.nk) - 1) / partsOf(manifest, n, axis);
}

class FaceFinder {
 public:
  FaceFinder(const FacesReader& faces, const CacheReader& cache, GridSurface& surface)
      : faces_(faces), cache_(cache), manifest_(cache.manifest()), surface_(surface) {}

  /// Whether the word named any face.
  bool add(const std::string& word) {
    const size_t before = surface_.parts.size();
    if (word == "all") {
      for (uint32_t n = 0; n < faces_.faces().size(); ++n)
        if (faces_.faces()[n].side != FaceSide::kPlane) addFace(n, {});
    } else if (word == "walls") {
      addRegions(isWall);
      if (surface_.parts.size() == before)  // a grid without boundary conditions
        for (const GridSurface::Part& part : wallsByFlow(cache_, faces_)) addPart(part);
    } else if (const auto name = parseFaceName(word)) {
      for (uint32_t n = 0; n < faces_.faces().size(); ++n)
        if (isNamed(faces_.faces()[n], *name)) addFace(n, *name);
    }
    if (surface_.parts.size() == before)
      addRegions([&](const FaceRegion& region) { return region.name == word || region.type == word; });
    return surface_.parts.size() > before;
  }

 private:
  bool has(const GridFace& like, FaceSide side) const {
    return std::any_of(faces_.faces().begin(), faces_.faces().end(), [&](const GridFace& face) {
      return face.side == side && face.block == like.block && face.axis == like.axis &&
             face.index == like.index;
    });
  }

  /// An end's name means its outer face, or its whole plane where that has no outer face: a body without
  /// thickness. An index means the plane, or the outer face where there is no plane.
  bool isNamed(const GridFace& face, const FaceName& name) const {
    if (face.axis != name.axis || name.block.value_or(face.block) != face.block) return false;
    const bool is_plane = face.side == FaceSide::kPlane;
    if (name.at == FaceName::At::kIndex)
      return isAt(face, name.index) && (is_plane || !has(face, FaceSide::kPlane));
    const bool is_min = name.at == FaceName::At::kMin;
    const FaceSide side = is_min ? FaceSide::kMin : FaceSide::kMax;
    return is_plane ? face.index == (is_min ? 0 : lastOf(face)) && !has(face, side) : face.side == side;
  }

  bool isAt(const GridFace& face, uint64_t index) const {
    const uint64_t parts = partsOf(manifest_, face.block, face.axis);
    return face.index % parts == 0 && face.index / parts == index;
  }

  uint64_t lastOf(const GridFace& face) const {
    return face.block < manifest_.blocks.size()
               ? lastIndexOf(manifest_, face.block, face.axis) * partsOf(manifest_, face.block, face.axis)
               : 0;
  }

  void addFace(uint32_t number, const FaceName& name) {
    const GridFace& face = faces_.faces()[number];
    GridSurface::Part part{number, {0, 0}, {face.nodes[0] - 1, face.nodes[1] - 1}};
    size_t along = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == face.axis) continue;
      if (const auto& range = name.ranges[static_cast<size_t>(axis)]) {
        const uint64_t parts = partsOf(manifest_, face.block, axis);
        part.first[along] = std::min(range->first, part.last[along]) * parts;
        part.last[along] = std::min(std::min(range->last, part.last[along]) * parts, part.last[along]);
      }
      if (part.first[along] >= part.last[along]) return;
      ++along;
    }
    addPart(part);
  }

  template <typename Wanted>
  void addRegions(const Wanted& wanted) {
    for (const FaceRegion& region : faces_.regions())
      if (wanted(region)) addPart({region.face, region.first, region.last});
  }

  void addPart(const GridSurface::Part& part) {
    if (std::find(surface_.parts.begin(), surface_.parts.end(), part) == surface_.parts.end())
      surface_.parts.push_back(part);
  }

  const FacesReader& faces_;
  const CacheReader& cache_;
  const Manifest& manifest_;
  GridSurface& surface_;
};

bool lacksBlock(const FaceName& name, const Manifest& manifest) {
  return name.block && *name.block >= manifest.blocks.size();
}

/// The last index along an axis, and the block that has it: the name's, or the one that reaches farthest.
struct Reach {
  uint64_t last = 0;
  size_t block = 0;
};

Reach reachOf(const FaceName& name, int axis, const Manifest& manifest) {
  Reach reach;
  for (size_t n = 0; n < manifest.blocks.size(); ++n) {
    if (name.block.value_or(n) != n) continue;
    const uint64_t last = lastIndexOf(manifest, n, axis);
    if (last > reach.last) reach = {last, n};
  }
  return reach;
}

/// Whether a conversion can keep this plane: some block of the name reaches so far.
bool canBeKept(const FaceName& name, const Manifest& manifest) {
  return name.at == FaceName::At::kIndex && !lacksBlock(name, manifest) &&
         name.index <= reachOf(name, name.axis, manifest).last;
}

/// How far the grid goes, where an index of the name is beyond it.
std::string beyondOf(const FaceName& name, const Manifest& manifest) {
  const auto textOf = [&](int axis) {
    const Reach reach = reachOf(name, axis, manifest);
    const bool is_farthest = !name.block && manifest.blocks.size() > 1;
    return fmt::format(" ({} goes from 0 to {} in block {}{})", "ijk"[axis], reach.last, reach.block + 1,
                       is_farthest ? ", and no farther in the others" : "");
  };
  if (name.at == FaceName::At::kIndex && !canBeKept(name, manifest)) return textOf(name.axis);
  for (int axis = 0; axis < 3; ++axis)
    if (const auto& range = name.ranges[static_cast<size_t>(axis)])
      if (range->first >= reachOf(name, axis, manifest).last) return textOf(axis);
  return "";
}

/// Explains what is wrong with a name that no face has: a block or an index beyond the grid's, or a misspelt
/// word.
std::string meantBy(const std::string& word, const Manifest& manifest, const FacesReader& faces) {
  const auto name = parseFaceName(word);
  const size_t blocks = manifest.blocks.size();
  if (name && !lacksBlock(*name, manifest))
    if (const std::string beyond = beyondOf(*name, manifest); !beyond.empty()) return beyond;
  if (word.starts_with("block") && (!name || name->at != FaceName::At::kIndex || lacksBlock(*name, manifest)))
    return blocks == 1 ? " (the grid has one block, block 1)"
                       : fmt::format(" (the grid has blocks 1 to {})", blocks);
  std::vector<std::string> names{"imin", "imax", "jmin", "jmax", "kmin", "kmax", "all", "walls", kBlanks};
  for (const FaceRegion& region : faces.regions()) names.push_back(region.name);
  std::erase(names, word);  // a name that there is, of which this cache has nothing
  return didYouMean(word, names);
}

size_t variableOf(const std::string& name, const CacheReader& cache) {
  try {
    return cache.variableNamed(name);
  } catch (const UsageError& error) {
    throw Error("--surface-by: {}", error.what());
  }
}

/// The faces between drawn and blanked cells.
GridSurface blanksOf(const CacheReader& cache) {
  GridSurface surface;
  surface.faces = FacesReader::open(cache.path(), cache.manifest(), kBlanksFileName);
  if (!surface.faces)
    throw Error(
        "{}: --surface {}: the cache has no faces of blanked cells; convert its grid again with --surface {} "
        "(if it is structured and has blanked cells)",
        cache.path().string(), kBlanks, kBlanks);
  for (uint32_t n = 0; n < surface.faces->faces().size(); ++n) {
    const GridFace& face = surface.faces->faces()[n];
    surface.parts.push_back({n, {0, 0}, {face.nodes[0] - 1, face.nodes[1] - 1}});
  }
  return surface;
}

}  // namespace

GridSurface gridSurfaceNamed(const std::string& text, const CacheReader& cache,
                             const std::shared_ptr<const FacesReader>& faces) {
  if (text == kBlanks) return blanksOf(cache);
  const std::string path = cache.path().string();
  if (!faces && cache.manifest().isMesh())
    throw Error(
        "{}: --surface {}: the cache is of an unstructured grid, whose faces are not kept; "
        "name an STL, PLY, OBJ or VTP file that exists",
        path, text);
  if (!faces)
    throw Error(
        "{}: --surface {}: the cache has no surfaces: it was converted with --no-surfaces or by an earlier "
        "version; convert again, or name an STL, PLY, OBJ or VTP file that exists",
        path, text);
  GridSurface surface;
  surface.faces = faces;
  FaceFinder finder(*faces, cache, surface);
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    std::string word = text.substr(begin, end - begin);
    begin = end + 1;
    word.erase(0, word.find_first_not_of(' '));
    if (finder.add(word)) continue;
    if (word == kBlanks) throw Error("{}: --surface {}: give {} a --surface of its own", path, text, kBlanks);
    const auto name = parseFaceName(word);
    const bool is_plane = name && canBeKept(*name, cache.manifest());
    throw Error("{}: --surface {} names no face of the cache and no file{}; {}{}", path,
                word.empty() ? text : word, meantBy(word, cache.manifest(), *faces),
                whatThereIs(*faces, cache.manifest()),
                is_plane ? fmt::format("; convert --surface \"{}\" keeps an index plane", word) : "");
  }
  return surface;
}

std::vector<GridSurface> gridSurfacesNamed(const std::vector<WantedFaces>& wanted, const std::string& by,
                                           const std::string& opacity_by, const CacheReader& cache) {
  const auto faces = facesWith(by, cache);
  std::vector<GridSurface> surfaces;
  for (const WantedFaces& one : wanted) {
    GridSurface& surface = surfaces.emplace_back(gridSurfaceNamed(one.name, cache, faces));
    if (one.name == kBlanks) continue;  // without values
    if (!by.empty()) surface.scalar = scalarOfFaces(*faces, by, cache);
    if (one.has_opacities) takeOpacities(surface, opacity_by, cache);
  }
  return surfaces;
}

std::vector<std::string> faceNamesOf(const CacheReader& cache) {
  const auto faces = FacesReader::open(cache.path(), cache.manifest());
  const bool has_blanks = cache.manifest().file(kBlanksFileName) != nullptr;
  if (!faces) return has_blanks ? std::vector<std::string>{kBlanks} : std::vector<std::string>{};
  std::vector<std::string> names, of_blocks;
  std::set<std::string> known;
  const auto add = [&](std::vector<std::string>& list, const std::string& name) {
    if (known.insert(name).second) list.push_back(name);
  };
  for (const GridFace& face : faces->faces()) {
    const bool is_plane = face.side == FaceSide::kPlane;
    const std::string name = nameOf(face, cache.manifest());
    add(is_plane ? of_blocks : names, name);
    if (!is_plane && cache.manifest().blocks.size() > 1)
      add(of_blocks, fmt::format("block {}:{}={}", face.block + 1, name[0], name.substr(1)));
  }
  std::sort(names.begin(), names.end());
  if (names.size() > 1) names.insert(names.begin(), "all");
  if (std::any_of(faces->regions().begin(), faces->regions().end(), isWall) || hasWallsByFlow(cache, *faces))
    if (known.insert("walls").second) names.insert(names.begin(), "walls");  // what people look for most
  if (has_blanks) add(names, kBlanks);
  // A comma is taken for the end of a name.
  for (const FaceRegion& region : faces->regions())
    if (!region.name.empty() && region.name.find(',') == std::string::npos) add(names, region.name);
  if (names.size() + of_blocks.size() <= kMaxOffered)
    names.insert(names.end(), of_blocks.begin(), of_blocks.end());
  return names;
}

std::shared_ptr<const FacesReader> facesWith(const std::string& name, const CacheReader& cache) {
  auto own = FacesReader::open(cache.path(), cache.manifest());
  if (!own || name.empty()) return own;
  const uint32_t number = cache.manifest().variables[variableOf(name, cache)].number;
  const Series& series = cache.series();
  const uint64_t step = cache.step(), first = series.first_steps[series.steps[step].geometry];
  if (step == first && own->scalarOf(number)) return own;
  if (step != first) {
    if (auto faces = FacesReader::open(cache.cachePath(), cache.seriesManifest(), facesFileOfStep(step)))
      if (faces->scalarOf(number)) return faces;
  } else {
    for (const VariableInfo& added : cache.manifest().variables)
      if (auto faces = FacesReader::open(cache.path(), cache.manifest(), facesFileOfVariable(added.number)))
        if (faces->scalarOf(number)) return faces;
  }
  throw Error("{}: the faces have no values of {}: an earlier version added {} without them; convert again",
              cache.cachePath().string(), name, step != first ? fmt::format("step {}", step) : "the scalar");
}

std::optional<size_t> scalarOfFaces(const FacesReader& faces, const std::string& name,
                                    const CacheReader& cache) {
  return faces.scalarOf(cache.manifest().variables[variableOf(name, cache)].number);
}

void takeOpacities(GridSurface& surface, const std::string& name, const CacheReader& cache) {
  surface.opacity_faces = facesWith(name, cache);
  // One reader where both scalars are in the same file.
  if (surface.opacity_faces->path() == surface.faces->path()) surface.opacity_faces = surface.faces;
  if (surface.opacity_faces->patches().size() != surface.faces->patches().size())
    throw Error("{}: has {} patches of faces (expected {}, as {}); convert again",
                surface.opacity_faces->path().string(), surface.opacity_faces->patches().size(),
                surface.faces->patches().size(), surface.faces->path().string());
  surface.opacity_scalar = scalarOfFaces(*surface.opacity_faces, name, cache);
  surface.opacity_name = name;
}

void colourByScalar(GridSurface& surface, const std::string& name, const CacheReader& cache,
                    std::optional<size_t> drawn, const DefaultMaps& maps) {
  const size_t variable = variableOf(name, cache);
  surface.scalar = scalarOfFaces(*surface.faces, name, cache);
  if (variable == drawn) return;
  ScalarArguments arguments;
  arguments.scalar = name;
  arguments.with_sheets = true;
  PictureChoice choice(cache, variable, glm::dvec3(1.0), ChosenFor::kStep, maps);
  surface.function = std::make_shared<TransferFunction>(choice.function(arguments));
  surface.colours = std::make_shared<ColourTable>(*surface.function);
}

}  // namespace curvisplat
