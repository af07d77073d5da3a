#include "preprocess/formats/common/cells_of_faces.h"

#include <algorithm>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Cells whose faces are sorted in memory by one pass; and the most faces that may lie between faces that are read
// together.
constexpr uint64_t kCellsAtOnce = 500'000, kMaxGap = 512;

/// The points of some faces.
struct LoadedFaces {
  std::vector<uint64_t> numbers;  // sorted
  std::vector<uint64_t> place, length, points;

  std::span<const uint64_t> of(uint64_t face) const {
    const auto found =
        static_cast<size_t>(std::lower_bound(numbers.begin(), numbers.end(), face) - numbers.begin());
    return std::span(points).subspan(place[found], length[found]);
  }
};

/// Reads the faces with places [from, to) in out.numbers.
void loadRun(const FaceLists& lists, size_t from, size_t to, const std::string& file, LoadedFaces& out) {
  const uint64_t first = out.numbers[from];
  std::vector<uint64_t> ends(out.numbers[to - 1] - first + 2);
  lists.begins(first, ends);
  for (size_t n = 1; n < ends.size(); ++n)
    if (ends[n] < ends[n - 1] || ends[n] > lists.point_count)
      throw Error("{}: face {} ends before it begins; the mesh is damaged", file, first + n - 1);
  const size_t loaded = out.points.size();
  out.points.resize(loaded + (ends.back() - ends.front()));
  if (out.points.size() > loaded) lists.points(ends.front(), std::span(out.points).subspan(loaded));
  for (size_t n = from; n < to; ++n) {
    const uint64_t in_run = out.numbers[n] - first;
    out.place[n] = loaded + (ends[in_run] - ends.front());
    out.length[n] = ends[in_run + 1] - ends[in_run];
  }
}

LoadedFaces load(const FaceLists& lists, const CellChunk& chunk) {
  LoadedFaces loaded;
  loaded.numbers.assign(chunk.faces.begin(), chunk.faces.end());
  std::vector<uint64_t>& numbers = loaded.numbers;
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  if (!numbers.empty() && numbers.back() >= lists.faces)
    throw Error("{}: a cell from {} on refers to face {}; expected 0 to {}; the mesh is damaged", chunk.file,
                chunk.first, static_cast<int64_t>(numbers.back()), static_cast<int64_t>(lists.faces) - 1);
  loaded.place.resize(numbers.size());
  loaded.length.resize(numbers.size());
  for (size_t from = 0; from < numbers.size();) {
    size_t to = from + 1;
    while (to < numbers.size() && numbers[to] - numbers[to - 1] < kMaxGap) ++to;
    loadRun(lists, from, to, chunk.file, loaded);
    from = to;
  }
  return loaded;
}

}  // namespace

CellFaces sortFacesByCell(uint64_t cells, const ForEachSide& for_each_side, const ListSpools& spools) {
  CellFaces result;
  result.cells = cells;
  uint64_t total = 0;
  const auto write = [&](const SpoolFile::Sink& to_begins, const SpoolFile::Sink& to_faces) {
    for (uint64_t first = 0; first < cells; first += kCellsAtOnce) {
      const uint64_t count = std::min(kCellsAtOnce, cells - first);
      std::vector<uint64_t> begins(count + 1, 0), sorted;
      for_each_side([&](uint64_t, uint64_t cell) {
        if (cell >= first && cell < first + count) ++begins[cell - first + 1];
      });
      for (uint64_t cell = 0; cell < count; ++cell) begins[cell + 1] += begins[cell];
      sorted.resize(begins.back());
      std::vector<uint64_t> next(begins.begin(), begins.end() - 1);
      for_each_side([&](uint64_t face, uint64_t cell) {
        if (cell >= first && cell < first + count) sorted[next[cell - first]++] = face;
      });
      for (uint64_t& begin : begins) begin += total;
      to_begins(std::as_bytes(std::span(begins).first(count)));
      total += sorted.size();
      if (!sorted.empty()) to_faces(std::as_bytes(std::span(sorted)));
    }
    to_begins(std::as_bytes(std::span(&total, 1)));
  };
  // One file has one writer at a time.
  result.begins.spool = spools.begins;
  result.faces.spool = spools.items;
  result.begins.offset = spools.begins->append([&](const SpoolFile::Sink& to_begins) {
    result.faces.offset =
        spools.items->append([&](const SpoolFile::Sink& to_faces) { write(to_begins, to_faces); });
  });
  result.faces.count = total;
  result.begins.count = cells + 1;
  return result;
}

void appendCellsOfFaces(const FaceLists& lists, const CellChunk& chunk, MeshCells& out) {
  const LoadedFaces loaded = load(lists, chunk);
  std::vector<uint64_t> stream;
  for (size_t n = 0; n + 1 < chunk.begins.size(); ++n) {
    stream.clear();
    const auto of_cell =
        chunk.faces.subspan(chunk.begins[n] - chunk.begins[0], chunk.begins[n + 1] - chunk.begins[n]);
    for (const uint64_t face : of_cell) {
      const auto points = loaded.of(face);
      stream.push_back(points.size());
      stream.insert(stream.end(), points.begin(), points.end());
    }
    if (!out.appendPolyhedron(of_cell.size(), stream))
      throw Error("{}: cell {} has {} faces, or one with too few points; the mesh is damaged", chunk.file,
                  chunk.first + n, of_cell.size());
  }
}

}  // namespace curvisplat
