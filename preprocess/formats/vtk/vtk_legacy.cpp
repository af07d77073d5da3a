#include "preprocess/formats/vtk/vtk_legacy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/vtk/vtk_legacy_file.h"
#include "preprocess/formats/vtk/vtk_mesh_source.h"
#include "preprocess/formats/vtk/vtk_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxNodes = VtkLegacyFile::kMaxCount;
constexpr uint64_t kMaxAlongAxis = uint64_t{1} << 30;

/// Reads the file from beginning to end. It is a sequence of parts, each a line of keywords and its numbers.
class LegacyReader : VtkLegacyFile {
 public:
  using VtkLegacyFile::VtkLegacyFile;

  VtkLines readLines() {
    wants_lines_ = true;
    readHead();
    for (std::string word = nextWord(); !word.empty(); word = nextWord()) readPart(word);
    if (!std::get<VtkPoints>(piece_.nodes).bytes) fail("has no POINTS; the file is truncated");
    return {std::move(piece_), std::move(cells_), first_line_};
  }

  std::unique_ptr<DataSource> read() {
    readHead();
    for (std::string word = nextWord(); !word.empty(); word = nextWord()) readPart(word);
    if (unstructured_) return std::make_unique<VtkMeshSource>(finishMesh());
    return std::make_unique<VtkSource>(finishGrid());
  }

 private:
  VtkMesh finishMesh() {
    if (!std::get<VtkPoints>(piece_.nodes).bytes) fail("has no POINTS; the file is truncated");
    if (!cells_.ends.bytes || !cells_.types.bytes) fail("has no CELLS or CELL_TYPES; the file is truncated");
    VtkMesh mesh;
    mesh.names.push_back({"piece 1", file_->name(), std::get<VtkPoints>(piece_.nodes).tuples, cells_.cells});
    mesh.pieces.push_back(std::move(piece_));
    mesh.cells.push_back(std::move(cells_));
    mesh.files = {file_->name()};
    mesh.times = std::move(grid_.times);
    mesh.warnings = std::move(grid_.warnings);
    mesh.format = fmt::format("legacy VTK {}, {}", dataset_, ascii_ ? "ASCII" : "binary");
    return mesh;
  }

  VtkGrid finishGrid() {
    finishNodes();
    grid_.pieces.push_back(std::move(piece_));
    grid_.blocks.push_back({"block 1", 0, grid_.pieces.front().extent});
    grid_.files = {file_->name()};
    grid_.format = fmt::format("legacy VTK {}, {}, 1 block", dataset_, ascii_ ? "ASCII" : "binary");
    return std::move(grid_);
  }

  enum class Owner { kGrid, kPoints, kCells };

  void readHead() {
    const std::string_view first = text_.line().value_or("");  // "# vtk DataFile Version 3.0"
    double version = 0;
    parseNumber(first.substr(std::min(first.size(), first.rfind(' ') + 1)), version);
    cells_.older_edges = version < 5.1;
    text_.line();  // the title
    const std::string encoding = nextWord();
    if (encoding != "ascii" && encoding != "binary")
      fail("has \"{}\" in its third line; expected ASCII or BINARY", encoding.substr(0, 30));
    ascii_ = encoding == "ascii";
    std::string word = nextWord();
    const bool has_field = word == "field";
    // Field data may precede the grid.
    for (; word == "field" || word == "metadata"; word = nextWord())
      word == "field" ? readField() : skipMetadata();
    dataset_ = nextWord();
    constexpr const char* kExpected =
        "expected STRUCTURED_GRID, RECTILINEAR_GRID, STRUCTURED_POINTS or UNSTRUCTURED_GRID";
    if ((word.empty() && has_field) || (word == "dataset" && dataset_ == "field"))
      fail("has field data alone, without a grid; {}", kExpected);
    if (word != "dataset") fail("found \"{}\"; expected DATASET", word.substr(0, 30));
    std::transform(dataset_.begin(), dataset_.end(), dataset_.begin(),
                   [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; });
    uniform_ = dataset_ == "STRUCTURED_POINTS";
    unstructured_ = dataset_ == "UNSTRUCTURED_GRID";
    if (wants_lines_ && (unstructured_ || dataset_ == "POLYDATA")) {
      polygonal_ = !unstructured_;
      unstructured_ = true;
      return;
    }
    if (wants_lines_)
      fail("is a {}; lines and points are in POLYDATA or UNSTRUCTURED_GRID", dataset_.substr(0, 30));
    if (!uniform_ && !unstructured_ && dataset_ != "STRUCTURED_GRID" && dataset_ != "RECTILINEAR_GRID")
      fail("is a {}; {}", dataset_.substr(0, 30), kExpected);
    if (dataset_ == "RECTILINEAR_GRID") piece_.nodes = VtkAxes{};
    if (uniform_) piece_.nodes = VtkUniformNodes{};
  }

  void readPart(const std::string& word) {
    if (word == "dimensions") return readDimensions();
    if (word == "extent") return readExtent();
    if (word == "field") return readField();
    if (word == "metadata") return skipMetadata();
    if (word == "point_data" || word == "cell_data") return beginData(word == "cell_data");
    if (owner_ == Owner::kGrid && unstructured_) return readMeshPart(word);
    if (owner_ == Owner::kGrid) return readNodesPart(word);
    readAttribute(word);
  }

  void readDimensions() {
    std::array<uint64_t, 3> counts{};
    for (uint64_t& n : counts) n = nextCount();
    for (size_t axis = 0; axis < 3; ++axis) {
      if (counts[axis] == 0 || counts[axis] > kMaxAlongAxis)
        fail("has DIMENSIONS {} {} {}; expected three counts of nodes", counts[0], counts[1], counts[2]);
      piece_.extent.lower[axis] = 0;
      piece_.extent.upper[axis] = static_cast<int64_t>(counts[axis]) - 1;
    }
    checkExtent();
  }

  void readExtent() {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double ends[] = {text_.number(), text_.number()};
      const auto most = static_cast<double>(kMaxAlongAxis);
      if (!(std::abs(ends[0]) < most) || !(std::abs(ends[1]) < most) || ends[1] < ends[0])
        fail("has an EXTENT from {} to {}; expected the first and the last node", ends[0], ends[1]);
      piece_.extent.lower[axis] = static_cast<int64_t>(ends[0]);
      piece_.extent.upper[axis] = static_cast<int64_t>(ends[1]);
    }
    checkExtent();
  }

  void checkExtent() {
    double nodes = 1;
    for (size_t axis = 0; axis < 3; ++axis) nodes *= static_cast<double>(piece_.extent.nodesAlong(axis));
    if (nodes > static_cast<double>(kMaxNodes))
      fail("has {} nodes; expected at most {}", nodes, static_cast<double>(kMaxNodes));
    if (has_extent_) fail("has a second DIMENSIONS or EXTENT");
    has_extent_ = true;
  }

  void needExtent(const std::string& word) const {
    if (!has_extent_) fail("has {} before DIMENSIONS", word);
  }

  void readNodesPart(const std::string& word) {
    auto* const axes = std::get_if<VtkAxes>(&piece_.nodes);
    auto* const uniform = std::get_if<VtkUniformNodes>(&piece_.nodes);
    needExtent(word);
    if (word == "points" && !axes && !uniform) {
      const uint64_t nodes = nextCount();
      if (nodes != piece_.extent.nodes())
        fail("has {} POINTS; expected {} (a grid of {} nodes)", nodes, piece_.extent.nodes(),
             piece_.extent.describe());
      piece_.nodes = readNumbers("POINTS", lineOfType(), 3, nodes);
    } else if (axes && word.size() == 13 && word.ends_with("_coordinates") && word[0] >= 'x' &&
               word[0] <= 'z') {
      const auto axis = static_cast<size_t>(word[0] - 'x');
      const uint64_t nodes = nextCount();
      if (nodes != piece_.extent.nodesAlong(axis))
        fail("has {} {}; expected {}", nodes, word, piece_.extent.nodesAlong(axis));
      (*axes)[axis] = readNumbers(word, lineOfType(), 1, nodes);
    } else if (uniform && (word == "origin" || word == "spacing" || word == "aspect_ratio")) {
      for (glm::length_t axis = 0; axis < 3; ++axis) {
        const double value = text_.number();
        if (!std::isfinite(value)) fail("has {} {}", word, value);
        (word == "origin" ? uniform->origin : uniform->spacing)[axis] = value;
      }
    } else if (word == "blanking") {
      const uint64_t nodes = nextCount();
      if (nodes != piece_.extent.nodes())
        fail("has BLANKING of {} nodes; expected {}", nodes, piece_.extent.nodes());
      piece_.visible = readNumbers("BLANKING", lineOfType(), 1, nodes);
    } else {
      fail("found \"{}\"; expected a part of a {}", word.substr(0, 30), dataset_);
    }
  }

  void readMeshPart(const std::string& word) {
    if (word == "points") {
      const uint64_t points = nextCount();
      piece_.nodes = readNumbers("POINTS", lineOfType(), 3, points);
    } else if (polygonal_ &&
               (word == "vertices" || word == "lines" || word == "polygons" || word == "triangle_strips")) {
      readPolygonalCells(word == "lines");
    } else if (word == "cells") {
      const uint64_t first = nextCount(), second = nextCount();
      restOfLine();
      wordFollows("offsets") ? readOffsets(first, second) : readCountedCells(first, second);
    } else if (word == "cell_types") {
      const uint64_t cells = nextCount();
      restOfLine();
      if (cells != cells_.cells)
        fail("has {} CELL_TYPES; expected {}, one for each cell", cells, cells_.cells);
      cells_.types = readNumbers("CELL_TYPES", "int", 1, cells);
    } else {
      fail("found \"{}\"; expected POINTS, CELLS or CELL_TYPES", word.substr(0, 30));
    }
  }

  /// The cells' arrays count all kinds in the file's order; only lines are kept.
  void readPolygonalCells(bool lines) {
    VtkCells kept = std::exchange(cells_, {});
    const uint64_t first = nextCount(), second = nextCount();
    restOfLine();
    wordFollows("offsets") ? readOffsets(first, second) : readCountedCells(first, second);
    if (lines) {
      first_line_ = polygonal_cells_;
      kept = cells_;
    }
    polygonal_cells_ += cells_.cells;
    cells_ = std::move(kept);
  }

  /// Reads the cells as the format has them since version 5: where each cell begins, and the end of the last;
  /// then the points of all.
  void readOffsets(uint64_t offsets, uint64_t points) {
    if (offsets == 0) fail("has CELLS without OFFSETS; expected one more than cells");
    nextWord();
    const VtkArray begins = readNumbers("OFFSETS", lineOfType(), 1, offsets);
    if (nextWord() != "connectivity") fail("has no CONNECTIVITY after its OFFSETS");
    cells_.connectivity = readNumbers("CONNECTIVITY", lineOfType(), 1, points);
    cells_.cells = offsets - 1;
    cells_.ends = begins;
    cells_.ends.tuples = cells_.cells;
    cells_.ends.bytes = std::make_shared<BytesBehind>(begins.bytes, begins.tupleBytes());
    cells_.faces_inline = true;
  }

  /// Reads the cells as the format has them before version 5: of each cell the number of its points, and
  /// these.
  void readCountedCells(uint64_t cells, uint64_t numbers) {
    cells_.connectivity = readNumbers("CELLS", "int", 1, numbers);
    cells_.cells = cells;
    cells_.counted = cells_.faces_inline = true;
    cells_.ends.name = "CELLS";
    cells_.ends.type = VtkType::kUint64;
    cells_.ends.tuples = cells;
    cells_.ends.order = kMachineByteOrder;
    if (cells > numbers)
      fail("declares {} cells but only {} numbers for them; expected at least one for each cell", cells,
           numbers);
    const auto spooled = std::make_shared<SpooledBytes>(
        files_.spool, cells * sizeof(uint64_t), [&](const SpoolFile::Sink& sink) { writeEnds(cells, sink); });
    spooled->fill();
    cells_.ends.bytes = spooled;
  }

  void writeEnds(uint64_t cells, const SpoolFile::Sink& sink) {
    constexpr uint64_t kChunk = 65536;
    std::vector<uint64_t> numbers, ends;
    uint64_t loaded = 0, end = 0;  // numbers are those from `loaded` on
    for (uint64_t cell = 0; cell < cells; ++cell) {
      if (end >= loaded + numbers.size()) {
        loaded = end;
        readIntegers(
            cells_.connectivity, loaded,
            std::min(kChunk, cells_.connectivity.tuples - std::min(loaded, cells_.connectivity.tuples)),
            numbers);
      }
      const uint64_t points = numbers.empty() ? cells_.connectivity.tuples : numbers[end - loaded];
      if (points >= cells_.connectivity.tuples - end)
        fail("CELLS: cell {} has {} points, more than there are numbers; the file is damaged", cell,
             static_cast<int64_t>(points));
      end += points + 1;
      ends.push_back(end);
      if (ends.size() < kChunk && cell + 1 < cells) continue;
      sink(std::as_bytes(std::span(ends)));
      ends.clear();
    }
  }

  void beginData(bool of_cells) {
    if (unstructured_) return beginMeshData(of_cells);
    needExtent("POINT_DATA or CELL_DATA");
    const uint64_t expected = of_cells ? piece_.extent.cells() : piece_.extent.nodes();
    tuples_ = nextCount();
    if (tuples_ != expected)
      fail("has {} {}; expected {} (a grid of {} nodes)", of_cells ? "CELL_DATA" : "POINT_DATA", tuples_,
           expected, piece_.extent.describe());
    owner_ = of_cells ? Owner::kCells : Owner::kPoints;
  }

  void beginMeshData(bool of_cells) {
    const uint64_t all_cells = polygonal_ ? polygonal_cells_ : cells_.cells;
    const uint64_t expected = of_cells ? all_cells : std::get<VtkPoints>(piece_.nodes).tuples;
    tuples_ = nextCount();
    if (tuples_ != expected)
      fail("has {} {}; expected {}", of_cells ? "CELL_DATA" : "POINT_DATA", tuples_, expected);
    owner_ = of_cells ? Owner::kCells : Owner::kPoints;
  }

  void readAttribute(const std::string& word) {
    if (word == "scalars") return readScalars();
    if (word == "color_scalars") return readColours();
    if (word == "lookup_table") return skipLookupTable();
    if (word == "texture_coordinates") {
      const std::string name = nextName();
      const uint64_t components = nextCount();
      return addArray(name, lineOfType(), components);
    }
    struct Attribute {
      const char* word;
      uint64_t components;
    };
    static constexpr Attribute kAttributes[] = {{"vectors", 3},   {"normals", 3},    {"tensors", 9},
                                                {"tensors6", 6},  {"global_ids", 1}, {"pedigree_ids", 1},
                                                {"edge_flags", 1}};
    for (const Attribute& attribute : kAttributes)
      if (word == attribute.word) {
        const std::string name = nextName();
        return addArray(name, lineOfType(), attribute.components);
      }
    fail("found \"{}\"; expected SCALARS, VECTORS, FIELD or another attribute", word.substr(0, 30));
  }

  void readScalars() {
    const std::string name = nextName();
    const std::vector<std::string> words = restOfLine();
    if (words.empty() || words.size() > 2) fail("has SCALARS {} without a type", name);
    if (lookupTableFollows()) text_.line();
    std::string& active = owner_ == Owner::kCells ? piece_.active_cell_data : piece_.active_point_data;
    if (active.empty()) active = name;
    addArray(name, words[0], words.size() == 2 ? count(words[1]) : 1);
  }

  bool lookupTableFollows() { return wordFollows("lookup_table"); }

  void readColours() {
    const std::string name = nextName();
    const std::vector<std::string> words = restOfLine();
    if (words.size() != 1) fail("has COLOR_SCALARS {} without a number of components", name);
    addArray(name, ascii_ ? "float" : "unsigned_char", count(words[0]));
  }

  void skipLookupTable() {
    nextName();
    const uint64_t size = nextCount();
    restOfLine();
    readNumbers("LOOKUP_TABLE", ascii_ ? "float" : "unsigned_char", 4, size);
  }

  /// Arrays with any number of tuples; those with the owner's number become its data.
  void readField() {
    nextName();
    const uint64_t arrays = nextCount();
    restOfLine();
    for (uint64_t n = 0; n < arrays;) {
      const std::string name = nextName();
      if (name == "METADATA") {
        skipMetadata();
        continue;
      }
      ++n;
      if (name == "NULL_ARRAY") continue;
      const uint64_t components = nextCount(), tuples = nextCount();
      const std::string type = lineOfType();
      if (skipIfNotDrawn(name, type, components, tuples)) continue;
      if (owner_ != Owner::kGrid && tuples == tuples_)
        addArray(name, type, components);
      else
        keepTime(readNumbers(name, type, components, tuples));
    }
  }

  void keepTime(const VtkArray& array) {
    if (owner_ != Owner::kGrid || array.tuples * array.components != 1) return;
    if (lowerCase(array.name) != "time" && array.name != "TimeValue") return;
    double time = 0;
    const WantedComponent<double> wanted{0, &time};
    readTuples<double>(array, 0, 1, std::span(&wanted, 1));
    grid_.times = {time};
  }

  /// Skips an array of a type that is not drawn, with a warning if it belongs to nodes or cells. False for all
  /// other types.
  bool skipIfNotDrawn(const std::string& name, const std::string& type, uint64_t components,
                      uint64_t tuples) {
    const std::string type_word = lowerCase(type);
    const bool bits = type_word == "bit";
    if (!bits && type_word != "string" && type_word != "utf8_string") return false;
    bits ? skipBits(name, components, tuples) : skipStrings(components, tuples);
    if (owner_ != Owner::kGrid)
      grid_.warnings.push_back(fmt::format("left out: array {} of the {} has type {}, which is not drawn",
                                           name, owner_ == Owner::kCells ? "cells" : "points", type_word));
    return true;
  }

  void addArray(const std::string& name, const std::string& type, uint64_t components) {
    if (skipIfNotDrawn(name, type, components, tuples_)) return;
    addDataArray(piece_, owner_ == Owner::kCells, readNumbers(name, type, components, tuples_),
                 grid_.warnings);
  }

  void finishNodes() const {
    if (!has_extent_) fail("has no DIMENSIONS");
    const auto* const axes = std::get_if<VtkAxes>(&piece_.nodes);
    if (axes && !std::all_of(axes->begin(), axes->end(), [](const VtkArray& axis) { return axis.bytes; }))
      fail("has no X_COORDINATES, Y_COORDINATES or Z_COORDINATES; the file is truncated");
    if (const auto* const points = std::get_if<VtkPoints>(&piece_.nodes); points && !points->bytes)
      fail("has no POINTS; the file is truncated");
  }

  std::string dataset_;
  bool uniform_ = false, unstructured_ = false, has_extent_ = false;
  bool wants_lines_ = false, polygonal_ = false;
  uint64_t polygonal_cells_ = 0, first_line_ = 0;
  Owner owner_ = Owner::kGrid;
  uint64_t tuples_ = 0;  // number of tuples of the owner's arrays
  VtkPiece piece_;
  VtkCells cells_;
  VtkGrid grid_;
};

}  // namespace

bool isVtkLegacy(const InputFile& file) {
  constexpr std::string_view kMagic = "# vtk datafile";
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kMagic.size())), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  return lowerCase(begin) == kMagic;
}

std::unique_ptr<DataSource> openVtkLegacy(const OpenGridOptions& options) {
  return LegacyReader(VtkFiles(options.temporary_folder), options.grid).read();
}

VtkLines readVtkLegacyLines(const VtkFiles& files, const std::filesystem::path& path) {
  return LegacyReader(files, path).readLines();
}

}  // namespace curvisplat
