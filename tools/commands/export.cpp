// `curvisplat export`: a classified cut of a cache as 3D Gaussian splats, or its scalar on sparse regular grids.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/contour/contour.h"
#include "render/automatic/stored_steps.h"
#include "render/export/gaussian_files.h"
#include "render/export/gaussian_splats.h"
#include "render/export/iso_mesh.h"
#include "render/export/iso_mesh_file.h"
#include "render/export/vdb_file.h"
#include "render/frame/frame.h"
#include "render/image/too_little_memory.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/commands/commands.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/option_parsers.h"
#include "tools/options/picture_choice.h"
#include "tools/options/point_values.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/results.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

struct ExportArguments {
  std::filesystem::path cache, output;
  ScalarArguments scalar;
  std::optional<std::string> max_splats, voxels;
  std::optional<double> iso;
  bool of_source = false;                     // the isosurface is that of the grid's own cells
  std::vector<std::filesystem::path> source;  // its files; none: those that the cache names
  PointSource grid;
  std::string memory = "512M";
  StepArguments step;
  bool no_comparison = false;
};

constexpr uint64_t kMaxVoxels = 8192;  // along a side
constexpr const char *kDefaultSplats = "1M", *kDefaultVoxels = "256";

constexpr ImageSize kComparedSize{512, 512};

/// The corners of an icosahedron: twelve directions, evenly spread.
std::vector<glm::dvec3> twelveDirections() {
  const double golden = 0.5 * (1 + std::sqrt(5.0));
  std::vector<glm::dvec3> directions;
  for (const double one : {-1.0, 1.0})
    for (const double wide : {-golden, golden})
      for (const glm::dvec3& corner : {glm::dvec3(0, one, wide), {one, wide, 0}, {wide, 0, one}})
        directions.push_back(glm::normalize(corner));
  return directions;
}

struct Comparison {
  double mean_db = 0, least_db = 0;
};

/// The exported splats, drawn as their viewers do, against our own pictures.
Comparison compareExported(const CacheReader& cache, size_t variable, const TransferFunction& function,
                           const std::vector<GaussianSplat>& splats, uint64_t memory, Progress& progress) {
  const Manifest& manifest = cache.manifest();
  FrameRenderer renderer(cache, variable, function);
  FrameOptions options;
  options.size = kComparedSize;
  options.memory_bytes = memory;
  const std::vector<glm::dvec3> directions = twelveDirections();
  progress.begin("comparing", directions.size(), "pictures");
  double squares = 0, largest = 0;
  for (const glm::dvec3& direction : directions) {
    Camera camera;
    camera.focal_point = 0.5 * (manifest.lower + manifest.upper);
    camera.position = camera.focal_point + glm::length(manifest.upper - manifest.lower) * direction;
    camera.view_up = {0, 0, 1};
    camera.parallel_scale = camera.parallelScaleFor(manifest.lower, manifest.upper, kComparedSize);
    FrameStatistics statistics;
    const Image ours = renderer.render(camera, options, statistics);
    const double db = compareImages(drawGaussians(splats, camera, kComparedSize), ours).psnr_db;
    const double square = std::pow(10, -0.1 * db);
    squares += square / static_cast<double>(directions.size());
    largest = std::max(largest, square);
    progress.advance(1);
  }
  progress.end();
  return {-10 * std::log10(squares), -10 * std::log10(largest)};
}

double mebibytesOf(const std::filesystem::path& file) {
  return static_cast<double>(std::filesystem::file_size(file)) / (1 << 20);
}

uint32_t voxelsOf(const ExportArguments& arguments) {
  const uint64_t voxels = parseCount("--voxels", arguments.voxels.value_or(kDefaultVoxels));
  if (voxels > kMaxVoxels)
    throw UsageError("--voxels {}: expected at most {} along the longest side", voxels, kMaxVoxels);
  return static_cast<uint32_t>(voxels);
}

/// A mesh file that a contour of cells is written into.
class ContourFile : public TriangleSink {
 public:
  explicit ContourFile(IsoMeshFile& file) : file_(&file) {}
  void addVertex(const glm::dvec3& at, const glm::vec3& normal) override { file_->addVertex(at, normal); }
  void addTriangle(const std::array<uint32_t, 3>& corners) override { file_->addTriangle(corners); }

 private:
  IsoMeshFile* file_;
};

/// Warns if the files' values do not reach both ends of the cache's.
void warnOfOtherValues(const ContourOptions& expected, const ContourRange& found, const std::string& scalar) {
  const double rounding = 1e-6 * (expected.upper - expected.lower);
  if (found.lower <= expected.lower + rounding && found.upper >= expected.upper - rounding) return;
  printMessage(
      "warning: {} is from {:g} to {:g} in the cache, and of these values the files of --source have those "
      "from {:g} to {:g}; they may be of another time step",
      scalar, expected.lower, expected.upper, found.lower, found.upper);
}

/// Exports the isosurface of the grid's own cells.
void exportContour(const ExportArguments& arguments, const CacheReader& cache, size_t variable) {
  const VariableInfo& info = cache.manifest().variables[variable];
  if (cache.manifest().cells)
    throw UsageError(
        "--source: {} is cell-centred, and its cells have no isosurface of their own; leave --source out",
        info.name);
  const OpenSource source = openSource(cache, arguments.grid);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  ContourOptions options;
  options.scalar = source.scalars[variable];
  options.value = *arguments.iso;
  options.lower = source.ranges[variable].lower;
  options.upper = source.ranges[variable].upper;
  options.memory_bytes = parseMemory("--memory", arguments.memory);
  IsoMeshFile file(arguments.output);
  ContourFile sink(file);
  const auto* const mesh = dynamic_cast<const MeshSource*>(source.grid.get());
  const ContourRange found =
      mesh ? contourMesh(*mesh, options, ScratchFiles(writableTarget(arguments.output).parent_path()), sink,
                         progress)
           : contourGrid(dynamic_cast<const GridSource&>(*source.grid), options, sink, progress);
  if (file.triangles() == 0)
    throw Error("{}: no isosurface of {} at {:g}", arguments.grid.grid.grid.string(), info.name,
                options.value);
  file.finish(info.name, options.value);
  warnOfOtherValues(options, found, info.name);
  printLine("{}: isosurface of {} at {:g}: {} triangles, {} vertices, of the cells of {}, {:.1f} MiB",
            arguments.output.string(), info.name, options.value, file.triangles(), file.vertices(),
            arguments.grid.grid.grid.string(), mebibytesOf(arguments.output));
}

void exportIsosurface(ExportArguments& arguments) {
  IsoMeshOptions options;
  options.value = *arguments.iso;
  options.voxels = voxelsOf(arguments);
  options.memory_bytes = parseMemory("--memory", arguments.memory);
  const CacheReader cache = openAtStep(arguments.cache, arguments.step, arguments.scalar.scalar);
  const size_t variable = chooseVariable(cache, arguments.scalar);
  requireIsovalue(cache, variable, options.value);
  requireThreads();
  if (arguments.of_source) {
    const std::vector<std::filesystem::path>& files = arguments.source;
    setSource(cache, files, arguments.grid.grid);
    std::vector<std::filesystem::path> inputs = arguments.grid.grid.solutions;
    inputs.push_back(arguments.grid.grid.grid);
    checkOutputFile("-o", arguments.output, inputs);
    return exportContour(arguments, cache, variable);
  }
  for (const std::string& finer : finerThanStored(cache, {{}, {{variable, {options.value}}}}))
    printMessage("warning: {}", finer);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const IsoMeshReport report = writeIsoMesh(cache, variable, options, arguments.output, progress);
  printLine("{}: isosurface of {} at {:g}: {} triangles, {} vertices, voxels of {:g} units, {:.1f} MiB",
            arguments.output.string(), cache.manifest().variables[variable].name, options.value,
            report.triangles, report.vertices, report.voxel_size, mebibytesOf(arguments.output));
  constexpr double kThin = 0.01;
  if (report.thin_part > kThin)
    printMessage(
        "note: {:.0f} % of the cells that the isosurface may lie in are thinner than half a voxel, and it "
        "may be missing there; give --source for the isosurface of the grid's own cells, or more --voxels",
        100 * report.thin_part);
}

void exportVdb(const ExportArguments& arguments) {
  VdbOptions options;
  options.voxels = voxelsOf(arguments);
  options.memory_bytes = parseMemory("--memory", arguments.memory);
  const CacheReader cache = openAtStep(arguments.cache, arguments.step, arguments.scalar.scalar);
  const size_t variable = chooseVariable(cache, arguments.scalar);
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const VdbReport report = writeVdb(cache, variable, options, arguments.output, progress);
  printLine("{}: value and density of {} in {} voxels of {:g} units, {:.1f} MiB", arguments.output.string(),
            cache.manifest().variables[variable].name, report.active, report.voxel_size,
            mebibytesOf(arguments.output));
}

/// Why there was no memory for a comparison; empty if it failed for another reason.
std::string lackOfMemory(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error)) return "out of memory";
  if (dynamic_cast<const TooLittleMemory*>(&error)) return error.what();
  return isForLackOfThreads(error) ? kNoThread : "";
}

/// Compares. Nothing where there is no memory for it, which is no more than a warning: `file` is complete.
std::optional<Comparison> comparisonOf(const std::string& file, const std::function<Comparison()>& compare,
                                       Progress& progress) {
  try {
    return compare();
  } catch (const Interrupted& interrupted) {
    throw Interrupted(interrupted.signal(),
                      fmt::format("{}: is complete; its comparison was interrupted", file));
  } catch (const std::exception& error) {
    const std::string lack = lackOfMemory(error);
    if (lack.empty())
      throw Error("{}: is complete; it was not compared with curvisplat's pictures (--no-comparison): {}",
                  file, error.what());
    progress.end();
    printMessage(
        "warning: {}: is complete; it was not compared with curvisplat's pictures (--no-comparison): {}",
        file, lack);
    return {};
  }
}

/// Grids hold the scalar itself, as it is stored, and isosurfaces one value of it; splats are drawn.
void refuseOptionsOfOtherFiles(const ExportArguments& arguments, bool splats) {
  if (splats && arguments.voxels)
    throw UsageError("--voxels cannot be combined with {}: it is of .vdb files and --iso; give --max-splats",
                     arguments.output.string());
  std::string given = givenFunctionOptions(arguments.scalar);
  if (given.empty() && arguments.max_splats) given = "--max-splats";
  if (given.empty() && arguments.no_comparison) given = "--no-comparison";
  if (splats || given.empty()) return;
  if (arguments.iso)
    throw UsageError("{} cannot be combined with --iso: an isosurface has one value, without colours", given);
  throw UsageError("{} cannot be combined with {}: a .vdb file has the values of the scalar, without colours",
                   given, arguments.output.string());
}

void exportCache(ExportArguments& arguments) {
  const std::string extension = extensionOf(arguments.output);
  const bool vdb = extension == ".vdb";
  if (arguments.iso && !isIsoMeshName(arguments.output))
    throw UsageError("-o {}: expected a name that ends with .ply, .stl or .vtp for --iso",
                     arguments.output.string());
  if (!arguments.iso && (extension == ".stl" || extension == ".vtp"))
    throw UsageError("-o {}: {} files hold isosurfaces; give --iso VALUE", arguments.output.string(),
                     extension);
  if (!vdb && !arguments.iso) checkGaussianName(arguments.output);
  if (arguments.of_source && !arguments.iso) throw UsageError("--source needs an isosurface: --iso VALUE");
  if (arguments.of_source && arguments.voxels)
    throw UsageError(
        "--voxels cannot be combined with --source: the isosurface is that of the grid's own cells");
  refuseOptionsOfOtherFiles(arguments, !vdb && !arguments.iso);
  checkFunctionArguments(arguments.scalar);
  checkOutputFile("-o", arguments.output, {arguments.cache, arguments.scalar.transfer_function.value_or("")});
  if (arguments.iso) return exportIsosurface(arguments);
  if (vdb) return exportVdb(arguments);
  const uint64_t max_splats = parseCount("--max-splats", arguments.max_splats.value_or(kDefaultSplats));
  const uint64_t memory = parseMemory("--memory", arguments.memory);

  const CacheReader cache = openAtStep(arguments.cache, arguments.step, arguments.scalar.scalar);
  const size_t variable = chooseVariable(cache, arguments.scalar);
  PictureChoice choice(cache, variable, glm::dvec3(1));
  const TransferFunction function = choice.function(arguments.scalar);
  for (const std::string& note : function.notes()) printMessage("note: {}", note);
  const std::string finer = axisFinerThanStored(cache, {variable, function.axis()});
  if (!finer.empty()) printMessage("warning: {}", finer);

  if (!arguments.no_comparison) requireThreads();  // before the file is written
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  const std::vector<GaussianSplat> splats = gaussianSplats(cache, variable, function, max_splats, progress);
  if (splats.empty())
    throw Error(
        "{}: nothing to export: the transfer function makes all of {} transparent; give --opacity or a "
        "smaller --opacity-unit",
        arguments.cache.string(), cache.manifest().variables[variable].name);
  writeGaussians(splats, arguments.output);
  printLine("{}: {} splats of {}, {:.1f} MiB", arguments.output.string(), splats.size(),
            cache.manifest().variables[variable].name, mebibytesOf(arguments.output));
  if (!arguments.no_comparison) {
    const auto found = comparisonOf(
        arguments.output.string(),
        [&] { return compareExported(cache, variable, function, splats, memory, progress); }, progress);
    if (found)
      fmt::print("against curvisplat's own pictures from 12 directions: {:.1f} dB, {:.1f} dB at worst\n",
                 found->mean_db, found->least_db);
  }
  if (arguments.output.extension() == ".spz") {
    const SpzFrame frame = spzFrameOf(splats);
    fmt::print("a position p is stored as (p - ({:g}, {:g}, {:g})) * {:g}\n", frame.centre.x, frame.centre.y,
               frame.centre.z, frame.scale);
  }
  if (!choice.chosenOptions().empty()) printLine("chosen from the data: {}", choice.chosenOptions());
}

}  // namespace

void addExport(CLI::App& app) {
  auto arguments = std::make_shared<ExportArguments>();
  CLI::App* command = app.add_subcommand("export",
                                         "Export a cache as 3D Gaussian splats, which web viewers and game "
                                         "engines draw, as OpenVDB grids, or an isosurface as a mesh");
  command->add_option("CACHE", arguments->cache, "Splat cache, a directory NAME.splats")->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "File to write: .ply, .spz or .glb; .vdb for grids; with --iso .ply, .stl or .vtp")
      ->required();
  addScalarOption(*command, arguments->scalar);
  addFunctionOptions(*command, arguments->scalar, "Data and colours");
  addStepOptions(*command, arguments->step, "Data and colours");
  addMaxSplatsOption(*command, arguments->max_splats)->default_str(kDefaultSplats);
  command->add_option("--iso", arguments->iso, "Isosurface of this value, as triangles: .ply, .stl or .vtp");
  addSourceOption(*command, arguments->source,
                  ". --iso contours these cells, however thin they are; node-centred scalars only");
  addGasOptions(*command, arguments->grid.gas);
  command->add_option("--voxels", arguments->voxels, ".vdb, --iso: voxels along the longest side of the data")
      ->default_str(kDefaultVoxels);
  addMemoryOption(*command, arguments->memory,
                  ", for the grids, the isosurface, or the pictures of the comparison");
  command->add_flag(
      "--no-comparison", arguments->no_comparison,
      "Skip drawing the exported splats from 12 directions to compare them with curvisplat's pictures");
  command->callback([arguments, command] {
    arguments->of_source = command->count("--source") > 0;
    std::erase(arguments->source, "");  // what CLI11 makes of an option without values
    exportCache(*arguments);
  });
}

}  // namespace curvisplat
