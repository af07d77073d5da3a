#include "preprocess/formats/openfoam/foam_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/cells_of_faces.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/openfoam/foam_case.h"
#include "preprocess/formats/openfoam/foam_file.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kChunk = 65536;

/// 0: a field of another kind. Before version 5 one without boundaries is a DimensionedInternalField.
size_t componentsOf(const std::string& type) {
  const size_t end = std::min(type.find("::"), type.size());
  const std::string field = type.substr(0, end), part = type.substr(end);
  if (!part.empty() && part != "::Internal" && part != "::DimensionedInternalField") return 0;
  if (field == "volScalarField" || field == "volSphericalTensorField") return 1;
  if (field == "volVectorField") return 3;
  if (field == "volSymmTensorField") return 6;
  if (field == "volTensorField") return 9;
  return 0;
}

/// Calls use(begin, values) for all numbers of a list, some at a time.
template <typename Use>
void forEachLabel(const FoamList& list, const Use& use) {
  std::vector<uint64_t> values;
  for (uint64_t first = 0; first < list.count; first += kChunk) {
    values.resize(std::min(kChunk, list.count - first));
    list.read(first, std::span(values));
    use(first, values);
  }
}

class FoamSource final : public ElementSource {
 public:
  explicit FoamSource(const OpenGridOptions& options);

 private:
  struct Piece {
    std::filesystem::path folder;  // the case's, a processor's, or that of several (collated)
    uint32_t processor = 0;        // its part of the files of several
    std::string region;            // empty: the case has none
    FoamList points;               // 3 numbers each
    FoamFile::Faces faces;
    CellFaces cells;
  };
  struct Field {
    std::string name;
    size_t components = 1;
  };
  struct Scalar {
    size_t field = 0;
    int component = 0;  // or kMagnitude
  };

  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override;
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override;
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override;
  void choosePieces(const std::filesystem::path& folder);
  void chooseRegions(const std::string& asked);
  void findTimes(std::optional<uint32_t> asked, const std::filesystem::path& shown);
  std::filesystem::path meshFile(const Piece& piece, const char* name) const;
  FoamFile open(const Piece& piece, const std::filesystem::path& path) const {
    return FoamFile(path, spools_, temporary_folder_, piece.processor);
  }
  void openPiece(Piece& piece);
  void listFacesOfCells(Piece& piece, const FoamList& owner, const FoamList& neighbour);
  std::map<std::string, std::vector<std::filesystem::path>> filesAt(const std::string& time) const;
  void findFields();
  void warnOfLaterFields();
  void requireOneForEachCell(const FoamFile& file, const std::filesystem::path& path, uint64_t count) const;
  std::filesystem::path valuesFolderOf(const Piece& piece) const {
    // Without a region the path has no slash at its end.
    const std::filesystem::path folder = piece.folder / time_names_[description_.time_step];
    return piece.region.empty() ? folder : folder / piece.region;
  }
  void addField(const std::string& name, size_t components);
  const FoamList& valuesOf(uint32_t piece, size_t field, std::vector<double>& uniform) const;

  ListSpools spools_;
  std::filesystem::path temporary_folder_;
  std::vector<std::string> time_names_;
  std::vector<Piece> pieces_;
  bool decomposed_ = false;
  std::vector<Field> fields_;
  std::vector<Scalar> scalars_;  // [description_.scalars]
  /// The values of a field in a piece, once they have been read.
  struct Values {
    bool read = false;
    FoamList list;
    std::vector<double> uniform;
  };
  mutable Mutex mutex_;
  mutable std::vector<std::vector<Values>> values_ GUARDED_BY(mutex_);  // [piece][field]
};

FoamSource::FoamSource(const OpenGridOptions& options)
    : spools_(options.temporary_folder), temporary_folder_(options.temporary_folder) {
  choosePieces(foamCaseOf(options.grid).folder);
  chooseRegions(foamCaseOf(options.grid).region);
  findTimes(options.time_step, options.grid);
  for (Piece& piece : pieces_) openPiece(piece);
  const bool binary = open(pieces_.front(), meshFile(pieces_.front(), "faces")).isBinary();
  values_.resize(pieces_.size());
  findFields();
  description_.coordinate_bytes = 8;
  description_.format = fmt::format(
      "OpenFOAM case, {}, {}", binary ? "binary" : "ASCII",
      decomposed_ ? pieces_.size() == 1 ? "1 processor" : fmt::format("{} processors", pieces_.size())
                  : "1 piece");
}

void FoamSource::choosePieces(const fs::path& folder) {
  const std::vector<FoamProcessor> processors = foamProcessorsOf(folder);
  decomposed_ = !hasFoamMesh(folder);
  if (!decomposed_ && !processors.empty()) {
    const auto whole = foamTimesIn(folder), parts = foamTimesIn(processors.front().folder);
    decomposed_ = !parts.empty() && (whole.empty() || parts.back().first > whole.back().first);
    if (decomposed_)
      description_.notes.push_back(fmt::format(
          "{}: the times of its processors are read, up to {}; {} (reconstructPar writes them there)",
          folder.string(), parts.back().second,
          whole.empty() ? "its own folder has none"
                        : "those in its own folder end at " + whole.back().second));
    else if (parts.size() > whole.size())
      description_.notes.push_back(
          fmt::format("{}: the {} times in its own folder are read; its processors have {} (reconstructPar "
                      "writes them there)",
                      folder.string(), whole.size(), parts.size()));
  }
  if (!decomposed_) {
    pieces_.emplace_back().folder = folder;
    return;
  }
  requireAllProcessors(processors);
  for (const FoamProcessor& processor : processors) {
    Piece& piece = pieces_.emplace_back();
    piece.folder = processor.folder;
    piece.processor = processor.part;
  }
}

/// Pieces of a region are its own; without a region of that name, those of all regions. A mesh outside of regions is read alone.
void FoamSource::chooseRegions(const std::string& asked) {
  const std::vector<Piece> folders = std::exchange(pieces_, {});
  for (const Piece& of : folders) {
    const std::vector<std::string> regions = foamRegionsIn(of.folder);
    const bool whole = asked.empty() && hasFoamMesh(of.folder, "");
    if (whole) pieces_.push_back(of);
    for (const std::string& region : regions)
      if (asked == region || (asked.empty() && !whole)) pieces_.emplace_back(of).region = region;
    if (&of != &folders.front()) continue;
    const std::vector<std::string> lacking =
        asked.empty() ? foamMeshesWithoutFaces(of.folder) : std::vector<std::string>{};
    if (!lacking.empty())
      description_.warnings.push_back(
          fmt::format("the file 'faces' is missing in {}: what lies there is left out", listed(lacking)));
    if (regions.empty()) continue;
    const std::string how =
        decomposed_
            ? "reconstructPar -allRegions, and then the folder constant/REGION, gives one of them"
            : fmt::format("{} gives one of them", (of.folder / "constant" / regions.front()).string());
    if (whole)
      description_.warnings.push_back(fmt::format(
          "the regions {} have meshes of their own, which are not read: {}", listed(regions), how));
    else if (asked.empty() && regions.size() > 1)
      description_.notes.push_back(fmt::format("the regions {} are read together: {}", listed(regions), how));
  }
}

void FoamSource::findTimes(std::optional<uint32_t> asked, const fs::path& shown) {
  for (const auto& [time, name] : foamTimesIn(pieces_.front().folder)) {
    description_.times.push_back(time);
    time_names_.push_back(name);
  }
  description_.time_step = chosenTimeStep(shown.string(), description_.times, asked);
}

/// A mesh that moves has its points, and one that changes all files, in the folder of the time.
fs::path FoamSource::meshFile(const Piece& piece, const char* name) const {
  for (size_t step = time_names_.empty() ? 0 : description_.time_step + size_t{1}; step-- > 0;) {
    const fs::path moved = piece.folder / time_names_[step] / piece.region / "polyMesh";
    if (isThere(moved) && FoamFile::exists(moved / name)) return moved / name;
  }
  return piece.folder / "constant" / piece.region / "polyMesh" / name;
}

void FoamSource::openPiece(Piece& piece) {
  const auto openMesh = [&](const char* name) {
    FoamFile file = open(piece, meshFile(piece, name));
    if (piece.processor == 0) description_.files.push_back(file.name());
    return file;
  };
  piece.points = openMesh("points").numbers(3);
  piece.faces = openMesh("faces").faces();
  const FoamList owner = openMesh("owner").labels(), neighbour = openMesh("neighbour").labels();
  const std::string faces_file = meshFile(piece, "faces").string();
  const uint64_t faces = piece.faces.begins.count > 0 ? piece.faces.begins.count - 1 : 0;
  if (owner.count != faces || neighbour.count > faces)
    throw Error("{}: has {} faces, but {} have an owner and {} a neighbour; the mesh is damaged", faces_file,
                faces, owner.count, neighbour.count);
  listFacesOfCells(piece, owner, neighbour);
  std::string name = piece.folder.filename().string();
  if (name.starts_with("processors")) name = fmt::format("{}, part {}", name, piece.processor);
  if (!piece.region.empty()) name = decomposed_ ? fmt::format("{}, {}", piece.region, name) : piece.region;
  description_.pieces.push_back({std::move(name), faces_file, piece.points.count / 3, piece.cells.cells});
}

/// Counts the cells and lists the faces of each.
void FoamSource::listFacesOfCells(Piece& piece, const FoamList& owner, const FoamList& neighbour) {
  uint64_t cells = 0;
  const auto faces = owner.count;
  for (const FoamList* list : {&owner, &neighbour})
    forEachLabel(*list, [&](uint64_t first, const std::vector<uint64_t>& values) {
      for (size_t n = 0; n < values.size(); ++n) {
        // Some versions give a boundary face the neighbour -1, in 32 or in 64 bits.
        if (list == &neighbour && values[n] >= 0xffffffff) continue;
        if (values[n] >= faces)
          throw Error(
              "{}: face {} belongs to cell {}, which is more cells than the faces can bound; the mesh is "
              "damaged",
              meshFile(piece, "owner").string(), first + n, static_cast<int64_t>(values[n]));
        cells = std::max(cells, values[n] + 1);
      }
    });
  piece.cells = sortFacesByCell(
      cells,
      [&](const auto& use) {
        for (const FoamList* list : {&owner, &neighbour})
          forEachLabel(*list, [&](uint64_t first, const std::vector<uint64_t>& values) {
            for (size_t n = 0; n < values.size(); ++n)
              if (values[n] < cells) use(first + n, values[n]);
          });
      },
      spools_);
}

/// The regions' files of a time, by the names of fields, in the order of the names.
std::map<std::string, std::vector<fs::path>> FoamSource::filesAt(const std::string& time) const {
  std::map<std::string, std::vector<fs::path>> files;
  for (const Piece& piece : pieces_) {
    if (piece.folder != pieces_.front().folder || piece.processor != pieces_.front().processor) continue;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(piece.folder / time / piece.region, error)) {
      std::error_code unknown;  // what cannot be looked at is named when it is opened
      const fs::file_status status = entry.status(unknown);
      if (fs::exists(status) && !fs::is_regular_file(status)) continue;
      fs::path name = entry.path().filename();
      if (name.extension() == ".gz") name = name.stem();
      files[name.string()].push_back(piece.folder / time / piece.region / name);
    }
  }
  return files;
}

void FoamSource::findFields() {
  if (time_names_.empty()) return;
  for (const auto& [name, paths] : filesAt(time_names_[description_.time_step])) {
    const fs::path& path = paths.front();
    std::optional<FoamFile> file;
    try {
      if (!FoamFile::exists(path)) continue;
      const InputFile readable(FoamFile::pathOf(path));
    } catch (const Error& error) {
      description_.warnings.push_back(fmt::format("{}; {} is left out", error.what(), name));
      continue;
    }
    try {
      file.emplace(open(pieces_.front(), path));
    } catch (const Error&) {
      continue;  // Not a file of OpenFOAM.
    }
    const size_t components = componentsOf(file->type());
    if (components == 0) continue;
    // Initial values may be expressions, and a field may be that of another mesh. Such a field is left out, and the others are read.
    try {
      const bool uniform = !file->beginField(components).empty();
      if (!uniform) requireOneForEachCell(*file, path, file->readCount());
    } catch (const Error& error) {
      description_.warnings.push_back(fmt::format("{}; {} is left out", error.what(), name));
      continue;
    }
    description_.files.push_back(file->name());
    addField(name, components);
    const auto regions = static_cast<size_t>(std::ranges::count_if(pieces_, [&](const Piece& piece) {
      return piece.folder == pieces_.front().folder && piece.processor == pieces_.front().processor;
    }));
    if (paths.size() < regions)
      description_.warnings.push_back(fmt::format("{} of {} regions have no {}; they are not drawn with it",
                                                  regions - paths.size(), regions, name));
  }
  warnOfLaterFields();
}

/// Throws unless the file, one of the regions' files of the first processor, has `count` cells' values.
void FoamSource::requireOneForEachCell(const FoamFile& file, const fs::path& path, uint64_t count) const {
  for (const Piece& piece : pieces_) {
    const bool first = piece.folder == pieces_.front().folder && piece.processor == pieces_.front().processor;
    if (!first || path.parent_path() != valuesFolderOf(piece)) continue;
    if (count != piece.cells.cells)
      throw Error("{}: has {} values; expected {}, one for each cell", file.name(), count, piece.cells.cells);
  }
}

/// Names the fields that are read at a later time alone: those that a run writes besides (yPlus, UMean), and those that the first time
/// gives as expressions.
void FoamSource::warnOfLaterFields() {
  std::set<std::string> seen;
  for (const Field& field : fields_) seen.insert(field.name);
  std::map<size_t, std::vector<std::string>> later;  // [step]
  for (size_t step = description_.time_step + size_t{1}; step < time_names_.size(); ++step)
    for (const auto& [name, paths] : filesAt(time_names_[step])) {
      if (!seen.insert(name).second) continue;
      try {
        if (componentsOf(open(pieces_.front(), paths.front()).type()) > 0) later[step].push_back(name);
      } catch (const Error&) {
        continue;  // Not a file of OpenFOAM.
      }
    }
  for (const auto& [step, names] : later)
    description_.warnings.push_back(
        fmt::format("{} {} read from time {} on, not at time {}: convert with --time-step {}, or with "
                    "--steps {}:{} for a series",
                    listed(names), names.size() == 1 ? "is" : "are", time_names_[step],
                    time_names_[description_.time_step], step, step, time_names_.size() - 1));
}

void FoamSource::addField(const std::string& name, size_t components) {
  ScalarList list(description_);
  forEachComponent(components, [&](const std::string& suffix, int component) {
    list.add({name + suffix}, Centring::kCell);
    scalars_.push_back({fields_.size(), component});
  });
  fields_.push_back({name, components});
  const MutexLock lock(mutex_);
  for (std::vector<Values>& of_piece : values_) of_piece.resize(fields_.size());
}

const FoamList& FoamSource::valuesOf(uint32_t piece_number, size_t field,
                                     std::vector<double>& uniform) const {
  const MutexLock lock(mutex_);
  Values& values = values_[piece_number][field];
  if (!values.read) {
    const Piece& piece = pieces_[piece_number];
    const fs::path path = valuesFolderOf(piece) / fields_[field].name;
    if (!piece.region.empty() && !FoamFile::exists(path)) {  // another region's
      values.uniform.assign(fields_[field].components, std::numeric_limits<double>::quiet_NaN());
      values.read = true;
      uniform = values.uniform;
      return values.list;
    }
    FoamFile file = open(piece, path);
    if (componentsOf(file.type()) != fields_[field].components)
      throw Error("{}: is a {}; expected the kind of field that the other processors have", file.name(),
                  file.type());
    values.uniform = file.beginField(fields_[field].components);
    if (values.uniform.empty()) {
      values.list = file.numbers(fields_[field].components);
      if (values.list.count != piece.cells.cells * fields_[field].components)
        throw Error("{}: has {} values; expected {}, one for each cell", file.name(),
                    values.list.count / fields_[field].components, piece.cells.cells);
    }
    values.read = true;
  }
  uniform = values.uniform;
  return values.list;
}

void FoamSource::readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const {
  std::vector<double> points(3 * count);
  pieces_[piece].points.read(3 * first, std::span(points));
  for (size_t n = 0; n < points.size(); ++n) to.axes[n % 3][n / 3] = points[n];
}

void FoamSource::appendCells(uint32_t piece_number, uint64_t first, uint64_t count, MeshCells& out) const {
  const Piece& piece = pieces_[piece_number];
  std::vector<uint64_t> begins(count + 1);
  piece.cells.begins.read(first, std::span(begins));
  std::vector<uint64_t> faces(begins.back() - begins.front());
  piece.cells.faces.read(begins.front(), std::span(faces));
  const FoamList &face_begins = piece.faces.begins, &labels = piece.faces.labels;
  const FaceLists lists{[&](uint64_t from, std::span<uint64_t> to) { face_begins.read(from, to); },
                        [&](uint64_t from, std::span<uint64_t> to) { labels.read(from, to); },
                        face_begins.count > 0 ? face_begins.count - 1 : 0, labels.count};
  appendCellsOfFaces(lists, {begins, faces, description_.pieces[piece_number].file, first}, out);
}

void FoamSource::readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const {
  const auto [field, component] = scalars_[scalar];
  const size_t components = fields_[field].components;
  std::vector<double> uniform, values(to.size() * components);
  const FoamList& list = valuesOf(piece, field, uniform);
  if (uniform.empty())
    list.read(first * components, std::span(values));
  else
    for (size_t n = 0; n < values.size(); ++n) values[n] = uniform[n % components];
  for (size_t cell = 0; cell < to.size(); ++cell) {
    const double* tuple = values.data() + cell * components;
    to[cell] = convertedTo<float>(
        component == kMagnitude ? std::sqrt(tuple[0] * tuple[0] + tuple[1] * tuple[1] + tuple[2] * tuple[2])
                                : tuple[component]);
  }
}

}  // namespace

bool isFoamCase(const fs::path& path) {
  std::error_code error;
  const bool folder = fs::is_directory(path, error);
  const std::string ending = path.extension().string();
  if (!folder && ending != ".foam" && ending != ".OpenFOAM") return false;
  const fs::path of = foamCaseOf(path).folder;
  return hasFoamMesh(of) || !foamProcessorsOf(of).empty();
}

std::unique_ptr<DataSource> openFoam(const OpenGridOptions& options) {
  return std::make_unique<FoamSource>(options);
}

}  // namespace curvisplat
