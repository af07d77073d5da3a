#include "preprocess/formats/ensight/ensight_parts.h"

#include <algorithm>
#include <limits>
#include <string_view>
#include <unordered_map>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLengthsAtOnce = 65536;
constexpr uint64_t kMaxAxis = 1 << 24;  // nodes along an axis of a rectilinear part, which are kept in memory
constexpr uint64_t kMaxPoints = 1ull << 31;

struct Type {
  std::string_view name;
  CellKind kind;
  uint64_t nodes;
};
constexpr std::array<Type, 15> kTypes{{{"point", CellKind::kNone, 1},
                                       {"bar2", CellKind::kNone, 2},
                                       {"bar3", CellKind::kNone, 3},
                                       {"tria3", CellKind::kNone, 3},
                                       {"tria6", CellKind::kNone, 6},
                                       {"quad4", CellKind::kNone, 4},
                                       {"quad8", CellKind::kNone, 8},
                                       {"tetra4", CellKind::kTetrahedron, 4},
                                       {"tetra10", CellKind::kTetrahedron, 10},
                                       {"pyramid5", CellKind::kPyramid, 5},
                                       {"pyramid13", CellKind::kPyramid, 13},
                                       {"penta6", CellKind::kWedge, 6},
                                       {"penta15", CellKind::kWedge, 15},
                                       {"hexa8", CellKind::kHexahedron, 8},
                                       {"hexa20", CellKind::kHexahedron, 20}}};

/// A type of elements with its kind and number of nodes; nodes_each is 0 if there is no such type.
EnsightElements elementsOf(const std::string& type) {
  EnsightElements elements;
  elements.type = type;
  elements.ghosts = type.starts_with("g_");
  const std::string_view name = std::string_view(type).substr(elements.ghosts ? 2 : 0);
  for (const Type& known : kTypes)
    if (known.name == name) {
      elements.kind = known.kind;
      elements.nodes_each = known.nodes;
    }
  return elements;
}

class GeometryReader {
 public:
  GeometryReader(const EnsightPlace& place, const EnsightScratch& scratch)
      : file_(place, std::nullopt, scratch), scratch_(scratch) {}

  EnsightGeometry run();

 private:
  void readHead();
  void readPart(bool first);
  void readCoordinates(EnsightPart& part);
  void readElements(const std::string& type, EnsightPart& part);
  void readPolyhedra(EnsightElements& elements);
  void readBlock(const std::string& words, EnsightPart& part);
  SpooledNumbers beginsOf(const EnsightList& lengths);

  EnsightFile file_;
  const EnsightScratch& scratch_;
  bool node_ids_ = false, element_ids_ = false;
  std::string next_;  // keyword
  EnsightGeometry geometry_;
};

void GeometryReader::readHead() {
  file_.text();
  file_.text();  // two lines of description
  for (const char* const key : {"node id", "element id"}) {
    const std::string words = file_.keyword();
    if (!words.starts_with(key))
      throw Error("{}: has '{}' where '{}' is expected; it is not a geometry file of EnSight Gold",
                  file_.name(), printable(words.substr(0, 40)), key);
    const bool stored = words.find("given") != std::string::npos || words.find("ignore") != std::string::npos;
    (std::string_view(key) == "node id" ? node_ids_ : element_ids_) = stored;
  }
  next_ = file_.keyword();
  if (next_.starts_with("extents")) {
    file_.floats(6);
    next_ = file_.keyword();
  }
}

void GeometryReader::readCoordinates(EnsightPart& part) {
  part.points = file_.integer();
  if (part.points > kMaxPoints)
    throw Error("{}: part {} has {} nodes; expected at most {}", file_.name(), part.number, part.points,
                kMaxPoints);
  if (node_ids_) file_.integers(part.points);
  part.coordinates = file_.floats(3 * part.points);
}

/// The starts of some lists, from their lengths.
SpooledNumbers GeometryReader::beginsOf(const EnsightList& lengths) {
  NumberSpool<uint64_t> begins(scratch_.spools.begins);
  file_.finish();
  uint64_t total = 0;
  std::vector<double> values;
  for (uint64_t first = 0; first < lengths.count; first += kLengthsAtOnce) {
    values.resize(std::min(kLengthsAtOnce, lengths.count - first));
    lengths.read(first, std::span(values));
    for (const double value : values) {
      begins.add(total);
      if (!(value >= 0 && value <= static_cast<double>(kMaxPoints)))
        throw Error("{}: a polyhedron or a face has {} faces or nodes; the file is damaged", file_.name(),
                    value);
      total += static_cast<uint64_t>(value);
    }
  }
  begins.add(total);
  return begins.finish();
}

uint64_t lastOf(const SpooledNumbers& begins) {
  uint64_t last = 0;
  begins.read(begins.count - 1, std::span(&last, 1));
  return last;
}

void GeometryReader::readPolyhedra(EnsightElements& elements) {
  elements.first_face = beginsOf(file_.integers(elements.count));
  elements.first_node = beginsOf(file_.integers(lastOf(elements.first_face)));
  elements.nodes = file_.integers(lastOf(elements.first_node));
}

void GeometryReader::readElements(const std::string& type, EnsightPart& part) {
  EnsightElements elements = elementsOf(type);
  const bool polygons = elements.type.ends_with("nsided"), polyhedra = elements.type.ends_with("nfaced");
  if (elements.nodes_each == 0 && !polygons && !polyhedra)
    throw Error(
        "{}: part {} has elements of type '{}', which EnSight Gold does not have; the file is damaged",
        file_.name(), part.number, printable(type.substr(0, 40)));
  elements.count = file_.integer();
  if (element_ids_) file_.integers(elements.count);
  if (polyhedra) {
    elements.kind = CellKind::kPolyhedron;
    readPolyhedra(elements);
  } else if (polygons) {
    file_.integers(lastOf(beginsOf(file_.integers(elements.count))));
  } else {
    if (elements.count > kMaxPoints)
      throw Error("{}: part {} has {} elements of type {}; expected at most {}", file_.name(), part.number,
                  elements.count, type, kMaxPoints);
    elements.nodes = file_.integers(elements.count * elements.nodes_each);
  }
  if (elements.kind != CellKind::kNone) part.cells += elements.count;
  part.elements.push_back(std::move(elements));
}

void GeometryReader::readBlock(const std::string& words, EnsightPart& part) {
  part.structured = true;
  const auto has = [&](const char* word) { return words.find(word) != std::string::npos; };
  if (has("range"))
    throw Error("{}: part {} is a block of a range, which is not read", file_.name(), part.number);
  const std::vector<double> sizes = file_.valuesOf(file_.integers(3));
  part.points = 1;
  part.cells = 1;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!(sizes[axis] >= 1 && sizes[axis] <= static_cast<double>(kMaxPoints)))
      throw Error("{}: part {} has {} nodes along {}; the file is damaged", file_.name(), part.number,
                  sizes[axis], "ijk"[axis]);
    part.nodes[axis] = static_cast<uint64_t>(sizes[axis]);
    if (part.nodes[axis] > kMaxPoints * 8 / part.points)
      throw Error("{}: part {} has too many nodes; the file is damaged", file_.name(), part.number);
    part.points *= part.nodes[axis];
    part.cells *= part.nodes[axis] - 1;
  }
  if (has("uniform") || has("rectilinear")) {
    part.kind = has("uniform") ? EnsightPart::Kind::kUniform : EnsightPart::Kind::kRectilinear;
    if (*std::max_element(part.nodes.begin(), part.nodes.end()) > kMaxAxis)
      throw Error("{}: part {} has more than {} nodes along an axis", file_.name(), part.number, kMaxAxis);
    if (has("uniform")) {
      const std::vector<double> values = file_.valuesOf(file_.floats(6));
      for (size_t axis = 0; axis < 3; ++axis)
        for (uint64_t n = 0; n < part.nodes[axis]; ++n)
          part.axes[axis].push_back(values[axis] + values[3 + axis] * static_cast<double>(n));
    } else {
      for (size_t axis = 0; axis < 3; ++axis)
        part.axes[axis] = file_.valuesOf(file_.floats(part.nodes[axis]));
    }
  } else {
    part.coordinates = file_.floats(3 * part.points);
  }
  if (has("iblanked")) part.iblank = file_.integers(part.points);
  next_ = file_.keyword();
  // Skips what is not needed: ghosts of cells, numbers of nodes and of elements.
  if (next_.starts_with("ghost_flags")) {
    file_.integers(part.cells);
    next_ = file_.keyword();
  }
  if (next_ == "node_ids") {
    file_.integers(part.points);
    next_ = file_.keyword();
  }
  if (next_ == "element_ids") {
    file_.integers(part.cells);
    next_ = file_.keyword();
  }
}

void GeometryReader::readPart(bool first) {
  if (next_ != "part")
    throw Error("{}: has '{}' where 'part' is expected; the file is damaged", file_.name(),
                printable(next_.substr(0, 40)));
  EnsightPart part;
  part.number = file_.integer(first);
  part.name = printable(file_.text());
  next_ = file_.keyword();
  if (next_.starts_with("block")) {
    readBlock(next_, part);
  } else if (next_ == "coordinates") {
    readCoordinates(part);
    for (next_ = file_.keyword(); !next_.empty() && next_ != "part"; next_ = file_.keyword())
      readElements(next_, part);
  } else if (!next_.empty() && next_ != "part") {
    throw Error("{}: part {} begins with '{}'; expected 'coordinates' or 'block'; the file is damaged",
                file_.name(), part.number, printable(next_.substr(0, 40)));
  }
  geometry_.parts.push_back(std::move(part));
}

EnsightGeometry GeometryReader::run() {
  readHead();
  for (bool first = true; !next_.empty(); first = false) readPart(first);
  if (geometry_.parts.empty()) throw Error("{}: has no part; it is truncated", file_.name());
  file_.finish();
  geometry_.binary = file_.binary();
  geometry_.swap = file_.swap();
  return std::move(geometry_);
}

}  // namespace

EnsightGeometry readEnsightGeometry(const EnsightPlace& place, const EnsightScratch& scratch) {
  return GeometryReader(place, scratch).run();
}

namespace {

class ValuesReader {
 public:
  ValuesReader(const EnsightVariable& variable, const EnsightGeometry& geometry,
               const EnsightScratch& scratch)
      : variable_(variable), geometry_(geometry), file_(variable.place, geometry.binary, scratch) {
    file_.setSwap(geometry.swap);
  }

  std::vector<EnsightValues> run();

 private:
  void readPart(size_t number);
  /// The place of the values under a keyword, and how many they are.
  std::pair<size_t, uint64_t> placeOf(const EnsightPart& part, const std::string& keyword) const;

  const EnsightVariable& variable_;
  const EnsightGeometry& geometry_;
  EnsightFile file_;
  std::string next_;
  std::vector<EnsightValues> values_;
};

std::pair<size_t, uint64_t> ValuesReader::placeOf(const EnsightPart& part, const std::string& keyword) const {
  const bool nodes = variable_.centring == Centring::kNode;
  if (part.structured && keyword == "block") return {0, nodes ? part.points : part.cells};
  if (!part.structured && nodes && keyword == "coordinates") return {0, part.points};
  if (!part.structured && !nodes)
    for (size_t n = 0; n < part.elements.size(); ++n)
      if (part.elements[n].type == keyword) return {n, part.elements[n].count};
  throw Error("{}: has '{}' in part {}; expected {}; the file is damaged, or of another geometry",
              file_.name(), printable(keyword.substr(0, 40)), part.number,
              part.structured ? "'block'"
              : nodes         ? "'coordinates'"
                              : "one of the part's types of elements");
}

void ValuesReader::readPart(size_t number) {
  const EnsightPart& part = geometry_.parts[number];
  EnsightValues& values = values_[number];
  for (next_ = file_.keyword(); !next_.empty() && next_ != "part"; next_ = file_.keyword()) {
    std::string keyword = next_;
    const size_t space = keyword.find(' ');
    const std::string how =
        space == std::string::npos ? "" : keyword.substr(keyword.find_first_not_of(' ', space));
    keyword.resize(std::min(space, keyword.size()));
    const auto [list, count] = placeOf(part, keyword);
    if (values.lists.size() <= list) {
      values.lists.resize(list + 1);
      values.undefined.resize(list + 1, std::numeric_limits<double>::quiet_NaN());
    }
    if (how == "undef")
      values.undefined[list] = file_.valuesOf(file_.floats(1))[0];
    else if (!how.empty())
      throw Error("{}: has '{}' values in part {}, which are not read; expected values everywhere",
                  file_.name(), printable(how.substr(0, 40)), part.number);
    values.lists[list] = file_.floats(count * variable_.components);
  }
}

std::vector<EnsightValues> ValuesReader::run() {
  values_.resize(geometry_.parts.size());
  file_.text();  // description
  next_ = file_.keyword();
  std::unordered_map<uint64_t, size_t> parts;  // by their numbers; of equal ones the first
  for (size_t n = 0; n < geometry_.parts.size(); ++n) parts.emplace(geometry_.parts[n].number, n);
  while (!next_.empty()) {
    const uint64_t number = next_ == "part" ? file_.integer() : 0;
    const auto found = parts.find(number);
    if (next_ != "part" || found == parts.end())
      throw Error("{}: has '{}' {} where a part of the geometry is expected; the file is damaged",
                  file_.name(), printable(next_.substr(0, 40)), number);
    readPart(found->second);
  }
  file_.finish();
  return std::move(values_);
}

}  // namespace

std::vector<EnsightValues> readEnsightValues(const EnsightVariable& variable, const EnsightGeometry& geometry,
                                             const EnsightScratch& scratch) {
  return ValuesReader(variable, geometry, scratch).run();
}

}  // namespace curvisplat
