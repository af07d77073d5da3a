#include "preprocess/formats/open/foreign_formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <span>
#include <string_view>
#include <system_error>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_library.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "preprocess/formats/open/grid_endings.h"
#include "preprocess/formats/openfoam/foam_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// The first bytes of a format, so that an Error can name it. NetCDF files of other conventions:
/// foreignNetcdf().
struct Magic {
  std::string_view bytes;
  const char* words;
};

using namespace std::string_view_literals;

constexpr uint64_t kLooked = 16 << 10;  // more than the comments before a text file's data

constexpr const char* kAvsUcd = "an AVS UCD mesh, which is not read (meshio convert FILE mesh.vtu)";
constexpr const char* kFieldView =
    "a FieldView file, which is not read (save it as CGNS, EnSight Gold or PLOT3D)";
constexpr const char* kOldGmsh =
    "a Gmsh mesh of version 1, which is not read (gmsh FILE -save -format msh41 -o OUT.msh)";
constexpr const char* kWebPage = "a web page, perhaps that of a failed download";
constexpr const char* kUtf16 = "text in UTF-16, which is not read (iconv -f UTF-16 -t UTF-8 FILE)";

constexpr Magic kMagics[] = {
    {"# vtk DataFile"sv, "a legacy VTK file"},
    {"<VTKFile"sv, "a VTK XML file"},
    {kHdf5Signature, "an HDF5 file"},
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
    {"\xec\x2b\x08\0"sv, "a restart file of SU2, which goes after its mesh (.su2)"},
    {"\x93NUMPY"sv, "a NumPy array without a grid, which is not read (an XDMF file describes arrays)"},
    {"\0\0\0\x10"
     "FILEHEAD"sv,
     "an ECLIPSE grid (EGRID), which is not read"},
    {"\0\0\0\x10"
     "DIMENS  "sv,
     "an ECLIPSE grid (GRID), which is not read"},
    {"\xef\xbb\xbf"sv,
     "text that begins with a byte order mark, which is not read (sed -i '1s/^\\xEF\\xBB\\xBF//' FILE)"},
    {"\xff\xfe"sv, kUtf16},
    {"\xfe\xff"sv, kUtf16},
    {"version https://git-lfs"sv, "a pointer of Git LFS in the place of the file itself (git lfs pull)"},
    {"!<<PDB:"sv, "a file of PDB or Silo, which is not read (save it as VTK, with VisIt)"},
    {"#std "sv, "a field file of Nek5000, which is not read (save it as VTK with VisIt or pymech)"},
    {"\x0e\x03\x13\x01"sv, "an HDF4 file, which is not read"},
    {"NRRD000"sv, "an NRRD image, which is not read (save it as VTK's .vti, with 3D Slicer or ParaView)"},
    {"PROSTAR_"sv, "a mesh of STAR-CD, which is not read (save it as CGNS or EnSight Gold)"},
    {"{"sv,
     "a JSON file, but no .p3d file that can be read (one is given alone, instead of the grid; it has no "
     "control characters)"},
    {"SIMPLE  ="sv,
     "a FITS image, which is not read (save it as NetCDF, or describe its array in an XDMF file)"},
    {"\x20"
     "BDV\0\0\0\0"sv,
     "an OpenVDB file, which is not read"},
    {"\x03\x02\x01\0FIELDVIEW"sv, kFieldView},
    {"\0\x01\x02\x03"
     "FIELDVIEW"sv,
     kFieldView},
    {"FIELDVIEW"sv, kFieldView},
    {"#INRIMAGE-4"sv, "an INRIMAGE, which is not read (save it as VTK's .vti)"},
    {"# AmiraMesh"sv, "an Amira mesh, which is not read (save it as VTK)"},
    {"# Avizo"sv, "an Avizo mesh, which is not read (save it as VTK)"},
    {"# OOMMF"sv, "a vector field of OOMMF (.ovf), which is not read (ovf2vtk FILE OUT.vtk)"},
    {"\x89PNG"sv, "a PNG image"},
    {"\xff\xd8\xff"sv, "a JPEG image"},
    {"%PDF"sv, "a PDF document"},
    {"\x7f"
     "ELF"sv,
     "an executable"},
    {"\x1f\x8b"sv, "compressed with gzip (decompress it first)"},
    {"\x04\x22\x4d\x18"sv, "compressed with lz4 (decompress it first)"},
    {"\x1f\x9d"sv, "compressed with compress (decompress it first)"},
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

/// A byte 7, then the counts of nodes, cells, and their values: 28 bytes, of either byte order.
bool isAvsUcdBinary(std::string_view begin) {
  if (begin.size() < 25 || begin[0] != 7) return false;
  for (const bool swap : {false, true}) {
    std::array<uint32_t, 6>
        counts;  // nodes, cells, values of a node, of a cell, of the model; corners of all cells
    for (size_t n = 0; n < counts.size(); ++n)
      counts[n] = loadStored<uint32_t>(std::as_bytes(std::span(begin)).data() + 1 + 4 * n, swap);
    const auto& [nodes, cells, of_node, of_cell, of_model, corners] = counts;
    constexpr uint32_t kMaxValues = 1000;
    if (nodes > 0 && cells > 0 && nodes < (1u << 30) && cells < (1u << 30) && of_node <= kMaxValues &&
        of_cell <= kMaxValues && of_model <= kMaxValues && corners >= cells && corners / 8 <= cells)
      return true;
  }
  return false;
}

/// A section of Fluent's: a number in parentheses with text, or more numbers, behind it.
bool isFluent(std::string_view begin) {
  begin = trimmed(begin);
  return begin.size() > 3 && begin[0] == '(' && begin[1] >= '0' && begin[1] <= '9' &&
         (begin[2] == ' ' || (begin[2] >= '0' && begin[2] <= '9'));
}

constexpr const char* kFluent = "a Fluent mesh or case, which is not read (save it as CGNS or EnSight Gold)";
constexpr const char* kSurface = "a surface without a volume (render --surface FILE draws it)";

/// A head of 80 bytes of any kind, the count of triangles, and 50 bytes for each to the end of the file.
bool isBinaryStl(std::string_view begin, uint64_t file_bytes) {
  constexpr uint64_t kHead = 84, kTriangle = 50;
  if (begin.size() < kHead + kTriangle) return false;
  const uint64_t triangles = loadStored<uint32_t>(std::as_bytes(std::span(begin)).data() + 80, false);
  return file_bytes == kHead + kTriangle * triangles;
}

/// Each line begins with a word of Wavefront's, and some line has a point. `begin`: in lower case.
bool isWavefrontObj(std::string_view begin) {
  begin = begin.substr(0, begin.rfind('\n') + 1);  // whole lines
  bool has_points = false;
  for (std::string_view line = nextLine(begin, '#'); !line.empty(); line = nextLine(begin, '#')) {
    constexpr std::array<std::string_view, 11> kWords{"v", "vt", "vn", "vp",     "f",     "l",
                                                      "p", "o",  "g",  "mtllib", "usemtl"};
    const std::vector<std::string_view> words = wordsOf(line);
    if (words.front() != "s" && std::ranges::find(kWords, words.front()) == kWords.end()) return false;
    has_points |= words.front() == "v" && words.size() >= 4;
  }
  return has_points;
}

/// A line with -1 alone, then one with the number of a data set.
bool isUniversalFile(std::string_view begin) {
  if (nextLine(begin, '\0') != "-1") return false;
  const auto number = countIn(nextLine(begin, '\0'));
  constexpr uint64_t kLargestNumber = 99'999;
  return number && *number > 0 && *number <= kLargestNumber;
}

bool isEnzoHierarchy(std::string_view begin) {
  return nextLine(begin, '#').starts_with("grid = ") && nextLine(begin, '#').starts_with("gridrank");
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

/// A record of 80 bytes, the title, which says so or is followed by one of two counts; of either byte order.
bool isSelafin(std::string_view begin) {
  constexpr size_t kTitle = 80;
  for (const bool big : {false, true}) {
    const auto marker = [&](char bytes) {
      return big ? std::string(3, '\0') + bytes : bytes + std::string(3, '\0');
    };
    const std::string counts = marker(kTitle) + marker(8);
    if (!begin.starts_with(marker(kTitle)) || begin.size() < 4 + kTitle) continue;
    if (begin.substr(4, kTitle).find("SERAFIN") != std::string_view::npos) return true;
    const std::string_view behind = begin.substr(4 + kTitle);
    if (behind.size() > counts.size() + 8 && behind.starts_with(counts) &&
        behind.substr(counts.size() + 8).starts_with(marker(8)))
      return true;
  }
  return false;
}

/// Words that a text begins with, in small letters.
constexpr Magic kFirstWords[] = {
    {"<?xml"sv, "an XML file"},
    {"*heading"sv, "an Abaqus mesh, which is not read (meshio convert FILE mesh.vtu)"},
    {"meshversionformatted"sv, "a Medit mesh, which is not read (meshio convert FILE mesh.vtu)"},
    {"solid "sv, kSurface},
    {"ply\n"sv, kSurface},
    {"ply\r"sv, kSurface},
    {"mesh2d"sv, "a mesh of SMS (.2dm), which has no volume"},
    {"mesh3d"sv, "a mesh of SMS (.3dm), which is not read"},
    {"control info"sv, "a neutral file of GAMBIT, which is not read (save it as CGNS or EnSight Gold)"},
    {"1c\n"sv, "a result of CalculiX (.frd), which is not read (ccx2paraview FILE vtu)"},
    {"1c\r"sv, "a result of CalculiX (.frd), which is not read (ccx2paraview FILE vtu)"},
    {"filetemplate:"sv,
     "a list of Nek5000's field files, which are not read (save them as VTK with VisIt or pymech)"},
    {"<!doctype html"sv, kWebPage},
    {"<html"sv, kWebPage},
    {"error {"sv, "an error message of an OPeNDAP server"},
    {"netcdf "sv, "NetCDF's text (CDL), of which ncgen makes a NetCDF file (ncgen -o OUT.nc FILE)"},
    {"mfem "sv, "an MFEM mesh, which is not read (save it as VTK, with VisIt)"},
    {"object 1 class "sv, "an OpenDX file, which is not read (save it as VTK)"},
    {"item: "sv, "a dump of LAMMPS: particles, which have no grid"},
    {"/com,ansys"sv,
     "a mesh of Ansys (.cdb), which is not read (save it as CGNS, or as VTK with pymapdl-reader)"},
    {"*keyword"sv, "an input file of LS-DYNA, which is not read (meshio or LS-PrePost convert its mesh)"},
    {"$nod\n"sv, kOldGmsh},
    {"$nod\r"sv, kOldGmsh},
    {"ndims = "sv, "a MetaImage, which is not read (save it as VTK's .vti, with ParaView)"},
    {"objecttype = "sv, "a MetaImage, which is not read (save it as VTK's .vti, with ParaView)"},
};

/// Gaussian's cube: two lines of title, in words; the atoms and the origin; of each axis the points and the step; the atoms.
bool isGaussianCube(std::string_view begin) {
  if (begin.find_first_not_of(" \t\r\n+-.0123456789e") > begin.find_first_of("0123456789"))
    return false;  // PLOT3D
  for (int line = 0; line < 7; ++line) {
    const size_t end = std::min(begin.find('\n'), begin.size());
    const std::vector<std::string_view> words = wordsOf(begin.substr(0, end));
    begin.remove_prefix(std::min(end + 1, begin.size()));
    if (line < 2) continue;
    if (words.size() < (line < 6 ? 4 : 5) || words.size() > 5) return false;
    const std::string_view count = words[0].substr(words[0].starts_with('-'));
    if (!countIn(count) || words[1].find_first_not_of("+-.0123456789e") != std::string_view::npos)
      return false;
  }
  return true;
}

/// The formats that are text, by the words that they begin with. `begin`: the first bytes of the file.
std::optional<std::string> foreignText(std::string begin) {
  if (std::any_of(begin.begin(), begin.end(), [](char c) { return c == '\0'; })) return std::nullopt;
  begin = lowerCase(begin);
  const std::string_view words =
      std::string_view(begin).substr(std::min(begin.find_first_not_of(' '), begin.size()));
  for (const Magic& first : kFirstWords)
    if (words.starts_with(first.bytes)) return first.words;
  if (auto geometry = ensightGeometry(begin)) return geometry;
  if (isEclipseText(begin)) return "an ECLIPSE grid (GRDECL), which is not read";
  if (begin.starts_with("foamfile") || begin.find("\nfoamfile\n") != std::string::npos)
    return "a file of an OpenFOAM case (give the case's folder instead)";
  if (isEnzoHierarchy(begin))
    return "a hierarchy of Enzo, which is not read (save it as VTK's .vthb, with ParaView)";
  if (isUniversalFile(begin))
    return "a universal file (.unv), which is not read (gmsh FILE -save -o mesh.msh)";
  if (isWavefrontObj(begin)) return kSurface;
  if (isNastran(begin)) return "a Nastran mesh, which is not read (meshio convert FILE mesh.vtu)";
  if (isAvsUcd(begin)) return kAvsUcd;
  if (isGaussianCube(begin)) return "a cube file of Gaussian, which is not read (save it as VTK's .vti)";
  return std::nullopt;
}

/// Names that programs give to files without a signature.
constexpr Magic kNames[] = {
    {"d3plot"sv, "a result of LS-DYNA (d3plot), which is not read (save it as VTK, with ParaView or lasso)"},
    {"d3part"sv, "a result of LS-DYNA (d3part), which is not read (save it as VTK, with ParaView or lasso)"},
    {"chgcar"sv, "a charge density of VASP, which is not read (save it as VTK's .vti, with pymatgen)"},
    {"locpot"sv, "a potential of VASP, which is not read (save it as VTK's .vti, with pymatgen)"},
};

/// Links and attributes of the root of HDF5 files by programs that have formats of their own.
constexpr Magic kHdf5Marks[] = {
    {"ENS_MAA"sv, "a MED file of Salome, which is not read (meshio convert FILE mesh.vtu)"},
    {"INFOS_GENERALES"sv, "a MED file of Salome, which is not read (meshio convert FILE mesh.vtu)"},
    {"_silolibinfo"sv, "a Silo file (HDF5), which is not read (save it as VTK, with VisIt)"},
    {".silo"sv, "a Silo file (HDF5), which is not read (save it as VTK, with VisIt)"},
    {"sim info"sv, "a file of FLASH, which is not read (save it as VTK, with VisIt)"},
    {"Chombo_global"sv, "a Chombo file, which is not read (save it as VTK, with VisIt)"},
    {"MeshBlockSize"sv, "an Athena++ file (.athdf); give the .xdmf file that Athena++ writes beside it"},
    {"openPMD"sv, "an openPMD file, which is not read (describe its arrays in an XDMF file)"},
    {"tstt"sv, "a MOAB mesh (.h5m), which is not read (mbconvert FILE mesh.vtk)"},
    {"PartType0"sv, "a snapshot of particles (GADGET), which has no grid"},
    {"NASTRAN"sv, "a result of Nastran (HDF5), which is not read"},
    {"settings"sv, "a Fluent case without its mesh (give NAME.cas.h5)"},
};

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
    if (begin.substr(block, 8) == kHdf5Signature)
      return fmt::format(
          "an HDF5 file behind {} bytes of a program's own, by no convention that is read (an XDMF file "
          "describes its "
          "arrays)",
          block);
  for (const Magic& magic : kMagics)
    if (begin.starts_with(magic.bytes)) return magic.words;
  for (const Magic& name : kNames)
    if (lowerCase(file.path().filename().string()).starts_with(name.bytes)) return name.words;
  if (begin.size() > 262 && begin.compare(257, 5, "ustar") == 0) return "a tar archive (extract it first)";
  // NIfTI's mark is behind a header of 344 bytes.
  if (begin.size() > 348 && begin.compare(344, 3, "n+1") == 0)
    return "a NIfTI image, which is not read (save it as VTK's .vti, with ParaView)";
  if (isSelafin(begin)) return "a SELAFIN file of Telemac, which is not read (save it as VTK)";
  if (isAvsUcdBinary(begin)) return kAvsUcd;
  if (isBinaryStl(begin, file.size())) return kSurface;
  if (isFluent(begin)) return kFluent;  // of its binary files the first sections are text, too
  // The first four bytes of an ADF file differ between versions.
  if (begin.find("ADF Database") == 4) return "a CGNS (ADF) file";
  return foreignText(std::move(begin));
}

}  // namespace

std::optional<std::string> foreignFolder(const std::filesystem::path& folder) {
  std::error_code error;
  if (std::filesystem::is_regular_file(folder / "Header", error) &&
      std::filesystem::is_directory(folder / "Level_0", error))
    return "a plotfile of AMReX, which is not read (save it as VTK's .vthb, with ParaView)";
  for (const char* mark : {"md.idx", "data.0"})
    if (std::filesystem::is_regular_file(folder / mark, error))
      return "an ADIOS2 file (.bp), which is not read (save it as VTK, with ParaView)";
  if (std::filesystem::is_regular_file(folder / "system" / "controlDict", error) && !isFoamCase(folder)) {
    const bool has_folder = std::filesystem::is_directory(folder / "constant" / "polyMesh", error);
    return fmt::format(
        "an OpenFOAM case without a mesh: {} (blockMesh, or what else the case's Allrun calls, makes it)",
        has_folder ? "constant/polyMesh lacks the file faces" : "there is no constant/polyMesh");
  }
  const std::filesystem::path around = folderOf(folder.has_filename() ? folder : folder.parent_path());
  const bool is_cache = std::filesystem::exists(folder / "manifest.json", error) ||
                        folder.string().find(".splats") != std::string::npos;
  if (!is_cache && std::filesystem::is_directory(folder, error) && isFoamCase(around))
    return fmt::format("a folder within an OpenFOAM case (give the case's folder, {})", around.string());
  return std::nullopt;
}

std::optional<std::string> foreignHdf5(const std::filesystem::path& path) {
  const QuietHdf5 quiet;
  if (H5Fis_hdf5(path.c_str()) <= 0) return std::nullopt;
  const Hdf5File file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  if (!file || !linksAreWhole(file.id()) || !attributesAreWhole(file.id())) return std::nullopt;
  for (const Magic& mark : kHdf5Marks)
    if (H5Lexists(file.id(), mark.bytes.data(), H5P_DEFAULT) > 0 ||
        H5Aexists(file.id(), mark.bytes.data()) > 0)
      return mark.words;
  return std::nullopt;
}

void refuseForeign(const std::filesystem::path& path, const char* expected) {
  if (isRegularFile(path / "manifest.json") && isRegularFile(path / "bricks.bin"))
    throw Error(
        "{}: is a splat cache, which takes no further files and is not converted again (draw it alone); "
        "expected {}",
        path.string(), expected);
  if (const auto format = foreignFolder(path))
    throw Error("{}: is {}; expected {}", path.string(), *format, expected);
  std::error_code none_there;
  if (std::filesystem::is_directory(path, none_there))
    throw Error("{}: is a directory; expected {}", path.string(), expected);
  if (const auto format = foreignFormat(InputFile(path)))
    throw Error("{}: is {}; expected {}", path.string(), *format, expected);
  for (const auto& [format, endings] : kGridEndings)
    if (format && std::ranges::count(wordsOf(endings), extensionOf(path)) > 0)
      throw Error(
          "{}: does not begin as {} does; write or copy it again, or change its ending if it has another "
          "format",
          path.string(), format);
}

}  // namespace curvisplat
