// Files of formats that are not read: each is refused by its own name.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/hdf5_editor.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

using namespace std::string_literals;

class ForeignFormats : public testing::Test {
 protected:
  std::string errorOf(const char* name) const {
    OpenGridOptions options;
    options.grid = folder_ / name;
    try {
      openGrid(options);
    } catch (const Error& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with(options.grid.string() + ": is ")) << error.what();
      return error.what();
    }
    return "";
  }
  void expectNamed(const char* name, const std::string& format) const {
    const std::string error = errorOf(name);
    EXPECT_NE(error.find(": is " + format), std::string::npos) << name << ": " << error;
  }
  void write(const char* name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
  }
  /// A mesh: values of `cells` cells on two levels, and their centres.
  static void mesh(NetcdfWriter& file, const char* cells, const char* level,
                   const NetcdfAttributes& attributes = {}) {
    file.dimension(cells, 5);
    file.dimension(level, 2);
    file.variable("clon", NetcdfNumbers::kDoublePrecision, {cells}, {{"units", "degrees_east"}},
                  [](const auto& n) { return static_cast<double>(n[0]); });
    file.variable("clat", NetcdfNumbers::kDoublePrecision, {cells}, {{"units", "degrees_north"}},
                  [](const auto& n) { return static_cast<double>(n[0]); });
    file.variable("temp", NetcdfNumbers::kSinglePrecision, {level, cells}, attributes,
                  [](const auto&) { return 1.0; });
  }

  TemporaryFolder folder_;
};

TEST_F(ForeignFormats, TextAndBinaryFilesAreNamed) {
  write("a.szplt", "#!SZPLT\1\0\0\0"s);
  expectNamed("a.szplt", "a Tecplot subzone file");
  write("a.geo", "C Binary" + std::string(72, ' '));
  expectNamed("a.geo", "an EnSight geometry file");
  write("b.geo", "\x50\0\0\0Fortran Binary"s + std::string(72, ' '));
  expectNamed("b.geo", "an EnSight geometry file");
  write("a.xml", "<?xml version=\"1.0\"?>\n<html/>\n");
  expectNamed("a.xml", "an XML file");
  write("a.grib", "GRIB\0\0\0\2"s);
  expectNamed("a.grib", "a GRIB file");
  write("a.mat", "MATLAB 5.0 MAT-file Platform: posix" + std::string(128, '\0'));
  expectNamed("a.mat", "a MATLAB file, which is not read");
  write("b.mat", "MATLAB 7.3 MAT-file, Platform: GLNXA64" + std::string(512, '\0'));
  expectNamed("b.mat", "a MATLAB file (HDF5), whose arrays an XDMF file has to describe");
  write("a.npy", "\x93NUMPY\1\0v\0{'descr': '<f4', 'fortran_order': False, 'shape': (6, 5, 7), }"s +
                     std::string(900, '\0'));
  expectNamed("a.npy", "a NumPy array without a grid");
  write("a.msh", "$MeshFormat\n4.1 1 8\n\1\0\0\0\n$EndMeshFormat\n"s);
  expectNamed("a.msh", "a Gmsh mesh");
  for (const char* text :
       {"(0 \"GAMBIT to Fluent File\")\n(2 3)\n", "(1 \"meshio 5.0.0\")\n(2 3)\n(10 (0 1 8 0))\n"}) {
    write("b.msh", text);
    expectNamed("b.msh", "a Fluent mesh or case");
  }
  write("a.inp", "*HEADING\nAbaqus\n*NODE\n1, 0, 0, 0\n");
  expectNamed("a.inp", "an Abaqus mesh");
  write("a.mesh", "MeshVersionFormatted 2\nDimension 3\nVertices\n8\n");
  expectNamed("a.mesh", "a Medit mesh");
  for (const char* text :
       {"$ a comment\nSOL 101\nCEND\nBEGIN BULK\nGRID,1,,0.,0.,0.\n", "CEND\nBEGIN BULK\n",
        "begin bulk\nGRID*                  1\n", "$ meshio\nGRID, 1,, 0.0, 0.0, 0.0\nCTETRA,1,,1,2,3,4\n"}) {
    write("a.bdf", text);
    expectNamed("a.bdf", "a Nastran mesh");
  }
  write("b.inp", "# by AVS\n4 1 0 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n1 0 tet 1 2 3 4\n");
  expectNamed("b.inp", "an AVS UCD mesh");
}

TEST_F(ForeignFormats, AvsUcdFilesAreNamedHoweverLateTheirCellsBegin) {
  for (const int nodes : {8, 100, 5000})
    for (const int first : {0, 1}) {
      std::string text = fmt::format("# by AVS\n{} 1 1 0 0\n", nodes);
      for (int n = 0; n < nodes; ++n) text += fmt::format("{} {} {} 0.5\n", first + n, 0.1 * n, n % 7);
      text += "1 0 tet 1 2 3 4\n1 1\np, Pa\n";
      write("late.inp", text);
      expectNamed("late.inp", "an AVS UCD mesh");
    }
  write("comments.inp", std::string(100, '#') + "\n" + std::string(4000, '#') +
                            "\n4 1 0 0 0\n1 0 0 0\n2 1 0 0\n" + "3 0 1 0\n4 0 0 1\n1 0 tet 1 2 3 4\n");
  expectNamed("comments.inp", "an AVS UCD mesh");
}

TEST_F(ForeignFormats, FoldersOfZarrAreNamed) {
  for (const char* mark : {".zgroup", ".zarray", ".zmetadata", "zarr.json"}) {
    const std::filesystem::path store = folder_ / (std::string(mark) + ".zarr");
    std::filesystem::create_directory(store);
    std::ofstream(store / mark) << "{}";
    expectNamed(store.filename().c_str(), "a Zarr store, which is not read (");
  }
  std::filesystem::create_directory(folder_ / "folder");
  expectNamed("folder", "a directory; expected");
}

TEST_F(ForeignFormats, TextsOfNumbersAreStillTriedAsPlot3d) {
  write("a.xyz", "1\n2 2 2\n0 1 0 1 0 1 0 1  0 0 1 1 0 0 1 1  0 0 0 0 1 1 1 1\n");
  OpenGridOptions options;
  options.grid = folder_ / "a.xyz";
  EXPECT_EQ(openGrid(options)->description().blocks.size(), 1u);
  // Two blocks, of which five counts are in the first line, and four numbers in all others.
  std::string text = "2 10 10 2 10\n10 2 0 1\n";
  for (int n = 2; n < 1198; n += 4) text += fmt::format("{} {} {} {}\n", n % 10, n / 10 % 10, n / 100, n % 3);
  write("two.xyz", text + "0 0\n");
  options.grid = folder_ / "two.xyz";
  EXPECT_EQ(openGrid(options)->description().blocks.size(), 2u);
}

TEST_F(ForeignFormats, UnstructuredNetcdfIsNamed) {
  for (const NetcdfFileType type : {NetcdfFileType::kClassic, NetcdfFileType::kNetcdf4}) {
    {
      NetcdfWriter file(folder_ / "ugrid.nc", type);
      mesh(file, "faces", "lev");
      file.dimension("one", 1);
      file.variable("mesh2d", NetcdfNumbers::kInt32, {"one"}, {{"cf_role", "mesh_topology"}},
                    [](const auto&) { return 0.0; });
    }
    expectNamed("ugrid.nc", "an unstructured mesh (UGRID)");
    {
      NetcdfWriter file(folder_ / "icon.nc", type);
      file.attribute("uuidOfHGrid", "0f1e7d66-637e-11e8-913b-51232bb4d8f9");
      mesh(file, "ncells", "height", {{"CDI_grid_type", "unstructured"}});
    }
    expectNamed("icon.nc", "an unstructured grid (ICON)");
    {
      NetcdfWriter file(folder_ / "cdo.nc", type);
      mesh(file, "ncells", "height", {{"CDI_grid_type", "unstructured"}});
    }
    expectNamed("cdo.nc", "an unstructured grid;");
    {
      NetcdfWriter file(folder_ / "fvcom.nc", type);
      file.attribute("source", "FVCOM_3.0");
      mesh(file, "node", "siglay");
    }
    expectNamed("fvcom.nc", "an unstructured mesh (FVCOM)");
    {
      NetcdfWriter file(folder_ / "mesh.exo", type);
      file.attribute("api_version", "8.03");
      file.dimension("num_dim", 3);
      file.dimension("num_nodes", 8);
      file.variable("coord", NetcdfNumbers::kDoublePrecision, {"num_dim", "num_nodes"}, {},
                    [](const auto&) { return 0.0; });
    }
    expectNamed("mesh.exo", "a finite-element mesh (Exodus)");
  }
}

TEST_F(ForeignFormats, PlainHdf5IsNamed) {
  const std::filesystem::path file = folder_ / "plain.h5";
  {
    NetcdfWriter writer(file, NetcdfFileType::kNetcdf4);  // without dimensions, an HDF5 file like any other
  }
  {
    Hdf5Editor editor(file);
    editor.replaceAttribute("/", "_NCProperties", HostileAttribute::kMissing);
    editor.group("/results");
  }
  expectNamed("plain.h5",
              "an HDF5 file, but neither NetCDF-4 nor CGNS; describe its arrays in an XDMF file (.xmf)");
  Hdf5Editor(file).group("/VTKHDF");
  Hdf5Editor(file).group("/VTKHDF/PointData");
  expectNamed("plain.h5", "a VTKHDF file (save it as .vts, .vti or .vtu)");
}

}  // namespace
}  // namespace curvisplat
