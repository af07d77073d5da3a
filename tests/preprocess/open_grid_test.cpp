// Grids are opened with the scalars that are asked for, by name, alias or number. Files of formats that are
// not read are each refused by the format's own name.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/hdf5_editor.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

using namespace test;

class OpenGrid : public testing::Test {
 protected:
  std::unique_ptr<GridSource> open(const std::vector<std::string>& solutions) const {
    OpenGridOptions options;
    options.grid = folder_.path() / "grid.xyz";
    for (const std::string& solution : solutions) options.solutions.push_back(folder_.path() / solution);
    return openGrid(options);
  }
  std::vector<std::string> names(const std::vector<std::string>& solutions) const {
    std::vector<std::string> found;
    const auto source = open(solutions);
    for (const GridScalar& scalar : source->description().scalars) found.push_back(scalar.name);
    return found;
  }
  void write(const std::string& name, Plot3dKind kind, uint32_t components) {
    Plot3dLayout layout;
    layout.kind = kind;
    folder_.write(name, plot3dBytes(layout, {testBlock(5, 4, 3, components)}));
  }
  void SetUp() override { write("grid.xyz", Plot3dKind::kGrid, 0); }

  const TestFolder folder_{"open-grid"};
};

std::string usageErrorOf(const GridDescription& description, const std::vector<std::string>& names) {
  try {
    scalarsNamed(description, names);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

using Positions = std::vector<uint32_t>;

TEST_F(OpenGrid, FindsScalarsByNameAliasAndNumber) {
  write("a.q", Plot3dKind::kQ, 5);
  write("a.fun", Plot3dKind::kFunction, 3);
  folder_.write("a.nam", "velocity_u ; velocity\r\n  T\n\npressure\n");
  EXPECT_EQ(names({"a.q", "a.fun"}),
            (std::vector<std::string>{"density", "momentum_x", "momentum_y", "momentum_z", "energy",
                                      "velocity_u", "T", "pressure"}));
  const auto source = open({"a.q", "a.fun"});
  const GridDescription& description = source->description();
  EXPECT_TRUE(description.warnings.empty());
  EXPECT_EQ(scalarsNamed(description, {}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"pressure", "Density", "StagnationEnergy", "momentum-y"}),
            (Positions{7, 0, 4, 2}));
  EXPECT_EQ(scalarsNamed(description, {"2", "velocity-U"}), (Positions{6, 5}));
}

TEST_F(OpenGrid, FindsScalarsAsListsPrintThem) {
  GridDescription description;
  description.scalars = {{"T", "K", {}, 3, Centring::kNode},
                         {"T cell", "", {}, 0, Centring::kCell},
                         {"p [Pa]", "K", {}, 0, Centring::kNode}};
  EXPECT_EQ(scalarsNamed(description, {"T [K]"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"T (3)"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"T [K] (3)"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"T (3) [K]"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"p [Pa]"}), Positions{2});
  EXPECT_EQ(scalarsNamed(description, {"p [Pa] [K]"}), Positions{2});
  for (const char* wrong : {"T [m]", "T [K] ", "T (4)", "T cell []", "T cell (0)", "T [K] [K]"})
    EXPECT_NE(usageErrorOf(description, {wrong}).find("there is no scalar"), std::string::npos) << wrong;
  description.scalars.clear();
  EXPECT_EQ(usageErrorOf(description, {"T"}),
            "the files contain no scalar; give a Q or function file as well");
}

TEST_F(OpenGrid, ReadsPartsOfRows) {
  Plot3dLayout grid, q;
  grid.kind = Plot3dKind::kGrid;
  q.kind = Plot3dKind::kQ;
  for (Plot3dLayout* layout : {&grid, &q}) {
    layout->multi_block = true;
    layout->precision_bytes = 8;
    layout->byte_order = ByteOrder::kBig;
    layout->records = RecordMarkers::kBytes4;
  }
  grid.blanking = true;
  const std::vector<TestBlock> blocks{testBlock(9, 4, 3, 5), testBlock(7, 5, 6, 5, 40)};
  for (const uint64_t subrecord_bytes : {0u, 200u}) {
    folder_.write("grid.xyz", plot3dBytes(grid, blocks, subrecord_bytes));
    folder_.write("a.q", plot3dBytes(q, blocks, subrecord_bytes));
    const auto source = open({"a.q"});
    EXPECT_EQ(source->description().blocks.size(), 2u);
    EXPECT_TRUE(source->description().blocks[0].has_blanking);
    EXPECT_EQ(source->rowsInMemory({}), 0u);
    expectPartsOfRows(*source);
  }
}

TEST_F(OpenGrid, RefusesUnknownScalarsWithTheListOfThem) {
  write("a.fun", Plot3dKind::kFunction, 2);
  folder_.write("a.nam", "p\nT\n");
  const auto source = open({"a.fun"});
  EXPECT_EQ(scalarsNamed(source->description(), {"2"}), Positions{1});
  for (const char* name : {"rho", "0", "3", "-1", "1.5", ""}) {
    const std::string error = usageErrorOf(source->description(), {name});
    expectSays(error, "available: p (1), T (2)");
  }
  expectSays(usageErrorOf(source->description(), {"T", "2"}), "twice");
  expectSays(usageErrorOf(open({})->description(), {}), "the files contain no scalar");
}

TEST_F(OpenGrid, NamesThatClashCarryTheirFile) {
  write("a.fun", Plot3dKind::kFunction, 2);
  write("b.fun", Plot3dKind::kFunction, 3);
  EXPECT_EQ(names({"a.fun", "b.fun"}), (std::vector<std::string>{"a:1", "a:2", "b:1", "b:2", "3"}));
  const auto source = open({"a.fun", "b.fun"});
  EXPECT_EQ(scalarsNamed(source->description(), {"b:2", "3"}), (Positions{3, 4}));
  expectSays(usageErrorOf(source->description(), {"1"}), "ambiguous");
  EXPECT_THROW(open({"a.fun", "a.fun"}), Error);
}

TEST_F(OpenGrid, WarnsOfNamesThatDoNotMatch) {
  write("a.fun", Plot3dKind::kFunction, 3);
  folder_.write("a.nam", "p\nT\n");
  const auto source = open({"a.fun"});
  ASSERT_EQ(source->description().warnings.size(), 1u);
  expectSays(source->description().warnings[0], "2 names for the 3 variables");
  EXPECT_EQ(names({"a.fun"}), (std::vector<std::string>{"p", "T", "3"}));
}

TEST_F(OpenGrid, NamesForeignFiles) {
  for (const auto& [bytes, words] : {std::pair<std::string, std::string>{"\x1f\x8b\x08\x01", "gzip"},
                                     {"\x89PNG\r\n\x1a\n", "PNG"},
                                     {"# vtk DataFile Version 3.0\n", "legacy VTK"},
                                     {"<?xml version=\"1.0\"?>", "XML"},
                                     {"\x89HDF\r\n\x1a\n", "HDF5"},
                                     {"CDF\x01", "NetCDF"},
                                     {"{ \"xyz\": 1 }", "JSON"}}) {
    folder_.write("foreign", bytes + "1234567890");
    SCOPED_TRACE(words);
    expectError([&] { open({"foreign"}); }, {words});
  }
}

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
  write("restart.dat", "\xec\x2b\x08\0\4\0\0\0"s + std::string(99, '\0'));
  expectNamed("restart.dat", "a restart file of SU2");
  write("a.geo", "C Binary" + std::string(72, ' '));
  expectNamed("a.geo", "an EnSight geometry file");
  write("b.geo", "\x50\0\0\0Fortran Binary"s + std::string(72, ' '));
  expectNamed("b.geo", "an EnSight geometry file");
  write("a.xml", "<?xml version=\"1.0\"?>\n<html/>\n");
  expectNamed("a.xml", "an XML file");
  write("a.grib", "GRIB\0\0\0\2"s);
  expectNamed("a.grib", "a GRIB file");
  write("b.grib", "\x01\r\r\n123 \r\r\nHTXX01 EDZW\r\r\nGRIB\0\1\0\2....."s);
  expectNamed("b.grib", "a GRIB file");
  write("state.h5", "{[( SETTINGS )]}\nN = 3\n" + std::string(512 - 23, '\0') + "\x89HDF\r\n\x1a\n" +
                        std::string(100, '\0'));
  expectNamed("state.h5", "an HDF5 file behind 512 bytes");
  write("utf16.vtu", "\xff\xfe<\0?\0x\0m\0l\0"s);
  expectNamed("utf16.vtu", "text in UTF-16");
  for (const char* const kind : {"SERAFIN ", "SERAFIND"}) {
    write("a.slf", "\0\0\0\x50"s + std::string(72, ' ') + kind + "\0\0\0\x50"s);
    expectNamed("a.slf", "a SELAFIN file of Telemac");
  }
  write("a.EGRID",
        "\0\0\0\x10"
        "FILEHEAD\0\0\0\x64INTE\0\0\0\x10"s);
  expectNamed("a.EGRID", "an ECLIPSE grid (EGRID)");
  for (const char* const text :
       {"SPECGRID\n 1 1 1 1 F /\n", "-- made by Petrel\n\nMAPAXES\n0 1 0 0 1 0 /\n"}) {
    write("a.grdecl", text);
    expectNamed("a.grdecl", "an ECLIPSE grid (GRDECL)");
  }
  for (const char* const text :
       {"(0 a mesh of a generator)\n(2 3)\n", "(0 \"x\")\n", "(2 3)\n(10 (0 1 8 0 3))\n", "\n(1 x)\n"}) {
    write("a.msh", text);
    expectNamed("a.msh", "a Fluent mesh or case");
  }
  const std::string head = "a geometry\nof a program\nnode id given\nelement id off\n";
  write("a.geo", head + "coordinates\n       4\n");
  expectNamed("a.geo", "a geometry of EnSight 6");
  write("a.geo", head + "part\n         1\n");
  expectNamed("a.geo", "an EnSight geometry file (give its case file instead)");
  write("points", "/*--- a banner ---*/\nFoamFile\n{\n    version 2.0;\n}\n");
  expectNamed("points", "a file of an OpenFOAM case");
  write("a.vtk", "version https://git-lfs.github.com/spec/v1\noid sha256:0a1b\nsize 1234\n");
  expectNamed("a.vtk", "a pointer of Git LFS in the place of the file itself (git lfs pull)");
  write("a.silo", "!<<PDB:II>>!\n$\4\2\4\4\4" + std::string(900, '\0'));
  expectNamed("a.silo", "a file of PDB or Silo, which is not read");
  write("a.mat", "MATLAB 5.0 MAT-file Platform: posix" + std::string(128, '\0'));
  expectNamed("a.mat", "a MATLAB file, which is not read");
  write("b.mat", "MATLAB 7.3 MAT-file, Platform: GLNXA64" + std::string(512, '\0'));
  expectNamed("b.mat", "a MATLAB file (HDF5), whose arrays an XDMF file has to describe");
  write("a.npy", "\x93NUMPY\1\0v\0{'descr': '<f4', 'fortran_order': False, 'shape': (6, 5, 7), }"s +
                     std::string(900, '\0'));
  expectNamed("a.npy", "a NumPy array without a grid");
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
  write("a.neu", "        CONTROL INFO 1.2.1\n** GAMBIT NEUTRAL FILE\nExample\n");
  expectNamed("a.neu", "a neutral file of GAMBIT");
  write("a.frd", "    1C\n    1UUSER                                                              \n");
  expectNamed("a.frd", "a result of CalculiX (.frd)");
  write("a.vrt", "PROSTAR_VERTEX\n     4020         0         0\n");
  expectNamed("a.vrt", "a mesh of STAR-CD");
  write("a.nek5000", "filetemplate: eddy_uv%01d.f%05d\nfirsttimestep: 1\nnumtimesteps: 11\n");
  expectNamed("a.nek5000", "a list of Nek5000's field files");
  write("a.2dm", "MESH2D\nE3T 1 1 2 3 1\nND 1 0 0 0\n");
  expectNamed("a.2dm", "a mesh of SMS (.2dm), which has no volume");
  write("a.ply", "ply\r\nformat ascii 1.0\r\n");
  expectNamed("a.ply", "a surface without a volume");
  write("a.mhd", "NDims = 3\nDimSize = 48 62 42\n");
  expectNamed("a.mhd", "a MetaImage, which is not read");
  write("b.mhd", "ObjectType = Image\nNDims = 3\n");
  expectNamed("b.mhd", "a MetaImage, which is not read");
  write("a.nrrd", "NRRD0004\n# Complete NRRD file format specification\ntype: short\n");
  expectNamed("a.nrrd", "an NRRD image, which is not read");
  write("a.nii", "\x5c\1\0\0"s + std::string(340, '\0') + "n+1\0"s + std::string(400, '\2'));
  expectNamed("a.nii", "a NIfTI image, which is not read");
  // Double precision, whose title may be empty but for a D.
  for (const bool big : {false, true}) {
    const auto marker = [&](char bytes) {
      return big ? std::string(3, '\0') + bytes : bytes + std::string(3, '\0');
    };
    write("a.slf", marker(80) + std::string(79, ' ') + "D" + marker(80) + marker(8) + marker(2) + marker(0) +
                       marker(8) + std::string(900, '\0'));
    expectNamed("a.slf", "a SELAFIN file of Telemac");
  }
  write("b.inp", "# by AVS\n4 1 0 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n1 0 tet 1 2 3 4\n");
  expectNamed("b.inp", "an AVS UCD mesh");
  // Binary, as AVS/Express writes it: a byte 7, then counts, here of a tetrahedron with a value at each node.
  for (const bool big : {false, true}) {
    std::string bytes(1, '\7');
    for (const char count : {4, 1, 1, 0, 0, 4})
      bytes += big ? std::string(3, '\0') + count : count + std::string(3, '\0');
    write("c.inp", bytes + std::string(100, '\1'));
    expectNamed("c.inp", "an AVS UCD mesh");
  }
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

TEST_F(ForeignFormats, FoldersAreNamed) {
  std::filesystem::create_directory(folder_ / "store.zarr");
  std::ofstream(folder_ / "store.zarr" / ".zarray") << "{}";
  expectNamed("store.zarr", "an array of a Zarr store; give the store");
  std::filesystem::create_directory(folder_ / "folder");
  expectNamed("folder", "a directory; expected");
  for (const char* file : {"manifest.json", "bricks.bin"}) std::ofstream(folder_ / "folder" / file) << "{}";
  expectNamed("folder", "a splat cache, which takes no further files");
  EXPECT_FALSE(isGridFolder(folder_ / "folder"));
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
  Hdf5Editor(file).group("/settings");
  expectNamed("plain.h5", "the data of a Fluent case; give the case first");
}

}  // namespace
}  // namespace curvisplat
