#include "preprocess/formats/cgns/cgns_cells.h"
#include "preprocess/mesh/curved_cells.h"

#include <algorithm>
#include <array>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kElementsAtOnce = 65536;
// Elements of the highest order that CGNS knows have 125 nodes and a type.
constexpr int64_t kMaxNumbers = 126;

/// The point of a node, which the file counts from 1. Numbers below 1 become one that is too large, which is
/// refused.
uint64_t pointOf(int64_t node) {
  return node >= 1 ? static_cast<uint64_t>(node) - 1 : std::numeric_limits<uint64_t>::max();
}

std::vector<int64_t> integersOf(const CgnsIntegers& list, uint64_t first, uint64_t count) {
  std::vector<int64_t> values(count);
  list.read(first, values);
  return values;
}

/// A piece of a list that is several lists, one after the other: `begins` of each and behind the last. Calls
/// use(list, from, count) for each of those that it lies in.
template <typename Use>
void forEachPart(const std::vector<uint64_t>& begins, uint64_t first, uint64_t count, const Use& use) {
  for (size_t n = 0; n + 1 < begins.size() && count > 0; ++n) {
    if (first >= begins[n + 1]) continue;
    const uint64_t part = std::min(count, begins[n + 1] - first);
    use(n, first - begins[n], part);
    first += part;
    count -= part;
  }
}

}  // namespace

CgnsCells::CgnsCells(const CgnsFile& file, const CgnsZone& zone, const ListSpools& spools)
    : file_(file.path().string()),
      zone_(zone.base + "/" + zone.name),
      sections_(readCgnsSections(file, zone.sections, spools)) {
  first_face_.push_back(0);
  first_point_.push_back(0);
  for (const CgnsSection& section : sections_) {
    if (section.type == kCgnsNgon) {
      faces_.push_back(&section);
      first_face_.push_back(first_face_.back() + section.elements);
      first_point_.push_back(first_point_.back() + section.connectivity.count);
      continue;
    }
    const uint64_t before = counts_.solid;
    countCells(section);
    if (counts_.solid == before) continue;  // a surface: values in cells have none for its elements
    runs_.push_back({&section, cells_, section.elements});
    cells_ += section.elements;
  }
  const bool has_nface = std::any_of(sections_.begin(), sections_.end(),
                                     [](const CgnsSection& s) { return s.type == kCgnsNface; });
  if (has_nface && faces_.empty())
    throw Error("{}: {} has cells of faces (NFACE_n) without faces (NGON_n); the file is damaged", file_,
                zone_);
  if (!faces_.empty() && !has_nface) findCellsOfFaces(spools);
}

std::string CgnsCells::label() const {
  return file_ + ": " + zone_;
}

void CgnsCells::countCells(const CgnsSection& section) {
  const CgnsElementKind kind = section.kind();
  if (section.type == kCgnsNface) counts_.solid += section.elements;
  if (kind.cell != CellKind::kNone) {
    counts_.solid += section.elements;
    if (kind.nodes > cornersOf(kind.cell)) counts_.curved += section.elements;
  }
  if (section.type != kCgnsMixed) return;
  for (uint64_t first = 0; first < section.elements; first += kElementsAtOnce / 8) {
    const uint64_t count = std::min(kElementsAtOnce / 8, section.elements - first);
    const std::vector<int64_t> begins = integersOf(section.begins, first, count + 1);
    if (static_cast<uint64_t>(begins.back() - begins.front()) > count * kMaxNumbers)
      throw Error("{}: {} has {} numbers for {} elements; the file is damaged", file_, section.path,
                  begins.back() - begins.front(), count);
    const std::vector<int64_t> numbers =
        integersOf(section.connectivity, static_cast<uint64_t>(begins.front()),
                   static_cast<uint64_t>(begins.back() - begins.front()));
    for (size_t n = 0; n < count; ++n) {
      const int64_t length = begins[n + 1] - begins[n];
      const int64_t type = length > 0 ? numbers[static_cast<size_t>(begins[n] - begins.front())] : 0;
      const CgnsElementKind element = section.kindOf(type);
      if (element.nodes == 0 || length != element.nodes + 1)
        throw Error("{}: {}: element {} has type {} and {} entries, which do not match; the file is damaged",
                    file_, section.path, section.first + first + n, type, length);
      const bool solid = element.cell != CellKind::kNone;
      ++(solid ? counts_.solid : counts_.others);
      if (solid && element.nodes > cornersOf(element.cell)) ++counts_.curved;
    }
  }
}

/// The cells that are on the sides of faces.
void CgnsCells::findCellsOfFaces(const ListSpools& spools) {
  for (const CgnsSection* const section : faces_)
    if (!section->parents.read)
      throw Error("{}: {} has neither cells (NFACE_n) nor ParentElements; expected one of them", file_,
                  section->path);
  uint64_t base = 0;  // number of the first cell
  const auto forEachCell = [&](const auto& use) {
    for (size_t n = 0; n < faces_.size(); ++n)
      for (uint64_t side = 0; side < 2; ++side)
        for (uint64_t first = 0; first < faces_[n]->elements; first += kElementsAtOnce) {
          // ParentData has as many rows as elements, and more columns.
          const uint64_t count = std::min(kElementsAtOnce, faces_[n]->elements - first);
          const std::vector<int64_t> cells =
              integersOf(faces_[n]->parents, side * faces_[n]->elements + first, count);
          for (size_t face = 0; face < count; ++face)
            if (cells[face] != 0) use(first_face_[n] + first + face, cells[face]);
        }
  };
  int64_t lowest = std::numeric_limits<int64_t>::max(), highest = 0;
  forEachCell([&](uint64_t, int64_t cell) {
    lowest = std::min(lowest, cell);
    highest = std::max(highest, cell);
  });
  if (lowest < 1 || highest < lowest || static_cast<uint64_t>(highest - lowest) >= 2 * first_face_.back())
    throw Error("{}: the ParentElements of {} name elements {} to {}; expected cells that follow one another",
                file_, zone_, lowest, highest);
  base = static_cast<uint64_t>(lowest);
  const uint64_t cells = static_cast<uint64_t>(highest - lowest) + 1;
  by_sides_ = sortFacesByCell(
      cells,
      [&](const auto& use) {
        forEachCell([&](uint64_t face, int64_t cell) { use(face, static_cast<uint64_t>(cell) - base); });
      },
      spools);
  runs_.push_back({nullptr, cells_, cells});
  cells_ += cells;
  counts_.solid += cells;
}

/// The index of the face that has an element's number, which may be negative.
uint64_t CgnsCells::faceOf(int64_t element) const {
  const uint64_t number =
      element < 0 ? uint64_t{0} - static_cast<uint64_t>(element) : static_cast<uint64_t>(element);
  for (size_t n = 0; n < faces_.size(); ++n)
    if (number >= faces_[n]->first && number - faces_[n]->first < faces_[n]->elements)
      return first_face_[n] + (number - faces_[n]->first);
  throw Error("{}: a cell has the face {}, which is not an element of NGON_n; the file is damaged", label(),
              element);
}

void CgnsCells::readFaceBegins(uint64_t first, std::span<uint64_t> to) const {
  // The entry after the last face of all says where its points end.
  std::span<uint64_t> left = to;
  if (first + to.size() == first_face_.back() + 1) {
    left = to.first(to.size() - 1);
    to.back() = first_point_.back();
  }
  uint64_t done = 0;
  forEachPart(first_face_, first, left.size(), [&](size_t n, uint64_t from, uint64_t count) {
    const std::vector<int64_t> begins = integersOf(faces_[n]->begins, from, count);
    for (const int64_t begin : begins) to[done++] = first_point_[n] + static_cast<uint64_t>(begin);
  });
}

void CgnsCells::readFacePoints(uint64_t first, std::span<uint64_t> to) const {
  uint64_t done = 0;
  forEachPart(first_point_, first, to.size(), [&](size_t n, uint64_t from, uint64_t count) {
    for (const int64_t node : integersOf(faces_[n]->connectivity, from, count)) to[done++] = pointOf(node);
  });
}

FaceLists CgnsCells::faceLists() const {
  return {[this](uint64_t first, std::span<uint64_t> to) { readFaceBegins(first, to); },
          [this](uint64_t first, std::span<uint64_t> to) { readFacePoints(first, to); }, first_face_.back(),
          first_point_.back()};
}

void CgnsCells::readFixed(const CgnsSection& section, uint64_t first, uint64_t count, MeshCells& out) const {
  const CgnsElementKind kind = section.kind();
  const std::vector<int64_t> nodes = integersOf(section.connectivity, first * kind.nodes, count * kind.nodes);
  std::array<uint64_t, kMaxNumbers> points{};
  for (uint64_t n = 0; n < count; ++n) {
    for (size_t node = 0; node < kind.nodes; ++node) points[node] = pointOf(nodes[n * kind.nodes + node]);
    appendCurvedAsExodus(kind.cell, true, std::span(points).first(kind.nodes), out);
  }
}

void CgnsCells::readMixed(const CgnsSection& section, uint64_t first, uint64_t count, MeshCells& out) const {
  const std::vector<int64_t> begins = integersOf(section.begins, first, count + 1);
  const auto base = static_cast<uint64_t>(begins.front());
  const std::vector<int64_t> numbers =
      integersOf(section.connectivity, base, static_cast<uint64_t>(begins.back()) - base);
  std::array<uint64_t, kMaxNumbers> points{};
  for (uint64_t n = 0; n < count; ++n) {
    const auto from = static_cast<size_t>(begins[n]) - base;
    const CgnsElementKind kind = section.kindOf(numbers[from]);  // checked when the zone was opened
    for (size_t node = 0; node < kind.nodes; ++node) points[node] = pointOf(numbers[from + 1 + node]);
    appendCurvedAsExodus(kind.cell, true, std::span(points).first(kind.nodes), out);
  }
}

void CgnsCells::readNface(const CgnsSection& section, uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> begins(count + 1), faces;
  const std::vector<int64_t> stored = integersOf(section.begins, first, count + 1);
  const auto base = static_cast<uint64_t>(stored.front());
  for (uint64_t n = 0; n <= count; ++n) begins[n] = static_cast<uint64_t>(stored[n]);
  for (const int64_t element : integersOf(section.connectivity, base, begins.back() - base))
    faces.push_back(faceOf(element));
  appendCellsOfFaces(faceLists(), {begins, faces, label(), first}, out);
}

void CgnsCells::readBySides(uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> begins(count + 1);
  by_sides_->begins.read(first, std::span(begins));
  std::vector<uint64_t> faces(begins.back() - begins.front());
  by_sides_->faces.read(begins.front(), std::span(faces));
  appendCellsOfFaces(faceLists(), {begins, faces, label(), first}, out);
}

void CgnsCells::read(uint64_t first, uint64_t count, MeshCells& out) const {
  out.clear();
  for (const Run& run : runs_) {
    const uint64_t from = std::max(first, run.first), to = std::min(first + count, run.first + run.cells);
    if (from >= to) continue;
    const uint64_t in_run = from - run.first;
    if (!run.section)
      readBySides(in_run, to - from, out);
    else if (run.section->type == kCgnsMixed)
      readMixed(*run.section, in_run, to - from, out);
    else if (run.section->type == kCgnsNface)
      readNface(*run.section, in_run, to - from, out);
    else
      readFixed(*run.section, in_run, to - from, out);
  }
}

}  // namespace curvisplat
