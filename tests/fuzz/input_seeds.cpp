#include "tests/fuzz/seeds.h"

#include <fmt/format.h>
#include <zstd.h>

#include <fstream>

#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/earth_files.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
#include "tests/support/vts_writer.h"
#include "tools/view/view_state.h"
namespace curvisplat {
namespace {

namespace fs = std::filesystem;

void writeTexts(const Seeds& seeds) {
  for (const char* name : {"viridis", "cool-warm", "grey"}) {
    try {
      seeds.write("transfer_function", name, toParaViewPreset(presetDefinition(name)));
    } catch (const UsageError&) {
    }
  }
  seeds.write("transfer_function", "all_fields",
              R"([{"Name": "a", "ColorSpace": "Diverging", "HSVWrap": false, "UseLogScale": 1,
 "RGBPoints": [0.1, 0, 0.2, 1, 1, 0.5, 0.5, 0.5, 10, 1, 0, 0], "NanColor": [1, 1, 0],
 "Points": [0.1, 0, 0.5, 0, 2, 0.7, 0.2, 1, 10, 1, 0.5, 0.5], "ScalarOpacityUnitDistance": 0.25,
 "UseBelowRangeColor": 1, "IndexedLookup": false}, {"Name": "b"}])");
  seeds.write(
      "transfer_function", "step",
      R"({"ColorSpace": "Step", "RGBPoints": [-1, 0, 0, 0, 1, 1, 1, 1], "IndexedColors": [1, 0, 0]})");
  seeds.write("camera_path", "orthographic", R"({"key_frames": [
 {"time": 0, "position": [1, 2, 3], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "parallel_scale": 2},
 {"time": 1.5, "position": [3, 2, 1], "focal_point": [0, 0.5, 0], "view_up": [0, 1, 0], "parallel_scale": 1},
 {"time": 2, "position": [-3, 2, 1], "focal_point": [0, 0.5, 0], "view_up": [0, -1, 0], "parallel_scale": 3}]})");
  seeds.write("camera_path", "perspective", R"({"key_frames": [
 {"time": -1, "position": [1, 2, 3], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "view_angle": 30},
 {"time": 1e3, "position": [-1, 2, -3], "focal_point": [0, 0, 0], "view_up": [1, 2, 3], "view_angle": 170}]})");
  seeds.write("camera_path", "film", R"({"scalar": "a", "key_frames": [
 {"time": 0, "position": [1, 2, 3], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "parallel_scale": 2,
  "function": {"map": "viridis", "range": [0, 2], "opacities": "0:0,0.5:0.7,1:0.1", "opacity_unit": 0.1},
  "clip_box": [0, 1, 0, 1, 0, 1], "clip_planes": [[0, 0, 0.5, 0, 0, 1]], "slices": [[0.5, 0, 0, 1, 0, 0]]},
 {"time": 1, "position": [3, 2, 1], "focal_point": [0, 0.5, 0], "view_up": [0, 1, 0], "parallel_scale": 1,
  "function": {"RGBPoints": [0, 0, 0, 1, 1, 1, 0, 0], "Points": [0, 0, 0.5, 0.5, 1, 1, 0.5, 0], "ColorSpace": "HSV",
   "ScalarOpacityUnitDistance": 1}, "clip_planes": [[0, 0, 0.5, 0, 0, -1]]}]})");
  for (const char* name : {"q", "function"})
    seeds.write(
        "plot3d_meta", name,
        fmt::format(
            R"({{"filenames": [{{"time": 0.5, "xyz": "a.xyz", "{}": "a.{}"}}, {{"time": 1, "xyz": "a.xyz"}}],
 "function-names": ["u", "v"], "gamma": 1.4, "R": 1, "auto-detect-format": true, "format": "binary",
 "language": "C", "byte-order": "little", "precision": 32, "multi-grid": false, "blanking": false, "2D": false,
 "functions": [110, 120, 130, 140, 144, 153, 163, 170, 184, 200, 201, 210]}})",
            name, name[0]));
  const Manifest manifest = [] {
    Manifest of_cache;
    of_cache.lower = {-1, 2, 3};
    of_cache.upper = {3, 6, 7};
    of_cache.variables = {{0, "density", "", 0, 1}, {1, "mach", "", 0.1, 2}};
    return of_cache;
  }();
  ViewState state = firstViewOf(manifest, {600, 400});
  seeds.write("view_state", "first", toJson(state));
  state.clip_box = WorldBox{{0, 3, 4}, {1, 4, 5}};
  state.camera.projection = Projection::kPerspective;
  state.function.addPoint(0.3, 0.4);
  seeds.write("view_state", "changed", toJson(state));
  seeds.write(
      "client_message", "view",
      R"({"type": "view", "number": 7, "cache": 0, "size": [800, 600], "moving": true, "step": 0, "next": 1, "state": )" +
          toJson(state) + "}");
  seeds.write("client_message", "open", R"({"type": "open", "cache": 0, "size": [800, 600]})");
  seeds.write("client_message", "choose", R"({"type": "choose", "cache": 2, "scalar": "density"})");
  seeds.write(
      "client_message", "histogram",
      R"({"type": "histogram", "cache": 0, "scalar": "density", "low": 0.1, "high": 1, "log": true})");
  seeds.write("client_message", "colours", R"({"type": "colours", "map": "viridis"})");
  seeds.write("client_message", "command",
              R"({"type": "command", "cache": 0, "size": [30, 20], "step": 0, "state": {}})");
  seeds.write("client_message", "pick", R"({"type": "pick", "x": 0.25, "y": 1})");
  seeds.write("client_message", "shown", R"({"type": "shown", "picture": 3})");
}

void writeImages(const Seeds& seeds) {
  const TemporaryFolder folder;
  Image image({5, 3});
  for (size_t n = 0; n < image.rgba.size(); ++n) image.rgba[n] = static_cast<float>(n % 7) / 7;
  for (const char* name : {"a.png", "a.exr", "a.pfm"}) {
    writeImage(image, folder / name);
    seeds.write("image", name, bytesOfFile(folder / name));
  }
  seeds.write("image", "grey.pfm", Seed().text("Pf\n2 1\n1.0\n").add(1.0f).add(2.0f).whole());
}

void writePlot3d(const Seeds& seeds) {
  using test::plot3dBytes, test::plot3dText, test::testBlock;
  const auto write = [&](const char* target, const std::string& name, uint8_t flags,
                         std::span<const std::byte> grid, std::span<const std::byte> solution) {
    const auto bytes = static_cast<uint16_t>(grid.size());
    seeds.write(target, name, Seed().add(flags).add(bytes).bytes(grid).bytes(solution).whole());
  };
  const std::vector<test::TestBlock> blocks{testBlock(4, 3, 3, 5), testBlock(3, 4, 2, 5, 5)};
  for (const RecordMarkers records : {RecordMarkers::kNone, RecordMarkers::kBytes4, RecordMarkers::kBytes8})
    for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
      const bool multi = order == ByteOrder::kBig;
      Plot3dLayout grid{Plot3dKind::kGrid, false, order, records, multi ? 4 : 8, multi, multi, false};
      Plot3dLayout solution = grid;
      solution.blanking = false;
      solution.kind = records == RecordMarkers::kBytes4 ? Plot3dKind::kFunction : Plot3dKind::kQ;
      const std::span used(blocks.data(), multi ? 2u : 1u);
      const std::vector<test::TestBlock> of_file(used.begin(), used.end());
      write("plot3d", fmt::format("records_{}_{}", static_cast<int>(records), multi ? "big" : "little"), 0,
            plot3dBytes(grid, of_file), plot3dBytes(solution, of_file));
    }
  Plot3dLayout cut{
      Plot3dKind::kGrid, false, ByteOrder::kLittle, RecordMarkers::kBytes4, 4, false, false, false};
  write("plot3d", "subrecords", 0, plot3dBytes(cut, {blocks[0]}, 100), {});
  for (const bool multi : {false, true}) {
    Plot3dLayout grid{
        Plot3dKind::kGrid, true, ByteOrder::kLittle, RecordMarkers::kNone, 8, multi, multi, false};
    Plot3dLayout solution = grid;
    solution.blanking = false;
    solution.kind = multi ? Plot3dKind::kFunction : Plot3dKind::kQ;
    std::vector<test::TestBlock> of_file{testBlock(3, 3, 2, 5)};
    if (multi) of_file.push_back(testBlock(2, 2, 3, 5, 5));
    write("plot3d_ascii", multi ? "blocks" : "one", 0, plot3dText(grid, of_file),
          plot3dText(solution, of_file));
  }
}

void writeVtk(const Seeds& seeds) {
  const VtsGrid grid = annulusVtsGrid(3, 3, 2);
  for (const VtsEncoding& encoding : allVtsEncodings()) {
    // Other block sizes than VTK's: several blocks in a small file.
    VtsEncoding small = encoding;
    small.block_bytes = 100;
    if (small.header_bytes == 8 && small.big_endian) continue;
    std::string name = small.describe();
    std::replace_if(
        name.begin(), name.end(), [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
    seeds.write("vtk_xml", name, vtsFile(grid, small));
  }
  seeds.write("vtk_xml", "uniform", R"(<VTKFile type="ImageData" version="0.1" byte_order="LittleEndian">
<ImageData WholeExtent="2 4 -1 1 0 1" Origin="1 2 3" Spacing="0.5 0.25 2" Direction="0 -1 0 1 0 0 0 0 1">
<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">0.5</DataArray></FieldData>
<Piece Extent="2 4 -1 1 0 1"><PointData Scalars="p"><DataArray type="UInt8" Name="vtkGhostType" format="ascii">
0 0 0 0 0 0 0 0 0 2 2 2 0 0 0 0 0 0</DataArray><DataArray type="Int16" Name="p" format="ascii">
1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18</DataArray></PointData><CellData></CellData></Piece></ImageData></VTKFile>)");
  seeds.write("vtk_xml", "rectilinear",
              R"(<VTKFile type="RectilinearGrid" version="0.1" byte_order="LittleEndian">
<RectilinearGrid WholeExtent="0 2 0 1 0 1"><Piece Extent="0 2 0 1 0 1"><CellData Scalars="c">
<DataArray type="Float32" Name="c" format="ascii">1 2</DataArray></CellData><PointData/><Coordinates>
<DataArray type="Float32" Name="x" format="ascii">0 1 3</DataArray><DataArray type="Float32" Name="y" format="ascii">
0 1</DataArray><DataArray type="Float64" Name="z" format="ascii">0 0.5</DataArray></Coordinates></Piece>
</RectilinearGrid></VTKFile>)");
  seeds.write("vtk_set", "pieces.pvts",
              R"(<VTKFile type="PStructuredGrid" version="0.1" byte_order="LittleEndian">
<PStructuredGrid WholeExtent="0 5 0 7 0 6" GhostLevel="1"><PPointData Scalars="RTData"><PDataArray type="Float32" Name="RTData"/>
</PPointData><PPoints><PDataArray type="Float64" Name="Points" NumberOfComponents="3"/></PPoints>
<Piece Extent="0 5 0 4 0 6" Source="ghosts_0.vts"/><Piece Extent="0 5 2 7 0 6" Source="ghosts_1.vts"/></PStructuredGrid></VTKFile>)");
  seeds.write("vtk_set", "pieces.pvti", R"(<VTKFile type="PImageData" version="0.1" byte_order="LittleEndian">
<PImageData WholeExtent="0 5 0 7 0 6" GhostLevel="1" Origin="0 0 0" Spacing="1 1 1"><PPointData Scalars="RTData"/>
<Piece Extent="0 5 0 4 0 6" Source="ghosts_0.vti"/><Piece Extent="0 5 2 7 0 6" Source="ghosts_1.vti"/></PImageData></VTKFile>)");
  seeds.write("vtk_set", "steps.pvd",
              R"(<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>
<DataSet timestep="1.25" group="" part="0" file="step1.vts"/><DataSet timestep="0.5" group="" part="0" file="step0.vts"/>
</Collection></VTKFile>)");
  seeds.write("vtk_set", "blocks.vtm",
              R"(<VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet>
<DataSet index="0" name="inlet" file="step0.vts"/><Block index="1" name="b"><DataSet index="0" file="ghosts_0.vts"/></Block>
<DataSet index="2" name="outlet" file="step1.vts"/></vtkMultiBlockDataSet></VTKFile>)");
  seeds.write("vtk_legacy", "structured", R"(# vtk DataFile Version 3.0
title
ASCII
DATASET STRUCTURED_GRID
DIMENSIONS 3 2 2
POINTS 12 float
0 0 0 1 0 0 2 0 0 0 1 0 1 1 0 2 1 0
0 0 1 1 0 1 2 0 1 0 1 1 1 1 1 2 1 1
POINT_DATA 12
SCALARS p double 1
LOOKUP_TABLE default
1 2 3 4 5 6 7 8 9 10 11 12
VECTORS u float
1 2 3 4 5 6 7 8 9 10 11 12 1 2 3 4 5 6 7 8 9 10 11 12 1 2 3 4 5 6 7 8 9 10 11 12
FIELD FieldData 1
q 2 12 int
1 2 3 4 5 6 7 8 9 10 11 12 1 2 3 4 5 6 7 8 9 10 11 12
CELL_DATA 2
SCALARS c short
LOOKUP_TABLE t
3 4
LOOKUP_TABLE t 2
0 0 0 1 1 1 1 1
)");
  seeds.write("vtk_legacy", "uniform", R"(# vtk DataFile Version 2.0
title
ASCII
DATASET STRUCTURED_POINTS
DIMENSIONS 2 2 2
ORIGIN 0 0 0
SPACING 1 0.5 2
POINT_DATA 8
METADATA
INFORMATION 0

TENSORS t float
1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9
1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9
)");
  seeds.write("vtk_legacy", "binary",
              "# vtk DataFile Version 5.1\ntitle\nBINARY\nDATASET RECTILINEAR_GRID\nDIMENSIONS 2 3 "
              "2\nX_COORDINATES 2 "
              "float\n" +
                  packedNumbers({0, 1}, "Float32", true) + "\nY_COORDINATES 3 double\n" +
                  packedNumbers({0, 1, 3}, "Float64", true) + "\nZ_COORDINATES 2 float\n" +
                  packedNumbers({0, 1}, "Float32", true) +
                  "\nPOINT_DATA 12\nSCALARS p short\nLOOKUP_TABLE default\n" +
                  packedNumbers({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, "Int16", true) + "\n");
}

void writeNetcdf(const Seeds& seeds) {
  const TemporaryFolder folder;
  for (const bool records : {false, true}) {
    {
      NetcdfWriter file(folder / "a.nc", NetcdfFileType::kClassic);
      file.dimension("time", 2, records);
      file.dimension("x", 3);
      const auto value = [](const std::vector<size_t>& at) { return static_cast<double>(at.back()); };
      file.variable("x", NetcdfNumbers::kDoublePrecision, {"x"}, {{"units", "m"}}, value);
      file.variable("f", NetcdfNumbers::kInt16, {"time", "x"}, {{"scale_factor", NetcdfNumberList{0.5}}},
                    value);
      file.variable("g", NetcdfNumbers::kSinglePrecision, {"time", "x"}, {}, value);
    }
    seeds.write("netcdf_classic", records ? "records" : "fixed", bytesOfFile(folder / "a.nc"));
  }
}

/// Writes files as models of the ocean and the atmosphere do.
void writeModels(const Seeds& seeds) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.nc";
  const auto write = [&](const std::string& name, uint8_t flags) {
    const std::string file = bytesOfFile(path);
    seeds.write("cf_grid", name,
                Seed().add(flags).add(static_cast<uint16_t>(file.size())).text(file).whole());
  };
  for (const char* coordinate : {"ocean_s_coordinate_g2", "ocean_s_coordinate", "ocean_sigma_coordinate"}) {
    roms::write(path, NetcdfFileType::kClassic, coordinate);
    write(fmt::format("roms_{}", coordinate), 2);
  }
  for (const bool partial_cells : {false, true}) {
    nemo::write(path, NetcdfFileType::kClassic, partial_cells);
    write(partial_cells ? "nemo_partial_cells" : "nemo", 0);
  }
  wrf::write(path, NetcdfFileType::kClassic);
  write("wrf", 2);
}

/// Writes trajectories as a full array, and as ragged ones by counts and by the number of each observation's line.
void writeTrajectories(const Seeds& seeds) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.nc";
  using Index = std::vector<size_t>;
  constexpr auto kNumbers = NetcdfNumbers::kSinglePrecision;
  const auto number = [](const Index& at) { return static_cast<double>(at.back()); };
  for (const char* kind : {"full", "counts", "numbers"}) {
    {
      NetcdfWriter file(path, NetcdfFileType::kClassic);
      file.dimension("line", 2);
      file.dimension("obs", 4);
      const bool full = kind == std::string("full");
      const std::vector<std::string> dims =
          full ? std::vector<std::string>{"line", "obs"} : std::vector<std::string>{"obs"};
      if (kind == std::string("counts"))
        file.variable("count", NetcdfNumbers::kInt16, {"line"}, {{"sample_dimension", "obs"}},
                      [](const Index& at) { return at[0] == 0 ? 1.0 : 3.0; });
      if (kind == std::string("numbers"))
        file.variable("of", NetcdfNumbers::kInt16, {"obs"}, {{"instance_dimension", "line"}},
                      [](const Index& at) { return static_cast<double>(at[0] % 2); });
      file.variable("time", kNumbers, dims, {{"units", "days since 2001-01-01"}}, number);
      file.variable("lon", kNumbers, dims, {{"units", "degrees_east"}}, number);
      file.variable("lat", kNumbers, dims, {{"units", "degrees_north"}}, number);
      file.variable("z", kNumbers, full ? dims : std::vector<std::string>{"obs"},
                    {{"units", "m"}, {"positive", "down"}}, number);
      file.variable("p", kNumbers, full ? std::vector<std::string>{"line"} : dims, {}, number);
    }
    seeds.write("trajectories", kind, Seed().add(uint8_t{1}).text(bytesOfFile(path)).whole());
  }
}

/// A grid, and one followed by empty lines, as long as the buffer into which they are decompressed.
void writeCompressed(const Seeds& seeds) {
  const std::string text = std::string("# vtk DataFile Version 2.0\na\nASCII\nDATASET STRUCTURED_POINTS\n") +
                           "DIMENSIONS 2 2 2\nORIGIN 0 0 0\nSPACING 1 1 1\nPOINT_DATA 8\nSCALARS p float\n" +
                           "LOOKUP_TABLE default\n1 2 3 4 5 6 7 8\n";
  for (const bool full : {false, true}) {
    std::string file = text;
    if (full) file.resize(1 << 20, '\n');
    std::string packed(ZSTD_compressBound(file.size()), '\0');
    packed.resize(ZSTD_compress(packed.data(), packed.size(), file.data(), file.size(), 3));
    seeds.write("unpacked_file", full ? "full.zst" : "grid.zst", packed);
  }
}

void writeMeshes(const Seeds& seeds) {
  Seed stl;
  stl.add(uint8_t{0}).text(std::string(80, ' ')).add(uint32_t{1});
  for (const float x : {0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) stl.add(x);
  seeds.write("mesh", "binary_stl", stl.add(uint16_t{0}).whole());
  seeds.write("mesh", "ascii_stl",
              Seed()
                  .add(uint8_t{0})
                  .text("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                        "endloop\nendfacet\nendsolid a\n")
                  .whole());
  const std::string elements =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n";
  seeds.write("mesh", "ascii_ply",
              Seed()
                  .add(uint8_t{1})
                  .text("ply\nformat ascii 1.0\n" + elements + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
                  .whole());
  Seed ply;
  ply.add(uint8_t{1}).text("ply\nformat binary_little_endian 1.0\n" + elements);
  for (const float x : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) ply.add(x);
  seeds.write("mesh", "binary_ply", ply.add(uint8_t{3}).add(0).add(1).add(2).whole());
  seeds.write("mesh", "obj",
              Seed().add(uint8_t{2}).text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1 2//2 -2 4\n").whole());
}

}  // namespace

void writeInputSeeds(const Seeds& seeds) {
  writeTexts(seeds);
  writeImages(seeds);
  writePlot3d(seeds);
  writeVtk(seeds);
  writeNetcdf(seeds);
  writeModels(seeds);
  writeTrajectories(seeds);
  writeCompressed(seeds);
  writeMeshes(seeds);
}

}  // namespace curvisplat
