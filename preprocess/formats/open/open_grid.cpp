#include "preprocess/formats/open/open_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "preprocess/formats/cgns/cgns_source.h"
#include "preprocess/formats/columns/columns_source.h"
#include "preprocess/formats/ensight/ensight_source.h"
#include "preprocess/formats/exodus/exodus_source.h"
#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/formats/netcdf/open_netcdf.h"
#include "preprocess/formats/open/combined_source.h"
#include "preprocess/formats/open/indirect_files.h"
#include "preprocess/formats/openfoam/foam_source.h"
#include "preprocess/formats/plot3d/plot3d_source.h"
#include "preprocess/formats/su2/su2_source.h"
#include "preprocess/formats/tecplot/tecplot_source.h"
#include "preprocess/formats/vtk/vtk_legacy.h"
#include "preprocess/formats/vtk/vtk_xml.h"
#include "preprocess/formats/xdmf/xdmf_source.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// ---- formats that are not read ----

/// The first bytes of a format, so that an Error can name it. NetCDF files of other conventions:
/// foreignNetcdf().
struct Magic {
  std::string_view bytes;
  const char* words;
};

using namespace std::string_view_literals;

constexpr uint64_t kLooked = 16 << 10;  // more than the comments before a text file's data

constexpr const char* kUtf16 = "text in UTF-16, which is not read (iconv -f UTF-16 -t UTF-8 FILE)";

constexpr Magic kMagics[] = {
    {"# vtk DataFile"sv, "a legacy VTK file"},
    {"<VTKFile"sv, "a VTK XML file"},
    {"\x89HDF\r\n\x1a\n"sv, "an HDF5 file"},
    {"CDF\x01"sv, "a NetCDF file"},
    {"CDF\x02"sv, "a NetCDF file"},
    {"CDF\x05"sv, "a NetCDF file"},
    {"#!TDV"sv, "a Tecplot binary file"},
    {"#!SZPLT"sv, "a Tecplot subzone file (.szplt), which is not read (save it as .plt)"},
    {"C Binary"sv, "an EnSight geometry file (give its case file instead)"},
    {"\x50\0\0\0Fortran Binary"sv, "an EnSight geometry file in Fortran Binary, which is not read"},
    {"\0\0\0\x50"
     "Fortran Binary"sv,
     "an EnSight geometry file in Fortran Binary, which is not read"},
    {"MATLAB 5.0 MAT-file"sv,
     "a MATLAB file, which is not read (save it with -v7.3 and describe its arrays in an XDMF file)"},
    {"MATLAB 7.3 MAT-file"sv, "a MATLAB file (HDF5), whose arrays an XDMF file has to describe"},
    {"\x93NUMPY"sv, "a NumPy array without a grid, which is not read (an XDMF file describes arrays)"},
    {"$MeshFormat"sv, "a Gmsh mesh, which is not read (meshio convert FILE mesh.vtu)"},
    {"\0\0\0\x10"
     "FILEHEAD"sv,
     "an ECLIPSE grid (EGRID), which is not read"},
    {"\0\0\0\x10"
     "DIMENS  "sv,
     "an ECLIPSE grid (GRID), which is not read"},
    {"\xff\xfe"sv, kUtf16},
    {"\xfe\xff"sv, kUtf16},
    {"#std "sv, "a field file of Nek5000, which is not read (save it as VTK with VisIt or pymech)"},
    {"\x0e\x03\x13\x01"sv, "an HDF4 file, which is not read"},
    {"{"sv,
     "a JSON file, but no .p3d file that can be read (one is given alone, instead of the grid; it has no "
     "control characters)"},
    {"\x89PNG"sv, "a PNG image"},
    {"\xff\xd8\xff"sv, "a JPEG image"},
    {"%PDF"sv, "a PDF document"},
    {"\x7f"
     "ELF"sv,
     "an executable"},
    {"\x1f\x8b"sv, "compressed with gzip (decompress it first)"},
    {"BZh"sv, "compressed with bzip2 (decompress it first)"},
    {"\xfd"
     "7zXZ"sv,
     "compressed with xz (decompress it first)"},
    {"\x28\xb5\x2f\xfd"sv, "compressed with zstd (decompress it first)"},
    {"PK\x03\x04"sv, "a zip archive (extract it first)"},
};

/// The next line of `text` that is not empty and does not begin with `comment`, without the white space
/// around it.
std::string_view nextLine(std::string_view& text, char comment) {
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!line.empty() && line.front() != comment) return line;
  }
  return {};
}

/// Executive control, case control or the bulk data alone, in lower case.
bool isNastran(std::string_view begin) {
  const std::string_view line = nextLine(begin, '$');
  if (line == "cend" || line == "begin bulk") return true;
  const auto is_card = [&](std::string_view name) {
    return line.starts_with(name) && line.size() > name.size() &&
           std::string_view(" ,*\t").find(line[name.size()]) != std::string_view::npos;
  };
  return (line.starts_with("sol ") && begin.find("cend") != std::string_view::npos) || is_card("grid") ||
         is_card("ctetra") || is_card("chexa") || is_card("cpenta");
}

/// Nothing if the word has anything but digits, or too many.
std::optional<uint64_t> countIn(std::string_view word) {
  uint64_t count = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), count);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return count;
}

/// Five counts, of which the fourth and the fifth may be 0; then a line for each node: its number and x, y,
/// z; then the cells, each with the name of its kind. Where `begin` ends within the nodes, they have to be
/// numbered one after another: coordinates of a PLOT3D file do not follow one another so.
bool isAvsUcd(std::string_view begin) {
  const std::vector<std::string_view> counts = wordsOf(nextLine(begin, '#'));
  if (counts.size() != 5 ||
      !std::ranges::all_of(counts, [](std::string_view count) { return countIn(count).has_value(); }))
    return false;
  if (counts.front() == "1") return false;  // "1 ..." may be a PLOT3D file of one block
  const uint64_t nodes = *countIn(counts.front());
  uint64_t seen = 0;
  bool in_turn = true;
  for (std::optional<uint64_t> last; begin.find('\n') != std::string_view::npos;) {  // whole lines
    const std::vector<std::string_view> line = wordsOf(nextLine(begin, '#'));
    if (line.size() > 2)
      for (const std::string_view kind : {"tet", "hex", "prism", "pyr", "tri", "quad", "line", "pt"})
        if (line[2] == kind) return seen > 0;
    const std::optional<uint64_t> number = line.empty() ? std::nullopt : countIn(line.front());
    if (seen++ == 0 && line.size() != 4) return false;
    in_turn &= line.size() == 4 && number && (!last || *number == *last + 1);
    last = number;
  }
  constexpr uint64_t kSufficient = 8;
  return in_turn && seen >= kSufficient && seen <= nodes;
}

/// A section of Fluent's: a number in parentheses with text, or more numbers, behind it.
bool isFluent(std::string_view begin) {
  begin = trimmed(begin);
  return begin.size() > 3 && begin[0] == '(' && begin[1] >= '0' && begin[1] <= '9' &&
         (begin[2] == ' ' || (begin[2] >= '0' && begin[2] <= '9'));
}

/// Two lines of description, then how nodes and elements are numbered. What follows tells EnSight 6 from Gold.
std::optional<std::string> ensightGeometry(std::string_view begin) {
  std::array<std::string_view, 6> lines;
  for (std::string_view& line : lines) {
    const size_t end = std::min(begin.find('\n'), begin.size());
    line = trimmed(begin.substr(0, end));
    begin.remove_prefix(std::min(end + 1, begin.size()));
  }
  if (!lines[2].starts_with("node id") || !lines[3].starts_with("element id")) return std::nullopt;
  if (lines[4] == "coordinates")
    return "a geometry of EnSight 6, which is not read (save it as EnSight Gold)";
  return "an EnSight geometry file (give its case file instead)";
}

/// A section of ECLIPSE's text alone on a line, among the first ones.
bool isEclipseText(std::string_view begin) {
  for (std::string_view line = nextLine(begin, '-'); !line.empty(); line = nextLine(begin, '-'))
    for (const std::string_view section : {"specgrid", "coord", "zcorn", "dimens", "mapaxes", "runspec"})
      if (line == section) return true;
  return false;
}

/// The formats that are text, by the words that they begin with. `begin`: the first bytes of the file.
std::optional<std::string> foreignText(std::string begin) {
  if (std::any_of(begin.begin(), begin.end(), [](char c) { return c == '\0'; })) return std::nullopt;
  begin = lowerCase(begin);
  if (begin.starts_with("<?xml")) return "an XML file";
  if (begin.starts_with("*heading"))
    return "an Abaqus mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (begin.starts_with("meshversionformatted"))
    return "a Medit mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (isFluent(begin)) return "a Fluent mesh or case, which is not read (save it as CGNS or EnSight Gold)";
  if (auto geometry = ensightGeometry(begin)) return geometry;
  if (isEclipseText(begin)) return "an ECLIPSE grid (GRDECL), which is not read";
  if (begin.starts_with("foamfile") || begin.find("\nfoamfile\n") != std::string::npos)
    return "a file of an OpenFOAM case (give the case's folder instead)";
  if (begin.starts_with("solid ") || begin.starts_with("ply\n"))
    return "a surface without a volume (render --surface FILE draws it)";
  if (isNastran(begin)) return "a Nastran mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (isAvsUcd(begin)) return "an AVS UCD mesh, which is not read (meshio convert FILE mesh.vtu)";
  return std::nullopt;
}

/// "compressed with gzip (decompress it first)", "an XML file"; nullopt for a file that may be PLOT3D.
std::optional<std::string> foreignFormat(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kLooked)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  if (const size_t grib = begin.substr(0, 256).find("GRIB");
      grib != std::string::npos &&
      (grib == 0 || (grib + 8 < begin.size() && (begin[grib + 7] == 1 || begin[grib + 7] == 2))))
    return "a GRIB file, which is not read (cdo -f nc copy FILE OUT.nc, or grib_to_netcdf, makes NetCDF of "
           "it)";
  // HDF5 may begin behind 512, 1024, ... bytes of a program's own.
  for (size_t block = 512; block + 8 <= begin.size(); block *= 2)
    if (begin.substr(block, 8) == "\x89HDF\r\n\x1a\n"sv)
      return fmt::format(
          "an HDF5 file behind {} bytes of a program's own, by no convention that is read (an XDMF file "
          "describes its "
          "arrays)",
          block);
  for (const Magic& magic : kMagics)
    if (begin.starts_with(magic.bytes)) return magic.words;
  // A record of Fortran with the title, of either byte order.
  if ((begin.starts_with("\0\0\0\x50"sv) || begin.starts_with("\x50\0\0\0"sv)) &&
      begin.substr(4, 80).find("SERAFIN") != std::string::npos)
    return "a SELAFIN file of Telemac, which is not read (save it as VTK)";
  // The first four bytes of an ADF file differ between versions.
  if (begin.find("ADF Database") == 4) return "a CGNS (ADF) file";
  return foreignText(std::move(begin));
}

/// What a folder is that is not read: "a Zarr store, ..."; nullopt for other folders and for files.
std::optional<std::string> foreignFolder(const std::filesystem::path& folder) {
  std::error_code error;
  for (const char* mark : {".zgroup", ".zarray", ".zmetadata", "zarr.json"})
    if (std::filesystem::is_regular_file(folder / mark, error))
      return "a Zarr store, which is not read (save it as NetCDF, with xarray's to_netcdf)";
  return std::nullopt;
}

// ---- formats that are read ----

/// A file format with a signature. A file that none of them recognises is read as PLOT3D, which has none.
struct GridFormat {
  bool (*recognises)(const InputFile& file);
  std::unique_ptr<DataSource> (*open)(const OpenGridOptions& options);
  enum class MoreFiles { kNone, kByItself, kCombined } more_files;  // who reads options.solutions
};
using MoreFiles = GridFormat::MoreFiles;

template <typename Source>
std::unique_ptr<DataSource> openAs(const OpenGridOptions& options) {
  return std::make_unique<Source>(options);
}

template <std::unique_ptr<GridSource> (*open)(const OpenGridOptions&)>
std::unique_ptr<DataSource> openStructured(const OpenGridOptions& options) {
  return open(options);
}

std::unique_ptr<DataSource> openListedFile(const OpenGridOptions& options) {
  return openFileSeries(options, openData);
}

std::unique_ptr<DataSource> openNetcdfGrid(const OpenGridOptions& options) {
  if (isColumnsGrid(options)) return std::make_unique<ColumnsSource>(options);
  return openNetcdf(options);
}

constexpr GridFormat kFormats[] = {
    {isVtkXml, openVtkXml, MoreFiles::kCombined},
    {isVtkLegacy, openVtkLegacy, MoreFiles::kCombined},
    {isFileSeries, openListedFile, MoreFiles::kNone},  // before .p3d, which takes all JSON files
    {isPlot3dMeta, openStructured<openPlot3dMeta>, MoreFiles::kNone},
    {CgnsFile::recognises, openCgns, MoreFiles::kCombined},  // before NetCDF, which takes all HDF5 files
    {isExodus, openAs<ExodusSource>, MoreFiles::kNone},      // before NetCDF, which they are
    {NetcdfFile::recognises, openNetcdfGrid, MoreFiles::kByItself},
    {isEnsightCase, openEnsight, MoreFiles::kNone},
    {isSu2, openAs<Su2Source>, MoreFiles::kByItself},
    {isTecplot, openAs<TecplotSource>, MoreFiles::kCombined},
    {isXdmf, openAs<XdmfSource>, MoreFiles::kCombined},
};

void refuseForeign(const std::filesystem::path& path, const char* expected) {
  if (const auto format = foreignFolder(path))
    throw Error("{}: is {}; expected {}", path.string(), *format, expected);
  std::error_code none_there;
  if (std::filesystem::is_directory(path, none_there))
    throw Error("{}: is a directory; expected {}", path.string(), expected);
  if (const auto format = foreignFormat(InputFile(path)))
    throw Error("{}: is {}; expected {}", path.string(), *format, expected);
}

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

/// What to do about files without any scalar.
std::string sourceOfScalars(const GridDescription& description) {
  const bool is_su2 = description.format.starts_with("SU2");
  if (!is_su2 && !description.pieces.empty()) return "";
  return fmt::format("; give a {} file as well", is_su2 ? "restart" : "Q or function");
}

std::string namesIn(const GridDescription& description) {
  std::string names = "available: ";
  for (size_t n = 0; n < description.scalars.size(); ++n) {
    const GridScalar& scalar = description.scalars[n];
    names += (n ? ", " : "") + scalar.name;
    const uint32_t number = numberOf(scalar);
    if (number > 0 && scalar.name != std::to_string(number)) names += " (" + std::to_string(number) + ")";
  }
  return names;
}

// ---- opening ----

std::unique_ptr<DataSource> openFormat(const OpenGridOptions& options);

/// Opens one of several files that are to be combined.
std::unique_ptr<GridSource> openPart(const OpenGridOptions& options) {
  return requireGrid(openFormat(options),
                     "cannot be combined with further files; give the file with all arrays alone");
}

std::unique_ptr<DataSource> openFormat(const OpenGridOptions& options) {
  if (isFoamCase(options.grid)) {
    if (!options.solutions.empty())
      throw Error("{}: is an OpenFOAM case, whose fields are in its folders; leave out {}",
                  options.grid.string(), options.solutions.front().string());
    return std::make_unique<FoamSource>(options);
  }
  if (isRegularFile(options.grid)) {
    const InputFile file(options.grid);
    for (const GridFormat& format : kFormats)
      if (format.recognises(file)) {
        if (options.solutions.empty() || format.more_files == MoreFiles::kByItself)
          return format.open(options);
        if (format.more_files == MoreFiles::kCombined) return openCombined(options, openPart);
        throw Error("{}: describes its own files; leave out {}", options.grid.string(),
                    options.solutions.front().string());
      }
    if (file.size() == 0) throw Error("{}: is empty; expected a grid file", options.grid.string());
  }
  refuseForeign(options.grid, "a grid file");
  for (const std::filesystem::path& path : options.solutions)
    refuseForeign(path, "a PLOT3D Q or function file");
  return std::make_unique<Plot3dSource>(options);
}

}  // namespace

std::unique_ptr<DataSource> openData(const OpenGridOptions& options) {
  OpenGridOptions complete = options;
  if (complete.temporary_folder.empty()) complete.temporary_folder = std::filesystem::temp_directory_path();
  std::unique_ptr<DataSource> source = openUnpacked(complete, openFormat);
  chosenTimeStep(options.grid.string(), source->description().times, options.time_step);
  return source;
}

bool isGridFolder(const std::filesystem::path& path) {
  return isFoamCase(path) || foreignFolder(path);
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
      throw UsageError("the files contain no scalar; choose a derived one with --scalar; {}",
                       namesIn(description));
    return {0};
  }
  std::vector<uint32_t> positions;
  for (const std::string& name : names) {
    const std::vector<uint32_t> candidates = candidatesFor(description, name);
    if (candidates.size() > 1) throw UsageError("scalar '{}' is ambiguous; {}", name, namesIn(description));
    if (candidates.empty()) {
      std::vector<std::string> known;
      for (const GridScalar& scalar : description.scalars) known.push_back(scalar.name);
      throw UsageError("there is no scalar '{}'{}; {}", name, didYouMean(name, known), namesIn(description));
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
