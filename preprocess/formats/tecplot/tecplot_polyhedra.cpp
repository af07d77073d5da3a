#include "preprocess/formats/tecplot/tecplot_polyhedra.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/formats/common/element_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kAtOnce = 65536;

/// Calls use(n, number) for the first `count` numbers.
template <typename Use>
void forEachNumber(const TecplotValues& values, uint64_t count, const Use& use) {
  std::vector<double> some;
  for (uint64_t n = 0; n < count; n += some.size()) {
    some.resize(std::min(kAtOnce, count - n));
    readTecplotValues(values, n, std::span(some));
    for (size_t k = 0; k < some.size(); ++k) use(n + k, some[k]);
  }
}

}  // namespace

TecplotPolyhedra::TecplotPolyhedra(const TecplotZone& zone, std::string where, const ListSpools& spools)
    : zone_(zone), where_(std::move(where)), begins_(beginsOf(spools)) {
  // Writers count the elements of binary files from 0 or from 1; each has faces, also the last.
  const double most = static_cast<double>(zone.elements), first = lastElement() == most ? 1 : 0;
  cells_ = sortFacesByCell(
      zone.elements,
      [&](const auto& use) {
        for (const TecplotValues* const side : {&zone.faces.left, &zone.faces.right})
          forEachNumber(*side, zone.faces.count, [&](uint64_t face, double element) {
            if (!(element >= first)) return;  // outside, or an element of another zone
            if (!(element < most + first))
              throw Error("{}: face {} belongs to element {}; expected up to {}; the file is damaged", where_,
                          face + 1, element, most);
            use(face, static_cast<uint64_t>(element - first));
          });
      },
      spools);
}

double TecplotPolyhedra::lastElement() const {
  double last = 0;
  for (const TecplotValues* const side : {&zone_.faces.left, &zone_.faces.right})
    forEachNumber(*side, zone_.faces.count,
                  [&](uint64_t, double element) { last = std::max(last, element); });
  return last;
}

SpooledNumbers TecplotPolyhedra::beginsOf(const ListSpools& spools) const {
  const TecplotFaces& faces = zone_.faces;
  NumberSpool<uint64_t> begins(spools.begins);
  uint64_t next = 0;
  const auto add = [&](double begin, uint64_t face) {
    if (!(begin >= static_cast<double>(next) && begin <= static_cast<double>(faces.corner_count)))
      throw Error("{}: the corners of face {} begin at {}; expected {} to {}; the file is damaged", where_,
                  face + 1, begin, next, faces.corner_count);
    next = static_cast<uint64_t>(begin);
    begins.add(next);
  };
  if (faces.has_begins) {
    forEachNumber(faces.sizes, faces.count + 1, [&](uint64_t face, double begin) { add(begin, face); });
  } else {
    add(0, 0);
    forEachNumber(faces.sizes, faces.count,
                  [&](uint64_t face, double size) { add(static_cast<double>(next) + size, face + 1); });
  }
  if (next != faces.corner_count)
    throw Error("{}: its faces have {} corners; expected {}; the file is damaged", where_, next,
                faces.corner_count);
  return begins.finish();
}

void TecplotPolyhedra::append(uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> begins(count + 1);
  cells_.begins.read(first, std::span(begins));
  std::vector<uint64_t> faces(begins.back() - begins.front());
  cells_.faces.read(begins.front(), std::span(faces));
  const FaceLists lists{[&](uint64_t from, std::span<uint64_t> to) { begins_.read(from, to); },
                        [&](uint64_t from, std::span<uint64_t> to) {
                          std::vector<double> some(to.size());
                          readTecplotValues(zone_.faces.corners, from, std::span(some));
                          for (size_t n = 0; n < some.size(); ++n)
                            to[n] = pointNumber(some[n], static_cast<double>(zone_.first_node));
                        },
                        zone_.faces.count, zone_.faces.corner_count};
  appendCellsOfFaces(lists, {begins, faces, where_, first}, out);
}

}  // namespace curvisplat
