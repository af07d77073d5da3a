#include "preprocess/formats/openfoam/foam_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "preprocess/formats/common/ascii_spool.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

// Cells whose faces are sorted in memory by one pass; and the most faces that may lie between faces that are read together.
constexpr uint64_t kCellsAtOnce = 500'000, kMostGap = 512;
constexpr uint64_t kChunk = 65536;

bool hasMesh(const fs::path& folder) {
  return FoamFile::exists(folder / "constant" / "polyMesh" / "faces");
}

fs::path caseOf(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return path;
  return path.parent_path().empty() ? fs::path(".") : path.parent_path();
}

std::vector<fs::path> processorsOf(const fs::path& folder) {
  std::vector<fs::path> processors;
  for (int n = 0; hasMesh(folder / fmt::format("processor{}", n)); ++n)
    processors.push_back(folder / fmt::format("processor{}", n));
  return processors;
}

size_t componentsOf(const std::string& type) {
  if (type == "volScalarField" || type == "volScalarField::Internal") return 1;
  if (type == "volVectorField" || type == "volVectorField::Internal") return 3;
  if (type == "volSymmTensorField") return 6;
  if (type == "volTensorField") return 9;
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

}  // namespace

bool isFoamCase(const fs::path& path) {
  std::error_code error;
  const bool folder = fs::is_directory(path, error);
  const std::string ending = path.extension().string();
  if (!folder && ending != ".foam" && ending != ".OpenFOAM") return false;
  const fs::path of = caseOf(path);
  return hasMesh(of) || !processorsOf(of).empty();
}

FoamSource::FoamSource(const OpenGridOptions& options)
    : spool_(std::make_shared<SpoolFile>(options.temporary_folder)),
      temporary_folder_(options.temporary_folder) {
  const fs::path folder = caseOf(options.grid);
  const std::vector<fs::path> processors = processorsOf(folder);
  const std::vector<fs::path> folders = hasMesh(folder) ? std::vector{folder} : processors;
  pieces_.reserve(folders.size());
  for (const fs::path& of : folders) {
    pieces_.emplace_back();
    pieces_.back().folder = of;
  }
  findTimes(options.time_step, options.grid);
  bool binary = false;
  for (Piece& piece : pieces_) openPiece(piece.folder);
  {
    const FoamFile faces(meshFile(folders.front(), "faces"), spool_, temporary_folder_);
    binary = faces.isBinary();
  }
  findFields();
  description_.coordinate_bytes = 8;
  description_.format =
      fmt::format("OpenFOAM case, {}, {}", binary ? "binary" : "ASCII",
                  hasMesh(folder) ? "1 piece" : fmt::format("{} processors", pieces_.size()));
  values_.resize(pieces_.size(), std::vector<Values>(fields_.size()));
}

void FoamSource::findTimes(std::optional<uint32_t> asked, const fs::path& shown) {
  std::vector<std::pair<double, std::string>> times;
  for (const auto& entry : fs::directory_iterator(pieces_.front().folder)) {
    double time = 0;
    if (entry.is_directory() && parseNumber(entry.path().filename().string(), time))
      times.emplace_back(time, entry.path().filename().string());
  }
  std::sort(times.begin(), times.end());
  for (const auto& [time, name] : times) {
    description_.times.push_back(time);
    time_names_.push_back(name);
  }
  description_.time_step = chosenTimeStep(shown.string(), description_.times, asked);
}

/// A mesh that moves has its points, and one that changes all files, in the folder of the time.
fs::path FoamSource::meshFile(const fs::path& folder, const char* name) const {
  for (size_t step = time_names_.empty() ? 0 : description_.time_step + size_t{1}; step-- > 0;) {
    const fs::path moved = folder / time_names_[step] / "polyMesh" / name;
    if (FoamFile::exists(moved)) return moved;
  }
  return folder / "constant" / "polyMesh" / name;
}

void FoamSource::openPiece(const fs::path& folder) {
  const auto piece =
      std::find_if(pieces_.begin(), pieces_.end(), [&](const Piece& p) { return p.folder == folder; });
  const auto open = [&](const char* name) {
    auto file = std::make_unique<FoamFile>(meshFile(folder, name), spool_, temporary_folder_);
    description_.files.push_back(file->name());
    return file;
  };
  piece->points = open("points")->numbers(3);
  piece->faces = open("faces")->faces();
  const FoamList owner = open("owner")->labels(), neighbour = open("neighbour")->labels();
  const std::string faces_file = description_.files[description_.files.size() - 3];
  const uint64_t faces = piece->faces.begins.count > 0 ? piece->faces.begins.count - 1 : 0;
  if (owner.count != faces || neighbour.count > faces)
    throw Error("{}: has {} faces, but {} have an owner and {} a neighbour; the mesh is damaged", faces_file,
                faces, owner.count, neighbour.count);
  listFacesOfCells(*piece, owner, neighbour);
  description_.pieces.push_back(
      {folder.filename().string(), faces_file, piece->points.count / 3, piece->cells});
}

/// Sorts faces by cell, as many cells at a time as memory holds the faces of.
void FoamSource::listFacesOfCells(Piece& piece, const FoamList& owner, const FoamList& neighbour) {
  uint64_t cells = 0;
  const auto faces = owner.count;
  for (const FoamList* list : {&owner, &neighbour})
    forEachLabel(*list, [&](uint64_t first, const std::vector<uint64_t>& values) {
      for (size_t n = 0; n < values.size(); ++n) {
        // Of a boundary face some versions say -1, in 32 or in 64 bits.
        if (list == &neighbour && values[n] >= 0xffffffff) continue;
        if (values[n] >= faces)
          throw Error(
              "{}: face {} belongs to cell {}, which is more cells than the faces can bound; the mesh is "
              "damaged",
              meshFile(piece.folder, "owner").string(), first + n, static_cast<int64_t>(values[n]));
        cells = std::max(cells, values[n] + 1);
      }
    });
  piece.cells = cells;
  uint64_t total = 0;
  const auto write = [&](const SpoolFile::Sink& to_begins, const SpoolFile::Sink& to_faces) {
    for (uint64_t first_cell = 0; first_cell < cells; first_cell += kCellsAtOnce) {
      const uint64_t count = std::min(kCellsAtOnce, cells - first_cell);
      std::vector<uint64_t> begins(count + 1, 0), sorted;
      const auto forEachFace = [&](const auto& use) {
        for (const FoamList* list : {&owner, &neighbour})
          forEachLabel(*list, [&](uint64_t first, const std::vector<uint64_t>& values) {
            for (size_t n = 0; n < values.size(); ++n)
              if (values[n] >= first_cell && values[n] < first_cell + count)
                use(values[n] - first_cell, first + n);
          });
      };
      forEachFace([&](uint64_t cell, uint64_t) { ++begins[cell + 1]; });
      for (uint64_t cell = 0; cell < count; ++cell) begins[cell + 1] += begins[cell];
      sorted.resize(begins.back());
      std::vector<uint64_t> next(begins.begin(), begins.end() - 1);
      forEachFace([&](uint64_t cell, uint64_t face) { sorted[next[cell]++] = face; });
      for (uint64_t& begin : begins) begin += total;
      to_begins(std::as_bytes(std::span(begins).first(count)));
      total += sorted.size();
      if (!sorted.empty()) to_faces(std::as_bytes(std::span(sorted)));
    }
    to_begins(std::as_bytes(std::span(&total, 1)));
  };
  // One file has one writer at a time.
  piece.cell_begins.spool = std::make_shared<SpoolFile>(temporary_folder_);
  piece.cell_faces.spool = spool_;
  piece.cell_begins.offset = piece.cell_begins.spool->append([&](const SpoolFile::Sink& to_begins) {
    piece.cell_faces.offset =
        spool_->append([&](const SpoolFile::Sink& to_faces) { write(to_begins, to_faces); });
  });
  piece.cell_faces.count = total;
  piece.cell_begins.count = cells + 1;
}

void FoamSource::findFields() {
  if (time_names_.empty()) return;
  const std::string& time = time_names_[description_.time_step];
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(pieces_.front().folder / time)) {
    if (!entry.is_regular_file()) continue;
    fs::path name = entry.path().filename();
    if (name.extension() == ".gz") name = name.stem();
    names.insert(name.string());
  }
  for (const std::string& name : names) {
    const fs::path path = pieces_.front().folder / time / name;
    size_t components = 0;
    try {
      components = componentsOf(FoamFile(path, spool_, temporary_folder_).type());
    } catch (const Error&) {
      // Not a file of OpenFOAM.
    }
    if (components == 0) continue;
    description_.files.push_back(path.string());
    const auto add = [&](const std::string& scalar_name, int component) {
      GridScalar scalar;
      scalar.name = scalar_name;
      scalar.centring = Centring::kCell;
      description_.scalars.push_back(std::move(scalar));
      scalars_.push_back({fields_.size(), component});
    };
    if (components == 1) add(name, 0);
    if (components == 3) add(fmt::format("{}:mag", name), -1);
    for (size_t c = 0; c < components && components > 1; ++c)
      add(components == 3 ? fmt::format("{}:{}", name, "xyz"[c]) : fmt::format("{}:{}", name, c),
          static_cast<int>(c));
    fields_.push_back({name, components});
  }
}

const FoamList& FoamSource::valuesOf(uint32_t number, size_t field, std::vector<double>& uniform) const {
  const MutexLock lock(mutex_);
  Values& values = values_[number][field];
  if (!values.read) {
    const Piece& piece = pieces_[number];
    FoamFile file(piece.folder / time_names_[description_.time_step] / fields_[field].name, spool_,
                  temporary_folder_);
    if (componentsOf(file.type()) != fields_[field].components)
      throw Error("{}: is a {}; expected the kind of field that the other processors have", file.name(),
                  file.type());
    values.uniform = file.beginField(fields_[field].components);
    if (values.uniform.empty()) {
      values.list = file.numbers(fields_[field].components);
      if (values.list.count != piece.cells * fields_[field].components)
        throw Error("{}: has {} values; expected {}, one for each cell", file.name(),
                    values.list.count / fields_[field].components, piece.cells);
    }
    values.read = true;
  }
  uniform = values.uniform;
  return values.list;
}

void FoamSource::readPoints(uint32_t number, uint64_t first, uint64_t count, std::span<const uint32_t>,
                            MeshPoints& out) const {
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(count);
  out.hidden.assign(count, 0);
  out.scalars.clear();
  std::vector<double> points(3 * count);
  pieces_[number].points.read(3 * first, std::span(points));
  for (size_t n = 0; n < count; ++n) {
    out.x[n] = points[3 * n];
    out.y[n] = points[3 * n + 1];
    out.z[n] = points[3 * n + 2];
  }
}

void FoamSource::readCells(uint32_t number, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshCells& out) const {
  const Piece& piece = pieces_[number];
  out.clear();
  std::vector<uint64_t> begins(count + 1);
  piece.cell_begins.read(first, std::span(begins));
  std::vector<uint64_t> faces(begins.back() - begins.front());
  if (!faces.empty()) piece.cell_faces.read(begins.front(), std::span(faces));

  // Where each face begins and its points, in runs of faces that lie close together.
  std::vector<uint64_t> sorted = faces;
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  std::vector<uint64_t> place(sorted.size()), length(sorted.size()), labels, ends;
  for (size_t from = 0; from < sorted.size();) {
    size_t to = from + 1;
    while (to < sorted.size() && sorted[to] - sorted[to - 1] < kMostGap) ++to;
    ends.resize(sorted[to - 1] - sorted[from] + 2);
    piece.faces.begins.read(sorted[from], std::span(ends));
    for (size_t n = 1; n < ends.size(); ++n)
      if (ends[n] < ends[n - 1] || ends[n] > piece.faces.labels.count)
        throw Error("{}: face {} ends before it begins; the mesh is damaged",
                    description_.pieces[number].file, sorted[from] + n - 1);
    const size_t loaded = labels.size();
    labels.resize(loaded + (ends.back() - ends.front()));
    if (labels.size() > loaded) piece.faces.labels.read(ends.front(), std::span(labels).subspan(loaded));
    for (size_t n = from; n < to; ++n) {
      const uint64_t in_run = sorted[n] - sorted[from];
      place[n] = loaded + (ends[in_run] - ends.front());
      length[n] = ends[in_run + 1] - ends[in_run];
    }
    from = to;
  }

  std::vector<uint64_t> stream;
  for (size_t n = 0; n < count; ++n) {
    stream.clear();
    const auto of_cell = std::span(faces).subspan(begins[n] - begins.front(), begins[n + 1] - begins[n]);
    for (const uint64_t face : of_cell) {
      const auto found =
          static_cast<size_t>(std::lower_bound(sorted.begin(), sorted.end(), face) - sorted.begin());
      stream.push_back(length[found]);
      const auto points = std::span(labels).subspan(place[found], length[found]);
      stream.insert(stream.end(), points.begin(), points.end());
    }
    if (!out.appendPolyhedron(of_cell.size(), stream))
      throw Error("{}: cell {} has {} faces, or one with too few points; the mesh is damaged",
                  description_.pieces[number].file, first + n, of_cell.size());
  }

  out.scalars.resize(scalars.size());
  std::vector<double> values, uniform;
  for (size_t n = 0; n < scalars.size(); ++n) {
    const Scalar& scalar = scalars_[scalars[n]];
    const size_t components = fields_[scalar.field].components;
    const FoamList& list = valuesOf(number, scalar.field, uniform);
    values.resize(count * components);
    if (uniform.empty())
      list.read(first * components, std::span(values));
    else
      for (size_t m = 0; m < values.size(); ++m) values[m] = uniform[m % components];
    out.scalars[n].resize(count);
    for (size_t cell = 0; cell < count; ++cell) {
      const double* tuple = values.data() + cell * components;
      out.scalars[n][cell] = static_cast<float>(
          scalar.component < 0 ? std::sqrt(tuple[0] * tuple[0] + tuple[1] * tuple[1] + tuple[2] * tuple[2])
                               : tuple[scalar.component]);
    }
  }
}

}  // namespace curvisplat
