#include "preprocess/formats/su2/su2_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {

void SpooledMesh::readPoints(uint64_t first, uint64_t count, const Places& to) const {
  std::vector<double> values(3 * count);
  positions.read(3 * first, std::span(values));
  for (size_t n = 0; n < values.size(); ++n) to.axes[n % 3][n / 3] = values[n];
}

void SpooledMesh::appendCells(uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> from(count + 1);
  begins.read(first, std::span(from));
  std::vector<uint64_t> of_cells(from.back() - from.front());
  words.read(from.front(), std::span(of_cells));
  for (size_t n = 0; n < count; ++n) {
    const auto cell = std::span<const uint64_t>(of_cells).subspan(from[n] - from[0], from[n + 1] - from[n]);
    const auto kind = static_cast<CellKind>(cell[0]);
    if (kind == CellKind::kPolyhedron)
      out.appendPolyhedron(cell[1], cell.subspan(2));
    else
      out.append(kind, cell.subspan(1));
  }
}

void SpooledMeshWriter::addPoint(double x, double y, double z) {
  for (const double value : {x, y, z}) positions_.add(value);
}

void SpooledMeshWriter::addCell(CellKind kind, std::span<const uint64_t> corners) {
  begins_.add(words_.size());
  words_.add(static_cast<uint64_t>(kind));
  for (const uint64_t corner : corners) words_.add(corner);
}

void SpooledMeshWriter::addPolyhedron(uint64_t faces, std::span<const uint64_t> stream) {
  begins_.add(words_.size());
  words_.add(static_cast<uint64_t>(CellKind::kPolyhedron));
  words_.add(faces);
  for (const uint64_t word : stream) words_.add(word);
}

SpooledMesh SpooledMeshWriter::finish() {
  begins_.add(words_.size());
  return {positions_.finish(), begins_.finish(), words_.finish()};
}

namespace {

constexpr double kMaxCount = 0x1p40;
constexpr size_t kMaxWords = 16;  // of a line: a hexahedron has a type, 8 points and a number

/// VTK's types that SU2 has. kPolyhedron: none of them.
CellKind kindOf(double type) {
  if (type == 10) return CellKind::kTetrahedron;
  if (type == 12) return CellKind::kHexahedron;
  if (type == 13) return CellKind::kWedge;
  if (type == 14) return CellKind::kPyramid;
  return type == 1 || type == 3 || type == 5 || type == 9 ? CellKind::kNone : CellKind::kPolyhedron;
}

class MeshParser {
 public:
  MeshParser(const std::shared_ptr<const PooledFile>& file, const std::filesystem::path& folder)
      : text_(file, 0, file->size()), spools_(folder) {}

  std::vector<Su2Zone> run();

 private:
  template <typename... Values>
  [[noreturn]] void fail(fmt::format_string<Values...> words, Values&&... values) const {
    throw Error("{}: line {}: {}", text_.file().name(), line_number_,
                fmt::format(words, std::forward<Values>(values)...));
  }
  bool nextLine();
  std::optional<std::string_view> valueOf(std::string_view key) const;
  uint64_t count(std::string_view value) const;
  /// The numbers of the line. False unless it has from `least` to kMaxWords of them.
  bool numbers(size_t least);
  void readCells(uint64_t count);
  void readPoints(uint64_t count);
  void skip(uint64_t lines);
  void endZone();

  TextReader text_;
  const MeshSpools spools_;
  uint64_t line_number_ = 0;
  std::string_view line_;
  std::array<double, kMaxWords> numbers_{};
  size_t filled_ = 0;
  std::optional<SpooledMeshWriter> writer_;
  std::vector<std::string> markers_;
  std::vector<Su2Zone> zones_;
};

/// Goes to the next line that is not empty.
bool MeshParser::nextLine() {
  while (const auto line = text_.line()) {
    ++line_number_;
    line_ = trimmed(line->substr(0, line->find('%')));
    if (!line_.empty()) return true;
  }
  return false;
}

/// The text after `key=`, if the line begins so.
std::optional<std::string_view> MeshParser::valueOf(std::string_view key) const {
  if (!line_.starts_with(key)) return std::nullopt;
  const std::string_view rest = trimmed(line_.substr(key.size()));
  if (!rest.starts_with('=')) return std::nullopt;
  return trimmed(rest.substr(1));
}

uint64_t MeshParser::count(std::string_view value) const {
  double number = -1;
  const bool good = parseNumber(value.substr(0, value.find_first_of(" \t")), number);
  if (!good || !(number >= 0 && number <= kMaxCount) ||
      number != static_cast<double>(static_cast<uint64_t>(number)))
    fail("has the count '{}'; expected a whole number; the file is damaged", printable(value.substr(0, 40)));
  return static_cast<uint64_t>(number);
}

bool MeshParser::numbers(size_t least) {
  filled_ = 0;
  for (size_t at = 0; at < line_.size();) {
    const size_t end = std::min(line_.find_first_of(" \t,", at), line_.size());
    if (end > at && (filled_ == kMaxWords || !parseNumber(line_.substr(at, end - at), numbers_[filled_++])))
      return false;
    at = end + 1;
  }
  return filled_ >= least;
}

void MeshParser::readCells(uint64_t count) {
  std::array<uint64_t, 8> corners{};
  for (uint64_t n = 0; n < count; ++n) {
    if (!nextLine()) fail("the text ends after {} of {} elements; it is truncated", n, count);
    if (!numbers(2) || kindOf(numbers_[0]) == CellKind::kPolyhedron)
      fail("'{}' is not an element; expected a type (10, 12, 13 or 14) and points",
           printable(line_.substr(0, 60)));
    const CellKind kind = kindOf(numbers_[0]);
    const size_t points = cornersOf(kind);
    if (filled_ < points + 1)
      fail("an element of type {} has {} numbers; expected {} points", numbers_[0], filled_ - 1, points);
    if (kind != CellKind::kNone && filled_ > points + 2)
      fail("an element of type {} has {} numbers; expected {} points and at most its own number", numbers_[0],
           filled_ - 1, points);
    for (size_t c = 0; c < points; ++c) {
      const double point = numbers_[c + 1];
      if (!(point >= 0 && point <= kMaxCount)) fail("an element has the point {}", point);
      corners[c] = static_cast<uint64_t>(point);
    }
    writer_->addCell(kind, std::span(corners).first(points));
  }
}

void MeshParser::readPoints(uint64_t count) {
  for (uint64_t n = 0; n < count; ++n) {
    if (!nextLine()) fail("the text ends after {} of {} points; it is truncated", n, count);
    if (!numbers(3)) fail("'{}' is not a point; expected x, y and z", printable(line_.substr(0, 60)));
    writer_->addPoint(numbers_[0], numbers_[1], numbers_[2]);
  }
}

void MeshParser::skip(uint64_t lines) {
  for (uint64_t n = 0; n < lines; ++n)
    if (!nextLine()) fail("the text ends within a boundary; it is truncated");
}

void MeshParser::endZone() {
  if (!writer_) return;
  if (writer_->points() == 0 || writer_->cells() == 0)
    throw Error(
        "{}: zone {} has {} points and {} elements (NPOIN, NELEM); expected both; the file is damaged",
        text_.file().name(), zones_.size() + 1, writer_->points(), writer_->cells());
  zones_.push_back({writer_->finish(), std::move(markers_)});
  writer_.reset();
  markers_.clear();
}

std::vector<Su2Zone> MeshParser::run() {
  while (nextLine()) {
    const auto has_begun = [&] { return writer_ && writer_->points() + writer_->cells() > 0; };
    if (valueOf("IZONE")) {
      // A file of several zones may have NDIME once, before NZONE.
      if (has_begun()) {
        endZone();
        writer_.emplace(spools_);
      }
      continue;
    }
    if (const auto value = valueOf("NDIME")) {
      if (has_begun()) endZone();
      if (count(*value) != 3)
        throw Error("{}: is a mesh of {} dimensions (NDIME); expected 3", text_.file().name(), count(*value));
      writer_.emplace(spools_);
    } else if (const auto cells = valueOf("NELEM")) {
      if (!writer_) fail("elements precede NDIME; the file is damaged");
      readCells(count(*cells));
    } else if (const auto points = valueOf("NPOIN")) {
      if (!writer_) fail("points precede NDIME; the file is damaged");
      readPoints(count(*points));
    } else if (const auto tag = valueOf("MARKER_TAG")) {
      markers_.emplace_back(printable(tag->substr(0, 64)));
    } else if (const auto faces = valueOf("MARKER_ELEMS")) {
      skip(count(*faces));
    }
  }
  endZone();
  if (zones_.empty()) throw Error("{}: has no mesh (NDIME, NELEM, NPOIN)", text_.file().name());
  return std::move(zones_);
}

}  // namespace

std::vector<Su2Zone> readSu2Mesh(const std::shared_ptr<const PooledFile>& file,
                                 const std::filesystem::path& folder) {
  return MeshParser(file, folder).run();
}

}  // namespace curvisplat
