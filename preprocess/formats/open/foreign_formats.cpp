#include "preprocess/formats/open/foreign_formats.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <string_view>
#include <system_error>
#include <vector>

#include "stream/base/words.h"

namespace curvisplat {
namespace {

struct Magic {
  std::string_view bytes;
  const char* words;
};

using namespace std::string_view_literals;

constexpr uint64_t kLooked = 16 << 10;  // more than the comments before a text file's data

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
    {"(0 \""sv, "a Fluent mesh or case, which is not read (save it as CGNS or EnSight Gold)"},
    {"(1 \""sv, "a Fluent mesh or case, which is not read (save it as CGNS or EnSight Gold)"},
    {"GRIB"sv, "a GRIB file, which is not read"},
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

/// The next line of `text` that is not empty and does not begin with `comment`, without the white space around it.
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

/// Five counts, of which the fourth and the fifth may be 0; then a line for each node: its number and x, y, z; then
/// the cells, each with the name of its kind. Where `begin` ends within the nodes, they have to be numbered one after
/// another: coordinates of a PLOT3D file do not follow one another so.
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

/// The formats that are text, by the words that they begin with. `begin`: the first bytes of the file.
std::optional<std::string> foreignText(std::string begin) {
  if (std::any_of(begin.begin(), begin.end(), [](char c) { return c == '\0'; })) return std::nullopt;
  begin = lowerCase(begin);
  if (begin.starts_with("<?xml")) return "an XML file";
  if (begin.starts_with("*heading"))
    return "an Abaqus mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (begin.starts_with("meshversionformatted"))
    return "a Medit mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (isNastran(begin)) return "a Nastran mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (isAvsUcd(begin)) return "an AVS UCD mesh, which is not read (meshio convert FILE mesh.vtu)";
  return std::nullopt;
}

}  // namespace

std::optional<std::string> foreignFormat(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kLooked)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  for (const Magic& magic : kMagics)
    if (begin.starts_with(magic.bytes)) return magic.words;
  // The first four bytes of an ADF file differ between versions.
  if (begin.find("ADF Database") == 4) return "a CGNS (ADF) file";
  return foreignText(std::move(begin));
}

std::optional<std::string> foreignFolder(const std::filesystem::path& folder) {
  std::error_code error;
  for (const char* mark : {".zgroup", ".zarray", ".zmetadata", "zarr.json"})
    if (std::filesystem::is_regular_file(folder / mark, error))
      return "a Zarr store, which is not read (save it as NetCDF, with xarray's to_netcdf)";
  return std::nullopt;
}

}  // namespace curvisplat
