#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/formats/vtk/vtk_mesh_source.h"
#include "preprocess/formats/vtk/vtk_source.h"
#include "preprocess/formats/vtk/vtk_xml.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using SetElement = pugi::xml_node;

constexpr size_t kMaxFiles = 100'000;

/// Returns a checksum of the first and the last points of each piece or block, and of how many there are.
uint64_t checksumOfFirstAndLast(const DataSource& source) {
  constexpr uint64_t kSome = 4096;
  std::vector<uint64_t> sums;
  const auto add = [&](const auto& points) {
    for (const auto* axis : {&points.x, &points.y, &points.z})
      sums.push_back(checksumOf(std::as_bytes(std::span(*axis))));
  };
  const GridDescription& description = source.description();
  if (const auto* mesh = dynamic_cast<const MeshSource*>(&source)) {
    MeshPoints points;
    for (uint32_t piece = 0; piece < description.pieces.size(); ++piece) {
      const uint64_t all = description.pieces[piece].points, some = std::min(kSome, all);
      sums.push_back(all);
      for (const uint64_t first : {uint64_t{0}, all - some}) {
        mesh->readPoints(piece, first, some, {}, points);
        add(points);
      }
    }
  } else if (const auto* grid = dynamic_cast<const GridSource*>(&source)) {
    NodeArrays nodes;
    for (uint32_t block = 0; block < description.blocks.size(); ++block) {
      const GridBlock& of = description.blocks[block];
      sums.insert(sums.end(), {of.ni, of.nj, of.nk});
      grid->read(block, {0, 1, 0, 1}, {}, nodes);
      add(nodes);
      grid->read(block, {of.nj - 1, of.nj, of.nk - 1, of.nk}, {}, nodes);
      add(nodes);
    }
  }
  return checksumOf(std::as_bytes(std::span(sums)));
}

/// Follows the references of a file to other files, and gathers their pieces.
class Gatherer {
 public:
  explicit Gatherer(const OpenGridOptions& options)
      : files_(options.temporary_folder),
        temporary_folder_(options.temporary_folder),
        names_folder_(options.namesFolder()),
        time_step_(options.time_step) {}

  std::unique_ptr<DataSource> gather(const fs::path& path) {
    add(path, "");
    if (grid_.pieces.empty() && mesh_.pieces.empty())
      throw Error("{}: contains no structured grid and no unstructured one{}", path.string(),
                  left_out_.empty() ? "" : ": " + left_out_);
    if (grid_.pieces.empty()) return std::make_unique<VtkMeshSource>(finishMesh());
    return std::make_unique<VtkSource>(finishGrid());
  }

 private:
  VtkMesh finishMesh() {
    warnOfLeftOut("unstructured");
    mesh_.format = describe(mesh_type_, mesh_encoding_, countText(mesh_.pieces.size(), "piece"));
    mesh_.files = std::move(grid_.files);
    mesh_.times = std::move(grid_.times);
    mesh_.time_step = grid_.time_step;
    mesh_.warnings = std::move(grid_.warnings);
    return std::move(mesh_);
  }

  VtkGrid finishGrid() {
    for (const MeshPiece& piece : mesh_.names)
      if (left_out_files_++ == 0) left_out_ = fmt::format("{} is of type {}", piece.file, mesh_type_);
    warnOfLeftOut("structured");
    grid_.format = describe(leaf_type_, encoding_, countText(grid_.blocks.size(), "block"));
    return std::move(grid_);
  }

  /// `kind`: of the grids that are read.
  void warnOfLeftOut(const char* kind) {
    if (!left_out_.empty())
      grid_.warnings.push_back(fmt::format("{} without {} grids {} left out: {}",
                                           countText(left_out_files_, "file"), kind, isOrAre(left_out_files_),
                                           left_out_));
  }

  std::string describe(const std::string& type, const std::string& encoding, const std::string& parts) const {
    return fmt::format("VTK XML {}{}, {}, {}", top_type_, top_type_ == type ? "" : " of " + type, encoding,
                       parts);
  }

  void add(const fs::path& path, const std::string& name) {
    std::error_code error;
    const fs::path normal = fs::weakly_canonical(path, error);
    if (error) throw Error("{}: cannot be opened: {}", path.string(), error.message());
    if (!inside_.insert(normal).second) throw Error("{}: contains itself", path.string());
    if (grid_.files.size() > kMaxFiles)
      throw Error("{}: refers to more than {} files, counting repetitions", grid_.files.front(), kMaxFiles);
    const VtkXmlFile file(files_, path);
    grid_.files.push_back(path.string());
    if (top_type_.empty()) top_type_ = file.type();
    if (hasXmlPieces(file.type()))
      addPieces(file, name);
    else if (hasXmlMeshPieces(file.type()))
      addMesh(file, name);
    else if (file.type().starts_with('P') && hasXmlMeshPieces(file.type().substr(1)))
      addParallelMesh(file, name);
    else if (file.type().starts_with('P') && hasXmlPieces(file.type().substr(1)))
      addParallel(file, name);
    else if (file.type() == "vtkMultiBlockDataSet" || file.type() == "vtkPartitionedDataSet" ||
             file.type() == "vtkPartitionedDataSetCollection")
      addMembers(file, file.content(), name);
    else if (file.type() == "vtkOverlappingAMR" || file.type() == "vtkHierarchicalBoxDataSet")
      addAmr(file, name);
    else if (file.type() == "Collection")
      addTimeStep(file);
    else if (inside_.size() == 1)
      file.fail(
          fmt::format("is a VTK file of type {}; expected StructuredGrid, RectilinearGrid, ImageData, "
                      "UnstructuredGrid, or a collection of these",
                      file.type()));
    else
      leaveOut(file);
    inside_.erase(normal);
  }

  void leaveOut(const VtkXmlFile& file) {
    if (left_out_files_++ == 0) left_out_ = fmt::format("{} is of type {}", file.name(), file.type());
  }

  fs::path pathOf(const VtkXmlFile& file, const SetElement& node, const char* attribute) const {
    const std::string named = node.attribute(attribute).value();
    if (named.empty()) file.fail(fmt::format("has a <{}> without {}", node.name(), attribute));
    const bool is_first = inside_.size() == 1;
    return existingFile(file.name() + ':', is_first ? names_folder_ : file.path().parent_path(), named);
  }

  /// Appends pieces, and a block for each part of them.
  void append(std::vector<VtkPiece> pieces, const std::vector<std::string>& names) {
    std::vector<VtkExtent> extents;
    for (const VtkPiece& piece : pieces) extents.push_back(piece.extent);
    const std::vector<std::vector<VtkExtent>> parts = ownedParts(extents);
    for (size_t n = 0; n < pieces.size(); ++n) {
      if (grid_.pieces.size() == kMaxVtkPieces)
        throw Error("{}: has more than {} pieces", grid_.files.front(), kMaxVtkPieces);
      for (size_t part = 0; part < parts[n].size(); ++part)
        grid_.blocks.push_back({part == 0 ? names[n] : fmt::format("{}.{}", names[n], part + 1),
                                grid_.pieces.size(), parts[n][part]});
      grid_.pieces.push_back(std::move(pieces[n]));
    }
  }

  VtkXmlPieces piecesOf(const VtkXmlFile& file) {
    VtkXmlPieces read = readXmlPieces(file, grid_.warnings);
    if (leaf_type_.empty()) {
      leaf_type_ = file.type();
      encoding_ = read.encoding;
    }
    if (grid_.times.empty() && read.time) grid_.times = {*read.time};
    return read;
  }

  void addPieces(const VtkXmlFile& file, const std::string& name) {
    VtkXmlPieces read = piecesOf(file);
    std::vector<std::string> names;
    for (size_t n = 0; n < read.pieces.size(); ++n)
      names.push_back(name.empty()              ? fmt::format("block {}", n + 1)
                      : read.pieces.size() == 1 ? name
                                                : fmt::format("{}.{}", name, n + 1));
    append(std::move(read.pieces), names);
  }

  void addMesh(const VtkXmlFile& file, const std::string& name) {
    VtkXmlMeshPieces read = readXmlMeshPieces(file, grid_.warnings);
    if (mesh_type_.empty()) {
      mesh_type_ = file.type();
      mesh_encoding_ = read.encoding;
    }
    if (grid_.times.empty() && read.time) grid_.times = {*read.time};
    for (size_t n = 0; n < read.pieces.size(); ++n) {
      if (mesh_.pieces.size() == kMaxVtkPieces)
        throw Error("{}: has more than {} pieces", grid_.files.front(), kMaxVtkPieces);
      mesh_.names.push_back({name.empty()              ? fmt::format("piece {}", mesh_.pieces.size() + 1)
                             : read.pieces.size() == 1 ? name
                                                       : fmt::format("{}.{}", name, n + 1),
                             file.name(), std::get<VtkPoints>(read.pieces[n].nodes).tuples,
                             read.cells[n].cells});
      mesh_.pieces.push_back(std::move(read.pieces[n]));
      mesh_.cells.push_back(std::move(read.cells[n]));
    }
  }

  void addParallelMesh(const VtkXmlFile& file, const std::string& name) {
    for (const SetElement& node : file.content().children("Piece")) {
      const VtkXmlFile piece_file(files_, pathOf(file, node, "Source"));
      if ("P" + piece_file.type() != file.type())
        piece_file.fail(fmt::format("is a {}, but belongs to a {}", piece_file.type(), file.type()));
      grid_.files.push_back(piece_file.name());
      addMesh(piece_file, name + (name.empty() ? "" : "/") + piece_file.path().stem().string());
    }
  }

  void addParallel(const VtkXmlFile& file, const std::string& name) {
    std::vector<VtkPiece> pieces;
    std::vector<std::string> names;
    for (const SetElement& node : file.content().children("Piece")) {
      const std::optional<VtkExtent> extent = file.extent(node, "Extent");
      if (!extent) continue;
      const VtkXmlFile piece_file(files_, pathOf(file, node, "Source"));
      if ("P" + piece_file.type() != file.type())
        piece_file.fail(fmt::format("is a {}, but belongs to a {}", piece_file.type(), file.type()));
      grid_.files.push_back(piece_file.name());
      for (VtkPiece& piece : piecesOf(piece_file).pieces) {
        for (size_t axis = 0; axis < 3; ++axis)
          if (piece.extent.lower[axis] < extent->lower[axis] ||
              piece.extent.upper[axis] > extent->upper[axis])
            piece_file.fail(fmt::format("has a piece of {} nodes that is not within its extent in {}",
                                        piece.extent.describe(), file.name()));
        pieces.push_back(std::move(piece));
        names.push_back(
            fmt::format("{}{}{}", name, name.empty() ? "" : "/", piece_file.path().stem().string()));
      }
    }
    append(std::move(pieces), names);
  }

  /// Adds the files below an element. Their blocks are named by the path of element names, or by the file.
  void addMembers(const VtkXmlFile& file, const SetElement& element, const std::string& name) {
    for (const SetElement& node : element.children()) {
      if (node.type() != pugi::node_element) continue;
      const std::string own = node.attribute("name").value();
      const std::string separator = name.empty() || own.empty() ? "" : "/";
      if (std::string_view(node.name()) != "DataSet")
        addMembers(file, node, name + separator + own);
      else if (node.attribute("file")) {  // absent for an empty block
        const fs::path path = pathOf(file, node, "file");
        add(path,
            own.empty() ? name + (name.empty() ? "" : "/") + path.stem().string() : name + separator + own);
      }
    }
  }

  /// The patches of an AMR set, with what finer ones cover.
  void addAmr(const VtkXmlFile& file, const std::string& name) {
    std::vector<AmrPatch> patches;
    std::vector<size_t> pieces;  // [patch]
    std::map<size_t, SetElement> levels;
    for (const SetElement& node : file.content().children("Block")) {
      const size_t level = levelOf(file, node, "level");
      if (!levels.emplace(level, node).second) file.fail(fmt::format("has two levels {}", level));
    }
    std::vector<std::pair<size_t, SetElement>> sets;
    for (const auto& [level, block] : levels)
      for (const SetElement& node : block.children("DataSet")) sets.emplace_back(level, node);
    // Version 0.1 has no blocks; the levels are called groups.
    for (const SetElement& node : file.content().children("DataSet"))
      sets.emplace_back(levelOf(file, node, "group"), node);
    for (const auto& [level, node] : sets) {
      if (!node.attribute("file")) continue;
      if (patches.size() == kMaxAmrPatches)
        file.fail(fmt::format("has more than {} patches", kMaxAmrPatches));
      const fs::path path = pathOf(file, node, "file");
      const size_t before = grid_.pieces.size();
      add(path, name + (name.empty() ? "" : "/") + path.stem().string());
      if (grid_.pieces.size() == before) continue;  // empty, or left out
      const AmrPatch patch{level, boxOf(file, node)};
      const VtkPiece& piece = grid_.pieces.back();
      for (size_t axis = 0; axis < 3; ++axis)
        if (grid_.pieces.size() > before + 1 ||
            piece.extent.nodesAlong(axis) != patch.cells.nodesAlong(axis) + 1)
          file.fail(fmt::format("{} has {} nodes, which is not its amr_box and a node more along each axis",
                                path.string(), piece.extent.describe()));
      patches.push_back(patch);
      pieces.push_back(before);
    }
    const auto refined = refinedCellsOf(patches, ratiosOf(file, levels));
    for (size_t n = 0; n < patches.size(); ++n) grid_.pieces[pieces[n]].refined = refined[n];
  }

  static size_t levelOf(const VtkXmlFile& file, const SetElement& node, const char* attribute) {
    const double level = file.numbers(node, attribute, 1)[0];
    if (!(level >= 0 && level < kMaxAmrLevels) || level != std::floor(level))
      file.fail(fmt::format("has a level {}; expected 0 to {}", level, kMaxAmrLevels - 1));
    return static_cast<size_t>(level);
  }

  static VtkExtent boxOf(const VtkXmlFile& file, const SetElement& node) {
    const std::vector<double> numbers = file.numbers(node, "amr_box", 6);
    if (const auto box = extentWith(numbers)) return *box;
    file.fail(fmt::format("has an amr_box of {}", fmt::join(numbers, " ")));
  }

  /// [level]: cells of the next level along a cell, from the levels' spacing or as version 1.0 states it.
  static std::vector<std::array<int64_t, 3>> ratiosOf(const VtkXmlFile& file,
                                                      const std::map<size_t, SetElement>& levels) {
    std::vector<std::array<int64_t, 3>> ratios(kMaxAmrLevels, {2, 2, 2});
    for (const SetElement& node : file.content().children("RefinementRatio")) {  // of version 0.1
      const size_t level = levelOf(file, node, "level");
      ratios[level] =
          refinementOf(file.name(), level, std::vector<double>(3, file.numbers(node, "refinement", 1)[0]));
    }
    for (const auto& [level, block] : levels) {
      const auto next = levels.find(level + 1);
      if (next == levels.end()) continue;
      std::vector<double> ratio(3, 0.0);
      if (block.attribute("refinement_ratio")) {
        ratio.assign(3, file.numbers(block, "refinement_ratio", 1)[0]);
      } else {
        const std::vector<double> coarse = file.numbers(block, "spacing", 3),
                                  fine = file.numbers(next->second, "spacing", 3);
        for (size_t axis = 0; axis < 3; ++axis) ratio[axis] = coarse[axis] / fine[axis];
      }
      ratios[level] = refinementOf(file.name(), level, ratio);
    }
    return ratios;
  }

  static double timeOf(const VtkXmlFile& file, const SetElement& node) {
    return node.attribute("timestep") ? file.numbers(node, "timestep", 1)[0] : 0;
  }
  static std::string partOf(const SetElement& node) {
    std::string part;
    for (const char* const key : {"group", "part", "name"})
      part += fmt::format("{}\n", node.attribute(key).value());
    return part;
  }

  void noteVersions(const VtkXmlFile& file, const SetElement& older, const SetElement& newer) {
    if (replaced_.empty())
      replaced_ =
          fmt::format("names several files with the same part at time {:g} ({}, {}); the last one is read",
                      timeOf(file, newer), older.attribute("file").value(), newer.attribute("file").value());
  }

  /// Removes the file that the step has for the part of `node`, which is read in its place.
  void replacePart(const VtkXmlFile& file, const SetElement& node, std::vector<SetElement>& of_step) {
    for (const SetElement& older : of_step)
      if (partOf(older) == partOf(node)) noteVersions(file, older, node);
    std::erase_if(of_step, [&](const SetElement& older) { return partOf(older) == partOf(node); });
  }

  /// Files of one time that do not differ in their part are parts all the same, as many programs write them, unless
  /// they have the same points: then they are versions of one part, and the last one is read.
  std::vector<SetElement> withoutVersions(const VtkXmlFile& file, const std::vector<SetElement>& nodes) {
    std::map<std::string, size_t> files_of_part;
    for (const SetElement& node : nodes) ++files_of_part[partOf(node)];
    std::vector<SetElement> kept;
    std::map<std::pair<std::string, uint64_t>, size_t> places;  // in `kept`
    for (const SetElement& node : nodes) {
      const std::string part = partOf(node);
      if (files_of_part[part] > 1) {
        const auto [place, is_new] = places.try_emplace({part, checksumOfPoints(file, node)}, kept.size());
        if (!is_new) {
          noteVersions(file, kept[place->second], node);
          kept[place->second] = node;
          continue;
        }
      }
      kept.push_back(node);
    }
    return kept;
  }

  uint64_t checksumOfPoints(const VtkXmlFile& file, const SetElement& node) const {
    OpenGridOptions options;
    options.grid = pathOf(file, node, "file");
    options.temporary_folder = temporary_folder_;
    return checksumOfFirstAndLast(*Gatherer(options).gather(options.grid));
  }

  void addTimeStep(const VtkXmlFile& file) {
    if (in_time_series_) file.fail("is a time series inside another time series");
    in_time_series_ = true;
    std::map<double, std::vector<SetElement>> steps;
    SetElement before;
    for (const SetElement& node : file.content().children("DataSet")) {
      std::vector<SetElement>& of_step = steps[timeOf(file, node)];
      // A run that was restarted goes back in time, and names the same parts of a step again.
      if (before && timeOf(file, before) != timeOf(file, node)) replacePart(file, node, of_step);
      of_step.push_back(before = node);
    }
    if (steps.empty()) file.fail("names no file");
    for (const auto& [time, nodes] : steps) grid_.times.push_back(time);
    grid_.time_step = chosenTimeStep(file.name(), grid_.times, time_step_);
    const std::vector<SetElement> nodes =
        withoutVersions(file, std::next(steps.begin(), grid_.time_step)->second);
    if (!replaced_.empty()) grid_.warnings.push_back(fmt::format("{}: {}", file.name(), replaced_));
    for (const SetElement& node : nodes) {
      const fs::path path = pathOf(file, node, "file");
      const std::string own = node.attribute("name").value();
      add(path, nodes.size() == 1 && own.empty() ? "" : own.empty() ? path.stem().string() : own);
    }
  }

  VtkFiles files_;
  const fs::path temporary_folder_;
  const fs::path names_folder_;  // of what the first file names
  std::optional<uint32_t> time_step_;
  VtkGrid grid_;  // and the files, times and warnings of a mesh
  VtkMesh mesh_;
  std::set<fs::path> inside_;  // the chain of files from the first to the current one
  bool in_time_series_ = false;
  std::string top_type_, leaf_type_, encoding_, mesh_type_, mesh_encoding_;
  std::string left_out_;  // the first file that is left out, and its type
  size_t left_out_files_ = 0;
  std::string replaced_;  // the first time of a series with several versions of a part
};

}  // namespace

std::unique_ptr<DataSource> openVtkXml(const OpenGridOptions& options) {
  return Gatherer(options).gather(options.grid);
}

}  // namespace curvisplat
