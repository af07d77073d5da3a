// Reads VTK, CGNS and NetCDF files from the page cache into NodeArrays, on one thread: slabs of four planes,
// coordinates and one scalar, including the check for blanked samples. Items are values, bytes those of the
// file. plot3d_read_bench.cpp does the same with PLOT3D.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/node_reader.h"
#include "tests/support/cgns_writer.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

constexpr int kNodesAlongAxis = 96;
constexpr uint64_t kNodes = uint64_t{kNodesAlongAxis} * kNodesAlongAxis * kNodesAlongAxis;

using WriteGrid = std::function<void(const std::filesystem::path&)>;

void readFormat(benchmark::State& state, const char* file_name, const char* scalar, const WriteGrid& write) {
  const TemporaryFolder folder;
  OpenGridOptions options;
  options.grid = folder / file_name;
  options.temporary_folder = folder.path();
  write(options.grid);
  const auto source = openGrid(options);
  const NodeReader reader(*source, scalarsNamed(source->description(), {scalar}), std::nullopt);
  const GridBlock& block = source->description().blocks.at(0);
  NodeArrays nodes;
  for (auto _ : state)
    for (uint64_t k = 0; k < block.nk; k += 4) {
      reader.read(0, {0, block.nj, k, std::min(k + 4, block.nk)}, nodes);
      benchmark::DoNotOptimize(nodes.x.data());
    }
  const auto runs = static_cast<int64_t>(state.iterations());
  state.SetItemsProcessed(static_cast<int64_t>(4 * kNodes) * runs);
  state.SetBytesProcessed(static_cast<int64_t>(std::filesystem::file_size(options.grid)) * runs);
}

void readVts(benchmark::State& state, VtsEncoding::Format format, VtsEncoding::Compressor compressor) {
  VtsEncoding encoding;
  encoding.format = format;
  encoding.compressor = compressor;
  readFormat(state, "grid.vts", "p", [&](const std::filesystem::path& path) {
    VtsGrid grid = annulusVtsGrid(kNodesAlongAxis, kNodesAlongAxis, kNodesAlongAxis);
    std::erase_if(grid.point_data, [](const VtsArray& array) { return array.name != "p"; });
    grid.cell_data.clear();
    std::ofstream(path, std::ios::binary) << vtsFile(grid, encoding);
  });
}
using Format = VtsEncoding::Format;
using Compressor = VtsEncoding::Compressor;
BENCHMARK_CAPTURE(readVts, raw, Format::kAppendedRaw, Compressor::kNone)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readVts, raw_zlib, Format::kAppendedRaw, Compressor::kZlib)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readVts, raw_lz4, Format::kAppendedRaw, Compressor::kLz4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readVts, base64, Format::kInlineBase64, Compressor::kNone)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readVts, ascii, Format::kAscii, Compressor::kNone)->Unit(benchmark::kMillisecond);

void readCgns(benchmark::State& state, CgnsFileType type) {
  readFormat(state, "grid.cgns", "Pressure", [&](const std::filesystem::path& path) {
    CgnsWriter file(path, type);
    file.base("base");
    file.zone("zone", {kNodesAlongAxis, kNodesAlongAxis, kNodesAlongAxis});
    const auto along = [](double i, double j, double k) {
      return [=](int64_t at_i, int64_t at_j, int64_t at_k) {
        return i * static_cast<double>(at_i) + j * static_cast<double>(at_j) + k * static_cast<double>(at_k);
      };
    };
    file.coordinates("GridCoordinates", {{"CoordinateX", along(1, 0.1, 0)},
                                         {"CoordinateY", along(0, 1, 0.1)},
                                         {"CoordinateZ", along(0.1, 0, 1)}});
    file.solution("flow", "Vertex", {{"Pressure", along(1, 2, 3)}});
  });
}
BENCHMARK_CAPTURE(readCgns, hdf5, CgnsFileType::kHdf5)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readCgns, adf, CgnsFileType::kAdf)->Unit(benchmark::kMillisecond);

/// One-dimensional longitude, latitude and depth, which the reader maps to the globe.
void readNetcdf(benchmark::State& state, NetcdfFileType type) {
  readFormat(state, "grid.nc", "temp", [&](const std::filesystem::path& path) {
    NetcdfWriter file(path, type);
    const auto axis = [&](const char* name, const NetcdfAttributes& attributes, double step) {
      file.dimension(name, kNodesAlongAxis);
      file.variable(name, NetcdfNumbers::kDoublePrecision, {name}, attributes,
                    [=](const std::vector<size_t>& at) { return 1 + step * static_cast<double>(at[0]); });
    };
    axis("depth", {{"units", NetcdfText("m")}, {"positive", NetcdfText("down")}, {"axis", NetcdfText("Z")}},
         10);
    axis("lat", {{"units", NetcdfText("degrees_north")}}, 0.1);
    axis("lon", {{"units", NetcdfText("degrees_east")}}, 0.1);
    file.variable(
        "temp", NetcdfNumbers::kSinglePrecision, {"depth", "lat", "lon"}, {{"units", NetcdfText("degC")}},
        [](const std::vector<size_t>& at) { return static_cast<double>(at[0] + 2 * at[1] + 3 * at[2]); });
  });
}
BENCHMARK_CAPTURE(readNetcdf, classic, NetcdfFileType::kClassic)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readNetcdf, netcdf4, NetcdfFileType::kNetcdf4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(readNetcdf, netcdf4_compressed, NetcdfFileType::kNetcdf4Compressed)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace curvisplat
