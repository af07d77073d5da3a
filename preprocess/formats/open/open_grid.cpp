#include "preprocess/formats/open/open_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_source.h"
#include "preprocess/formats/columns/columns_source.h"
#include "preprocess/formats/common/cut_source.h"
#include "preprocess/formats/common/temporary_folder.h"
#include "preprocess/formats/ensight/ensight_case.h"
#include "preprocess/formats/ensight/ensight_source.h"
#include "preprocess/formats/exodus/exodus_source.h"
#include "preprocess/formats/fluent/fluent_source.h"
#include "preprocess/formats/gmsh/gmsh_source.h"
#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/formats/netcdf/open_netcdf.h"
#include "preprocess/formats/netcdf/zarr_file.h"
#include "preprocess/formats/open/combined_source.h"
#include "preprocess/formats/open/foreign_formats.h"
#include "preprocess/formats/open/indirect_files.h"
#include "preprocess/formats/openfoam/foam_source.h"
#include "preprocess/formats/plot3d/plot3d_source.h"
#include "preprocess/formats/su2/su2_source.h"
#include "preprocess/formats/tecplot/tecplot_source.h"
#include "preprocess/formats/vtk/vtk_hdf.h"
#include "preprocess/formats/vtk/vtk_legacy.h"
#include "preprocess/formats/vtk/vtk_xml.h"
#include "preprocess/formats/xdmf/xdmf_file.h"
#include "preprocess/formats/xdmf/xdmf_source.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// ---- formats that are read ----

/// A file format with a signature. A file that none of them recognises is read as PLOT3D, which has none.
struct GridFormat {
  bool (*recognises)(const InputFile& file);
  std::unique_ptr<DataSource> (*open)(const OpenGridOptions& options);
  enum class MoreFiles { kNone, kByItself, kCombined } more_files;  // who reads options.solutions
};
using MoreFiles = GridFormat::MoreFiles;

std::unique_ptr<DataSource> openListedFile(const OpenGridOptions& options) {
  return openFileSeries(options, openData);
}

std::unique_ptr<DataSource> openNetcdfGrid(const OpenGridOptions& options) {
  try {
    if (isColumnsGrid(options)) return std::make_unique<ColumnsSource>(options);
    return openNetcdf(options);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    if (const auto format = foreignHdf5(options.grid))
      throw Error("{}: is {}", options.grid.string(), *format);
    throw;
  }
}

constexpr GridFormat kFormats[] = {
    {isVtkXml, openVtkXml, MoreFiles::kCombined},
    {isVtkLegacy, openVtkLegacy, MoreFiles::kCombined},
    {isFileSeries, openListedFile, MoreFiles::kNone},  // before .p3d, which takes all JSON files
    {isPlot3dMeta, openPlot3dMeta, MoreFiles::kNone},
    {isVtkHdf, openVtkHdf, MoreFiles::kCombined},            // before NetCDF, which takes all HDF5 files
    {CgnsFile::recognises, openCgns, MoreFiles::kCombined},  // before NetCDF, which takes all HDF5 files
    {isFluentHdf5, openFluent, MoreFiles::kByItself},        // before NetCDF, which takes all HDF5 files
    {isExodus, openExodus, MoreFiles::kCombined},            // before NetCDF, which they are
    {NetcdfFile::recognises, openNetcdfGrid, MoreFiles::kByItself},
    {isEnsightCase, openEnsight, MoreFiles::kNone},
    {isGmsh, openGmsh, MoreFiles::kCombined},
    {isSu2, openSu2, MoreFiles::kByItself},
    {isTecplot, openTecplot, MoreFiles::kCombined},
    {isXdmf, openXdmf, MoreFiles::kCombined},
};

// ---- scalars by name ----

/// Indices of the scalars for which `matches` is true.
template <typename Matches>
std::vector<uint32_t> positionsOf(const GridDescription& description, const Matches& matches) {
  std::vector<uint32_t> positions;
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    if (matches(description.scalars[n])) positions.push_back(n);
  return positions;
}

/// The name as a positive integer; nullopt if it is not one.
std::optional<uint32_t> numberIn(const std::string& name) {
  uint32_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || end != name.data() + name.size() || number == 0) return std::nullopt;
  return number;
}

uint32_t numberOf(const GridScalar& scalar) {
  return scalar.number > 0 ? scalar.number : scalar.function;
}

/// Whether `name` is the scalar's with its number, its unit or both behind it, as lists print it.
bool isPrintedAs(const GridScalar& scalar, const std::string& name) {
  const std::string number = numberOf(scalar) > 0 ? fmt::format(" ({})", numberOf(scalar)) : "",
                    unit = scalar.unit.empty() ? "" : fmt::format(" [{}]", scalar.unit);
  if (!name.starts_with(scalar.name) || name == scalar.name) return false;
  const std::string rest = name.substr(scalar.name.size());
  return rest == number || rest == unit || rest == number + unit || rest == unit + number;
}

/// Indices of the scalars that match, by the first rule that applies: the exact name; the name as lists
/// print it; the number of a function file's variable, else PLOT3D's function number; the simplified name or
/// alias of a stored, else of a derived scalar.
std::vector<uint32_t> candidatesFor(const GridDescription& description, const std::string& name) {
  const auto exact = positionsOf(description, [&](const GridScalar& scalar) { return scalar.name == name; });
  if (!exact.empty()) return exact;
  const auto printed = positionsOf(description, [&](const GridScalar& s) { return isPrintedAs(s, name); });
  if (!printed.empty()) return printed;
  if (const auto number = numberIn(name)) {
    const auto variables = positionsOf(description, [&](const GridScalar& s) { return s.number == *number; });
    if (!variables.empty()) return variables;
    return positionsOf(description, [&](const GridScalar& s) { return s.function == *number; });
  }
  const std::string simple = simplifiedName(name);
  const auto named = [&](bool derived) {
    return positionsOf(description,
                       [&](const GridScalar& s) { return s.derived == derived && answersTo(s, simple); });
  };
  const auto stored = named(false);
  return stored.empty() ? named(true) : stored;
}

/// Advice about files without any scalar.
std::string sourceOfScalars(const GridDescription& description) {
  const bool is_su2 = description.format.starts_with("SU2");
  if (!is_su2 && !description.pieces.empty()) return "";
  const bool is_plot3d = description.format.empty() || description.format.find("PLOT3D") != std::string::npos;
  return fmt::format("; give {} as well", is_su2      ? "a restart file"
                                          : is_plot3d ? "a Q or function file"
                                                      : "the file with its scalars");
}

std::string namesIn(const GridDescription& description) {
  std::vector<std::string> names;
  for (const GridScalar& scalar : description.scalars) {
    const uint32_t number = numberOf(scalar);
    const bool has_number = number > 0 && scalar.name != std::to_string(number);
    names.push_back(has_number ? fmt::format("{} ({})", scalar.name, number) : scalar.name);
  }
  return "available: " + listed(names);
}

// ---- opening ----

std::unique_ptr<DataSource> openFormat(const OpenGridOptions& options);

/// Refuses --select for formats without dimensions to choose from.
void requireNoSelection(const OpenGridOptions& options) {
  if (!options.select.empty())
    throw UsageError("--select {}: {} is not a NetCDF file, whose dimensions have names",
                     options.select.front(), options.grid.string());
}

std::unique_ptr<DataSource> openFormat(const OpenGridOptions& options) {
  if (isFoamCase(options.grid)) {
    if (!options.solutions.empty())
      throw Error("{}: is an OpenFOAM case, whose fields are in its folders; leave out {}",
                  options.grid.string(), options.solutions.front().string());
    requireNoSelection(options);
    return openFoam(options);
  }
  if (isZarrStore(options.grid)) return openNetcdfGrid(options);
  if (isRegularFile(options.grid)) {
    const InputFile file(options.grid);
    for (const GridFormat& format : kFormats)
      if (format.recognises(file)) {
        if (format.open != openNetcdfGrid) requireNoSelection(options);
        if (options.solutions.empty() || format.more_files == MoreFiles::kByItself)
          return format.open(options);
        if (format.more_files == MoreFiles::kCombined) return openCombined(options, openFormat);
        throw Error("{}: describes its own files; leave out {}", options.grid.string(),
                    options.solutions.front().string());
      }
    // The empty file that stands for a case of OpenFOAM, which has no mesh.
    if (options.grid.extension() == ".foam" || options.grid.extension() == ".OpenFOAM") {
      if (const auto found = foreignFolder(folderOf(options.grid)))
        throw Error("{}: is in {}", options.grid.string(), *found);
      throw Error(
          "{}: stands for an OpenFOAM case, but its folder has none (expected constant/polyMesh there)",
          options.grid.string());
    }
    if (file.size() == 0) throw Error("{}: is empty; expected a grid file", options.grid.string());
  }
  refuseForeign(options.grid, "a grid file");
  requireNoSelection(options);
  for (const std::filesystem::path& path : options.solutions)
    refuseForeign(path, "a PLOT3D Q or function file");
  return std::make_unique<Plot3dSource>(options);
}

/// Null where the files do not open.
std::unique_ptr<DataSource> tryOpen(const OpenGridOptions& options) {
  try {
    return openUnpacked(options, openFormat);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return nullptr;
  }
}

/// Files that were chosen in a dialog, dropped or matched by a pattern come in any order: where the first one is no grid,
/// another one may be. Messages are of the order that was chosen.
std::unique_ptr<DataSource> openInAnyOrder(const OpenGridOptions& options) {
  constexpr size_t kMaxFiles = 8;
  try {
    return openUnpacked(options, openFormat);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    if (options.solutions.empty() || options.solutions.size() >= kMaxFiles) throw;
    OpenGridOptions other = options;
    other.solutions.clear();
    if (tryOpen(other)) throw;
    for (const std::filesystem::path& grid : options.solutions) {
      other.grid = grid;
      other.solutions = options.solutions;
      std::erase(other.solutions, grid);
      other.solutions.insert(other.solutions.begin(), options.grid);
      if (auto source = tryOpen(other)) return source;
    }
    throw;
  }
}

/// Leaves out files of names (PLOT3D's .nam) that are found beside the function files, since these are chosen, too.
void leaveOutNames(OpenGridOptions& options) {
  std::vector<std::filesystem::path> files = options.solutions;
  files.push_back(options.grid);
  const auto isOfNames = [&](const std::filesystem::path& names) {
    std::error_code none_there;
    return names.extension() == ".nam" &&
           std::any_of(files.begin(), files.end(), [&](std::filesystem::path file) {
             return file.extension() != ".nam" &&
                    std::filesystem::equivalent(file.replace_extension(".nam"), names, none_there);
           });
  };
  std::erase_if(options.solutions, isOfNames);
  if (!isOfNames(options.grid) || options.solutions.empty()) return;
  options.grid = options.solutions.front();
  options.solutions.erase(options.solutions.begin());
}

}  // namespace

std::unique_ptr<DataSource> openData(const OpenGridOptions& options) {
  OpenGridOptions complete = options;
  leaveOutNames(complete);
  if (complete.temporary_folder.empty()) complete.temporary_folder = systemTemporaryFolder();
  std::unique_ptr<DataSource> source =
      cutCurved(openInAnyOrder(complete), options.cut_curved.value_or(true), complete.temporary_folder);
  if (options.globe != GlobeOptions{} && !source->description().globe)
    throw UsageError(
        "{}: has no longitudes and latitudes; leave out --sphere, --flat and --vertical-scale (that of "
        "render stretches pictures of any grid)",
        complete.grid.string());
  const std::string& format = source->description().format;
  if (options.force != Plot3dForce{} && format.find("PLOT3D") == std::string::npos)
    throw UsageError(
        "{}: is {}; --ascii, --binary, --byte-order, --records, --precision, --blocks and --iblank tell the "
        "layout of PLOT3D files; leave them out",
        complete.grid.string(), format);
  chosenTimeStep(complete.grid.string(), source->description().times, options.time_step);
  return source;
}

bool isGridFolder(const std::filesystem::path& path) {
  return isFoamCase(path) || isZarrStore(path) || foreignFolder(path);
}

std::unique_ptr<GridSource> requireGrid(std::unique_ptr<DataSource> source, const char* cannot) {
  if (auto* const grid = dynamic_cast<GridSource*>(source.get())) {
    source.release();
    return std::unique_ptr<GridSource>(grid);
  }
  const GridDescription& description = source->description();
  throw Error("{}: is an unstructured grid, which {}",
              description.files.empty() ? description.format : description.files.front(), cannot);
}

std::unique_ptr<GridSource> openGrid(const OpenGridOptions& options) {
  return requireGrid(openData(options), "is not read here; expected a structured grid");
}

std::vector<uint32_t> scalarsNamed(const GridDescription& description,
                                   const std::vector<std::string>& names) {
  if (description.scalars.empty())
    throw UsageError("the files contain no scalar{}", sourceOfScalars(description));
  if (names.empty()) {
    if (description.scalars.front().derived)
      throw UsageError("the files contain no scalar{}, or choose a derived one with --scalar; {}",
                       sourceOfScalars(description), namesIn(description));
    return {0};
  }
  std::vector<uint32_t> positions;
  for (const std::string& name : names) {
    const std::vector<uint32_t> candidates = candidatesFor(description, name);
    if (candidates.size() > 1) throw UsageError("scalar '{}' is ambiguous; {}", name, namesIn(description));
    if (candidates.empty()) {
      std::vector<std::string> known;
      for (const GridScalar& scalar : description.scalars) known.push_back(scalar.name);
      const bool no_restart =
          description.format.starts_with("SU2 mesh") && known == std::vector<std::string>{"constant"};
      throw UsageError("there is no scalar '{}'{}{}; {}", name, didYouMean(name, known),
                       no_restart ? "; give a restart file as well" : "", namesIn(description));
    }
    if (std::find(positions.begin(), positions.end(), candidates.front()) != positions.end())
      throw UsageError("scalar '{}' is requested twice", name);
    positions.push_back(candidates.front());
  }
  return positions;
}

std::vector<std::string> notesOnNumbers(const GridDescription& description,
                                        const std::vector<std::string>& names) {
  std::vector<std::string> notes;
  for (const std::string& name : names) {
    const auto number = numberIn(name);
    if (!number) continue;
    const auto variables = positionsOf(description, [&](const GridScalar& s) { return s.number == *number; });
    const auto functions =
        positionsOf(description, [&](const GridScalar& s) { return s.function == *number; });
    if (!variables.empty() && !functions.empty())
      notes.push_back(
          fmt::format("{} means variable {} of the function file; for PLOT3D's function {} use {}", name,
                      name, name, description.scalars[functions.front()].name));
  }
  return notes;
}

}  // namespace curvisplat
