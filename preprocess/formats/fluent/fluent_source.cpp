#include "preprocess/formats/fluent/fluent_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/cells_of_faces.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/hdf5_contents.h"
#include "preprocess/formats/common/library_trial.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMesh = "/meshes/1";
constexpr const char *kCaseEnding = ".cas.h5", *kDataEnding = ".dat.h5";
constexpr uint64_t kAtOnce = 65536;
constexpr double kMaxNumber = 1e14;

/// A section of a list: the rows of `array` are those of the nodes, faces or cells [first, first + count),
/// counted from 0.
struct Section {
  std::shared_ptr<const Hdf5Array> array;
  uint64_t first = 0, count = 0;
};
using Sections = std::vector<Section>;

/// A range [first, end) of nodes, faces or cells, counted from 0.
struct Range {
  uint64_t first = 0, end = 0;
  bool has(uint64_t n) const { return n >= first && n < end; }
};

uint64_t numberIn(const Hdf5Contents& file, const std::string& place, const char* attribute) {
  const double number = file.numbers(place, attribute, 1)[0];
  if (!(number >= 0 && number <= kMaxNumber) || number != std::floor(number))
    file.fail(place, fmt::format("has {} as {}; expected a number; the file is damaged", number, attribute));
  return static_cast<uint64_t>(number);
}

/// Reads the range that the attributes minId and maxId state, counted from 1.
Range rangeOf(const Hdf5Contents& file, const std::string& place) {
  const uint64_t first = numberIn(file, place, "minId"), last = numberIn(file, place, "maxId");
  if (first == 0 || last + 1 < first)
    file.fail(place, fmt::format("has the numbers {} to {}; expected some from 1 on; the file is damaged",
                                 first, last));
  return {first - 1, last};
}

Section sectionOf(const Hdf5Contents& file, const std::string& place, const Range& range) {
  Section section{file.required(place), range.first, range.end - range.first};
  const uint64_t rows = section.array->dims().empty() ? 1 : section.array->dims().front();
  if (rows != section.count)
    file.fail(place, fmt::format("has {} rows; expected {}, as it states; the file is damaged", rows,
                                 section.count));
  return section;
}

/// The data sets of a group as sections, in the order of their numbers.
Sections sectionsIn(const Hdf5Contents& file, const std::string& group) {
  Sections sections;
  for (const std::string& name : file.names(group))
    if (const std::string place = group + '/' + name; file.hasAttribute(place, "minId"))
      sections.push_back(sectionOf(file, place, rangeOf(file, place)));
  std::sort(sections.begin(), sections.end(),
            [](const Section& a, const Section& b) { return a.first < b.first; });
  return sections;
}

/// Calls use(section, first row, rows, offset from `first`) for each section that has some of [first, first +
/// count).
template <typename Use>
void forEachIn(const Sections& sections, uint64_t first, uint64_t count, const Use& use) {
  for (const Section& section : sections) {
    const uint64_t from = std::max(first, section.first),
                   to = std::min(first + count, section.first + section.count);
    if (from < to) use(section, from - section.first, to - from, from - first);
  }
}

/// Calls use(row, number) for each number of a section of one column.
template <typename Use>
void forEachNumber(const Section& section, const Use& use) {
  std::vector<double> some;
  for (uint64_t n = 0; n < section.count; n += some.size()) {
    some.resize(std::min(kAtOnce, section.count - n));
    section.array->read(n, some);
    for (size_t k = 0; k < some.size(); ++k) use(n + k, some[k]);
  }
}

uint64_t componentsOf(const Section& section) {
  return section.count == 0 ? 1 : section.array->size() / section.count;
}

/// The file whose name ends in `to` where that of `path` ends in `from`, which leads from a case to its data
/// and back; empty if there is none.
fs::path otherFileOf(const fs::path& path, std::string_view from, std::string_view to) {
  std::string name = path.string();
  if (!name.ends_with(from)) return {};
  name.replace(name.size() - from.size(), from.size(), to);
  return isRegularFile(name) ? fs::path(name) : fs::path();
}

class FluentSource final : public ElementSource {
 public:
  explicit FluentSource(const OpenGridOptions& options);

 private:
  struct Scalar {
    size_t field = 0;
    int component = 0;
  };

  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override;
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override;
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override;
  void openFaces();
  void sortFaces();
  void noteZones();
  void openData(const fs::path& path);
  void addField(const std::string& name, Sections sections);
  void readTime();
  std::vector<Range> parentsIn(const std::string& group) const;
  std::vector<Range> interfaceFaces() const;
  std::string at(const char* place) const { return std::string(kMesh) + place; }

  const Hdf5Contents file_;
  std::optional<Hdf5Contents> data_;
  ListSpools spools_;
  uint64_t points_ = 0, faces_ = 0, cells_ = 0;
  Sections coordinates_, sides_;
  SpooledNumbers begins_;   // of each face, and the end of the last
  SpooledNumbers corners_;  // of all faces, one after another
  CellFaces cell_faces_;
  std::vector<Range> parents_;  // cells that are divided
  std::vector<Sections> fields_;
  std::vector<Scalar> scalars_;  // [description_.scalars]
};

FluentSource::FluentSource(const OpenGridOptions& options)
    : file_(options.grid), spools_(options.temporary_folder) {
  const std::string& name = options.grid.string();
  if (!file_.has(kMesh)) file_.fail(kMesh, "is missing; expected the mesh of a Fluent case");
  if (const uint64_t dimension = numberIn(file_, kMesh, "dimension"); dimension != 3)
    throw Error("{}: is a Fluent case of {} dimensions; expected 3", name, dimension);
  points_ = numberIn(file_, kMesh, "nodeCount");
  faces_ = numberIn(file_, kMesh, "faceCount");
  cells_ = numberIn(file_, kMesh, "cellCount");
  if (cells_ > faces_)
    file_.fail(kMesh, fmt::format("has {} cells, more than its {} faces can bound; the file is damaged",
                                  cells_, faces_));
  coordinates_ = sectionsIn(file_, at("/nodes/coords"));
  uint64_t stored = 0;
  for (const Section& section : coordinates_) {
    if (componentsOf(section) != 3)
      file_.fail(section.array->where(), "has other rows than of 3 coordinates");
    stored += section.count;
    description_.coordinate_bytes = static_cast<int>(section.array->bytes());
  }
  if (stored != points_)
    file_.fail(at("/nodes/coords"),
               fmt::format("has {} nodes; expected {}; the file is damaged", stored, points_));
  openFaces();
  sortFaces();
  noteZones();
  description_.files = {name};
  description_.pieces.push_back({"mesh", name, points_, cells_});
  description_.format = "Fluent case";
  if (options.solutions.size() > 1)
    throw Error(
        "{}: has {} data files of one instant; give one, or several whose names differ in numbers as a "
        "series",
        name, options.solutions.size());
  const fs::path data = options.solutions.empty() ? otherFileOf(options.grid, kCaseEnding, kDataEnding)
                                                  : options.solutions.front();
  if (!data.empty()) openData(data);
}

/// Spools the corners of the faces, and where each face begins: each pass over the cells reads corners in many
/// pieces, and HDF5 would unpack a whole chunk for each of them.
void FluentSource::openFaces() {
  const std::string group = at("/faces/nodes");
  std::vector<std::pair<Range, std::string>> sections;
  for (const std::string& name : file_.names(group))
    if (const std::string place = group + '/' + name; file_.has(place + "/nnodes"))
      sections.emplace_back(rangeOf(file_, place), place);
  std::sort(sections.begin(), sections.end(),
            [](const auto& a, const auto& b) { return a.first.first < b.first.first; });
  NumberSpool<uint64_t> begins(spools_.begins), all_corners(spools_.items);
  uint64_t next = 0, corners = 0;
  for (const auto& section : sections) {
    const Range& range = section.first;
    const std::string& place = section.second;
    if (range.first != next)
      file_.fail(place, fmt::format("begins with face {}; expected {}; the file is damaged", range.first + 1,
                                    next + 1));
    next = range.end;
    const Section counts = sectionOf(file_, place + "/nnodes", range);
    const uint64_t before = corners;
    forEachNumber(counts, [&](uint64_t, double count) {
      if (!(count >= 0 && count <= kMaxNumber))
        file_.fail(place + "/nnodes", fmt::format("has {}; expected a count", count));
      begins.add(corners);
      corners += static_cast<uint64_t>(count);
    });
    const Section list{file_.required(place + "/nodes"), before, corners - before};
    if (list.array->size() != list.count)
      file_.fail(place + "/nodes", fmt::format("has {} nodes; expected {}; the file is damaged",
                                               list.array->size(), list.count));
    forEachNumber(list, [&](uint64_t, double point) { all_corners.add(pointNumber(point, 1)); });
  }
  if (next != faces_)
    file_.fail(group, fmt::format("has {} faces; expected {}; the file is damaged", next, faces_));
  begins.add(corners);
  begins_ = begins.finish();
  corners_ = all_corners.finish();
}

/// The numbers of faces or of cells that adaption has divided into others.
std::vector<Range> FluentSource::parentsIn(const std::string& group) const {
  std::vector<Range> parents;
  for (const std::string& name : file_.names(group))
    if (const std::string place = group + '/' + name; file_.hasAttribute(place, "minId"))
      parents.push_back(rangeOf(file_, place));
  return parents;
}

/// The faces that Fluent makes where those on the two sides of an interface overlap. The cells are closed
/// without them.
std::vector<Range> FluentSource::interfaceFaces() const {
  const std::string group = at("/faces/interface"), table = group + "/nciTopology";
  std::vector<Range> made;
  if (!file_.has(table)) return made;
  const uint64_t columns = numberIn(file_, group, "nData"), zones = numberIn(file_, group, "nZones");
  if (columns < 3 || zones > kAtOnce)
    file_.fail(table, "has no first and last face of each zone; the file is damaged");
  for (uint64_t zone = 0; zone < zones; ++zone) {
    const std::vector<uint64_t> row = file_.counts(table, zone * columns, 3);
    if (row[1] > 0) made.push_back({row[1] - 1, row[2]});
  }
  return made;
}

/// Lists the faces of each cell.
void FluentSource::sortFaces() {
  parents_ = parentsIn(at("/cells/tree"));
  std::vector<Range> left_out = parentsIn(at("/faces/tree"));
  for (const Range& range : interfaceFaces()) left_out.push_back(range);
  for (const char* side : {"/faces/c0", "/faces/c1"})
    for (Section& section : sectionsIn(file_, at(side))) sides_.push_back(std::move(section));
  cell_faces_ = sortFacesByCell(
      cells_,
      [&](const auto& use) {
        for (const Section& section : sides_)
          forEachNumber(section, [&](uint64_t row, double cell) {
            const uint64_t face = section.first + row;
            if (cell == 0) return;  // outside
            if (!(cell >= 1 && cell <= static_cast<double>(cells_)) || face >= faces_)
              throw Error("{}: face {} belongs to cell {}; expected up to {}; the file is damaged",
                          section.array->where(), face + 1, cell, cells_);
            const auto has = [&](const Range& range) { return range.has(face); };
            if (std::none_of(left_out.begin(), left_out.end(), has))
              use(face, static_cast<uint64_t>(cell) - 1);
          });
      },
      spools_);
}

/// Lists the zones. Their names are one text, separated by semicolons.
void FluentSource::noteZones() {
  for (const char* kind : {"cells", "faces"}) {
    std::string names = file_.textOf(fmt::format("{}/{}/zoneTopology/name", kMesh, kind));
    for (size_t at = names.find(';'); at != std::string::npos; at = names.find(';', at + 2))
      names.replace(at, 1, ", ");
    if (!names.empty()) description_.notes.push_back(fmt::format("zones of {}: {}", kind, names));
  }
  if (!parents_.empty())
    description_.notes.push_back("cells that were divided by adaption are drawn by their parts");
  if (file_.has("/special/Overset_DCI"))
    description_.warnings.push_back(
        "the case is an overset mesh, whose components are drawn with all of their cells");
}

void FluentSource::openData(const fs::path& path) {
  requireWholeHdf5(InputFile(path));
  data_.emplace(path);
  description_.files.push_back(path.string());
  description_.format += " and data";
  bool found = false;
  const std::string results = "/results/1";
  for (const std::string& phase : data_->names(results)) {
    if (!phase.starts_with("phase-")) continue;
    const std::string cells = fmt::format("{}/{}/cells", results, phase);
    for (const std::string& field : data_->names(cells)) {
      if (field == "fields") continue;
      Sections sections = sectionsIn(*data_, cells + '/' + field);
      found = true;
      if (!sections.empty())
        addField(phase == "phase-1" ? field : fmt::format("{}:{}", phase, field), std::move(sections));
    }
  }
  if (!found) data_->fail(results, "has no values in cells; expected the data of a Fluent case (.dat.h5)");
  readTime();
}

void FluentSource::addField(const std::string& name, Sections sections) {
  const uint64_t components = componentsOf(sections.front());
  for (const Section& section : sections) {
    if (section.first + section.count > cells_)
      throw Error("{}: has values up to cell {}; expected up to {}: it belongs to another mesh",
                  section.array->where(), section.first + section.count, cells_);
    if (componentsOf(section) != components || components == 0 || components > 9) {
      description_.warnings.push_back(
          fmt::format("{} has no one, three or nine components; it is left out", name));
      return;
    }
  }
  // Further names for Fluent's. SV_P has none: it is the pressure above the operating pressure of the case.
  static const std::map<std::string, std::string> kAliases = {{"SV_U", "velocityx"},
                                                              {"SV_V", "velocityy"},
                                                              {"SV_W", "velocityz"},
                                                              {"SV_DENSITY", "density"},
                                                              {"SV_T", "temperature"}};
  ScalarList list(description_);
  forEachComponent(components, [&](const std::string& suffix, int component) {
    GridScalar& scalar = list.add({name + suffix}, Centring::kCell);
    if (const auto alias = kAliases.find(name); alias != kAliases.end())
      scalar.aliases.push_back(alias->second);
    scalars_.push_back({fields_.size(), component});
  });
  fields_.push_back(std::move(sections));
}

/// The time of a transient run, which is a variable in Fluent's own language: (flow-time 0.25).
void FluentSource::readTime() {
  constexpr std::string_view kTime = "(flow-time ";
  const std::string variables = data_->textOf("/settings/Data Variables");
  const size_t begin = variables.find(kTime);
  if (begin == std::string::npos) return;
  const std::string_view text = std::string_view(variables).substr(begin + kTime.size());
  double time = 0;
  if (parseNumber(trimmed(text.substr(0, text.find(')'))), time) && std::isfinite(time) && time != 0)
    description_.times = {time};
}

void FluentSource::readPlaces(uint32_t, uint64_t first, uint64_t count, const Places& to) const {
  std::vector<double> rows;
  forEachIn(coordinates_, first, count,
            [&](const Section& section, uint64_t row, uint64_t some, uint64_t place) {
              rows.resize(3 * some);
              section.array->read(3 * row, rows);
              for (size_t n = 0; n < rows.size(); ++n) to.axes[n % 3][place + n / 3] = rows[n];
            });
}

void FluentSource::appendCells(uint32_t, uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> begins(count + 1);
  cell_faces_.begins.read(first, std::span(begins));
  std::vector<uint64_t> faces(begins.back() - begins.front());
  cell_faces_.faces.read(begins.front(), std::span(faces));
  const FaceLists lists{[&](uint64_t from, std::span<uint64_t> to) { begins_.read(from, to); },
                        [&](uint64_t from, std::span<uint64_t> to) { corners_.read(from, to); }, faces_,
                        corners_.count};
  // Divided cells have no faces of their own, and are cells of no kind; the cells between them are added in
  // runs.
  for (uint64_t n = 0; n < count;) {
    const auto divided = [&](uint64_t cell) {
      return std::any_of(parents_.begin(), parents_.end(),
                         [&](const Range& range) { return range.has(cell); });
    };
    uint64_t end = n;
    while (end < count && !divided(first + end)) ++end;
    if (end > n)
      appendCellsOfFaces(lists,
                         {std::span(begins).subspan(n, end - n + 1),
                          std::span(faces).subspan(begins[n] - begins[0], begins[end] - begins[n]),
                          description_.pieces[0].file, first + n},
                         out);
    for (n = end; n < count && divided(first + n); ++n) out.append(CellKind::kNone, {});
  }
}

void FluentSource::readValues(uint32_t, uint32_t scalar, uint64_t first, std::span<float> to) const {
  const auto [field, component] = scalars_[scalar];
  forEachIn(fields_[field], first, to.size(),
            [&, component = component](const Section& section, uint64_t row, uint64_t some, uint64_t place) {
              const uint64_t components = componentsOf(section);
              std::vector<double> rows(some * components);
              section.array->read(row * components, rows);
              for (size_t n = 0; n < some; ++n) {
                const std::span<const double> tuple = std::span(rows).subspan(n * components, components);
                double value = 0;
                if (component != kMagnitude) {
                  value = tuple[static_cast<size_t>(component)];
                } else {
                  for (const double one : tuple) value += one * one;
                  value = std::sqrt(value);
                }
                to[place + n] = convertedTo<float>(value);
              }
            });
}

}  // namespace

bool isFluentHdf5(const InputFile& file) {
  const std::set<std::string> links = rootLinksOf(file, {"settings", "meshes", "results"});
  return links.contains("settings") && links.size() > 1;
}

std::unique_ptr<DataSource> openFluent(const OpenGridOptions& options) {
  OpenGridOptions files = options;
  if (files.solutions.empty() && !otherFileOf(files.grid, kDataEnding, kCaseEnding).empty()) {
    files.solutions = {files.grid};
    files.grid = otherFileOf(files.grid, kDataEnding, kCaseEnding);
  } else if (!Hdf5Contents(files.grid).has(kMesh)) {
    throw Error("{}: is the data of a Fluent case; give the case first (NAME{} {})", files.grid.string(),
                kCaseEnding, files.grid.filename().string());
  }
  return std::make_unique<FluentSource>(files);
}

}  // namespace curvisplat
