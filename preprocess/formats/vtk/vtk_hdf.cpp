#include "preprocess/formats/vtk/vtk_hdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <set>
#include <utility>

#include "preprocess/formats/common/hdf5_contents.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/vtk/vtk_hdf_file.h"
#include "preprocess/formats/vtk/vtk_mesh_source.h"
#include "preprocess/formats/vtk/vtk_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr const char* kRoot = "/VTKHDF";
constexpr int kMaxGroupDepth = 32;
constexpr uint64_t kMaxSteps = 10'000'000;

/// Gathers the pieces of a file's data sets.
class HdfGatherer {
 public:
  explicit HdfGatherer(const OpenGridOptions& options) : file_(options.grid), time_step_(options.time_step) {}

  std::unique_ptr<DataSource> gather() {
    const double version = file_.numbers(kRoot, "Version", 2)[0];
    if (version != 1 && version != 2)
      file_.fail(kRoot, fmt::format("is of version {}; expected 1 or 2", version));
    type_ = typeOf(kRoot);
    if (type_ == "MultiBlockDataSet" || type_ == "PartitionedDataSetCollection")
      addSet();
    else if (!addDataSet(kRoot, ""))
      file_.fail(kRoot, fmt::format("is of type \"{}\"; expected ImageData, RectilinearGrid, StructuredGrid, "
                                    "UnstructuredGrid, OverlappingAMR, "
                                    "MultiBlockDataSet or PartitionedDataSetCollection",
                                    printable(type_)));
    if (!grid_.pieces.empty()) return std::make_unique<VtkSource>(finishGrid());
    if (mesh_.pieces.empty())
      file_.fail(kRoot, fmt::format("contains no structured grid and no unstructured one{}{}",
                                    left_out_.empty() ? "" : ": ", left_out_));
    return std::make_unique<VtkMeshSource>(finishMesh());
  }

 private:
  /// The type of a group. Prototypes of version 1.0 do not state it; all of them are meshes.
  std::string typeOf(const std::string& group) const {
    std::string type = file_.text(group, "Type");
    if (type.empty() && file_.has(group + "/Connectivity")) type = "UnstructuredGrid";
    return type;
  }

  /// The place of an open data set's step in its arrays.
  struct Step {
    std::string group;  // Steps; empty without
    uint64_t number = 0, count = 0;
  };

  std::string format(const std::string& leaf, const std::string& count) const {
    return fmt::format("VTKHDF {}{}, {}", type_, type_ == leaf ? "" : " of " + leaf, count);
  }

  VtkGrid finishGrid() {
    for (const MeshPiece& piece : mesh_.names) leaveOut(piece.name, "UnstructuredGrid");
    warnOfLeftOut("structured");
    grid_.format = format(leaf_type_, countText(grid_.blocks.size(), "block"));
    grid_.files = {file_.name()};
    return std::move(grid_);
  }

  VtkMesh finishMesh() {
    warnOfLeftOut("unstructured");
    mesh_.format = format("UnstructuredGrid", countText(mesh_.pieces.size(), "piece"));
    mesh_.files = {file_.name()};
    mesh_.times = std::move(grid_.times);
    mesh_.time_step = grid_.time_step;
    mesh_.warnings = std::move(grid_.warnings);
    return std::move(mesh_);
  }

  void leaveOut(const std::string& name, const std::string& type) {
    if (left_out_count_++ == 0) left_out_ = fmt::format("{} is of type {}", name, printable(type));
  }

  void warnOfLeftOut(const char* kind) {
    if (left_out_count_ > 0)
      grid_.warnings.push_back(fmt::format("{} without {} grids {} left out: {}",
                                           countText(left_out_count_, "data set"), kind,
                                           isOrAre(left_out_count_), left_out_));
  }

  // ---- sets ----

  /// The data sets that the assembly leads to, by their names there, each once; then those that it leaves out.
  void addSet() {
    std::set<uint64_t> known;
    const std::string assembly = fmt::format("{}/Assembly", kRoot);
    if (const auto self = file_.identity(assembly)) known.insert(*self);
    addMembers(assembly, "", known, 0);
    addMembers(kRoot, "", known, kMaxGroupDepth - 1);
  }

  /// A group without a type holds further ones, or is an empty block.
  void addMembers(const std::string& group, const std::string& name, std::set<uint64_t>& known, int depth) {
    if (depth == kMaxGroupDepth) return;
    for (const std::string& child : file_.names(group)) {
      const std::string place = group + "/" + child, own = name + (name.empty() ? "" : "/") + child;
      const auto identity = file_.identity(place);
      if (!identity || !known.insert(*identity).second) continue;
      const std::string type = file_.text(place, "Type");
      if (type.empty())
        addMembers(place, own, known, depth + 1);
      else if (!addDataSet(place, own))
        leaveOut(own, type);
    }
  }

  /// Returns false if it is of a type that is not read.
  bool addDataSet(const std::string& group, const std::string& name) {
    const std::string type = typeOf(group);
    if (type == "ImageData" || type == "RectilinearGrid" || type == "StructuredGrid")
      addStructured(group, name, type);
    else if (type == "UnstructuredGrid")
      addMesh(group, name);
    else if (type == "OverlappingAMR")
      addAmr(group, name);
    else
      return false;
    if (type != "UnstructuredGrid") leaf_type_ = type;
    return true;
  }

  // ---- steps ----

  Step stepOf(const std::string& group) {
    Step step{group + "/Steps"};
    const auto values = file_.array(step.group + "/Values");
    if (!values) return {};
    step.count = values->size();
    if (step.count == 0 || step.count > kMaxSteps)
      file_.fail(step.group, fmt::format("has {} time values", step.count));
    if (grid_.times.empty()) {
      grid_.times.resize(step.count);
      values->read(0, grid_.times);
      grid_.time_step = chosenTimeStep(file_.name(), grid_.times, time_step_);
    } else if (grid_.times.size() != step.count) {
      file_.fail(step.group,
                 fmt::format("has {} time values; other data sets have {}", step.count, grid_.times.size()));
    }
    step.number = grid_.time_step;
    return step;
  }

  /// The open step's number in a list of Steps; nullopt if there is no such list.
  std::optional<uint64_t> inStep(const Step& step, const std::string& list) const {
    const std::string place = step.group + "/" + list;
    if (step.group.empty() || !file_.has(place)) return std::nullopt;
    return file_.counts(place, step.number, 1)[0];
  }

  uint64_t sumBefore(const std::string& list, uint64_t count) const {
    constexpr uint64_t kAtOnce = 65536;
    uint64_t sum = 0;
    for (uint64_t n = 0; n < count; n += kAtOnce)
      for (const uint64_t value : file_.counts(list, n, std::min(kAtOnce, count - n))) sum += value;
    return sum;
  }

  // ---- data sets ----

  /// Adds all arrays of points and of cells, which make(place, name, of_cells) gives.
  template <typename Make>
  void addArrays(const std::string& group, VtkPiece& piece, const Make& make) {
    for (const bool of_cells : {false, true}) {
      const std::string data = fmt::format("{}/{}Data", group, of_cells ? "Cell" : "Point");
      std::string& active = of_cells ? piece.active_cell_data : piece.active_point_data;
      if (file_.has(data)) active = file_.text(data, "Scalars");
      for (const std::string& name : file_.names(data)) {
        const std::string place = data + "/" + name;
        try {
          addDataArray(piece, of_cells, make(place, name, of_cells), grid_.warnings);
        } catch (const Hdf5NoNumbers& error) {
          grid_.warnings.push_back(fmt::format("left out: {}", error.what()));
        }
        if (active.empty() && lowerCase(file_.text(place, "Attribute")) == "scalars") active = name;
      }
    }
  }

  /// `counts`: points and cells of the part, and how many of them lie before it in the step. `begin`: of the step.
  struct Part {
    std::array<uint64_t, 2> count{}, before{}, begin{};
  };
  void addListed(const std::string& group, const Step& step, const Part& part, VtkPiece& piece) {
    addArrays(group, piece, [&](const std::string& place, const std::string& name, bool of_cells) {
      const auto own = inStep(step, fmt::format("{}DataOffsets/{}", of_cells ? "Cell" : "Point", name));
      return file_.tuples(place, own.value_or(part.begin[of_cells]) + part.before[of_cells],
                          part.count[of_cells]);
    });
  }

  void addBlock(std::string name, VtkPiece piece) {
    if (grid_.pieces.size() == kMaxVtkPieces)
      file_.fail(kRoot, fmt::format("has more than {} pieces", kMaxVtkPieces));
    grid_.blocks.push_back({std::move(name), grid_.pieces.size(), piece.extent});
    grid_.pieces.push_back(std::move(piece));
  }

  /// The nodes of an image, by its attributes.
  VtkUniformNodes uniformNodes(const std::string& group) const {
    const std::vector<double> origin = file_.numbers(group, "Origin", 3),
                              spacing = file_.numbers(group, "Spacing", 3);
    VtkUniformNodes nodes{{origin[0], origin[1], origin[2]}, {spacing[0], spacing[1], spacing[2]}};
    if (file_.hasAttribute(group, "Direction")) {
      const std::vector<double> rows = file_.numbers(group, "Direction", 9);
      for (glm::length_t n = 0; n < 9; ++n) nodes.direction[n % 3][n / 3] = rows[static_cast<size_t>(n)];
    }
    return nodes;
  }

  /// The coordinates along i, j and k: in each step those behind the ones of earlier steps, or the same.
  VtkAxes axesOf(const std::string& group, const Step& step, const VtkExtent& extent) const {
    VtkAxes axes;
    for (size_t axis = 0; axis < 3; ++axis) {
      const std::string name = fmt::format("{}Coordinates", "XYZ"[axis]),
                        place = fmt::format("{}/{}", group, name);
      axes[axis] = file_.tuples(place, inStep(step, name + "Offsets").value_or(0), extent.nodesAlong(axis));
      if (axes[axis].components != 1) file_.fail(place, "has more than one component; expected coordinates");
    }
    return axes;
  }

  /// The positions of a curvilinear grid, an array as those of values. Those of all steps may be the same.
  VtkPoints pointsOf(const std::string& group, const Step& step, const VtkExtent& extent) const {
    const std::string place = group + "/Points";
    const bool of_steps = step.count > 0 && file_.required(place)->dims().size() > 4;
    VtkPoints points =
        imageArray(of_steps ? inStep(step, "PointOffsets").value_or(0) : std::optional<uint64_t>(), extent,
                   place, false);
    if (points.components != 3)
      file_.fail(place, fmt::format("has {} components; expected 3", points.components));
    return points;
  }

  void addStructured(const std::string& group, const std::string& name, const std::string& type) {
    const std::vector<double> ends = file_.numbers(group, "WholeExtent", 6);
    const auto extent = extentWith(ends);
    if (!extent)
      file_.fail(group,
                 fmt::format("has a WholeExtent of {}; expected the first and last node along i, j and k",
                             fmt::join(ends, " ")));
    VtkPiece piece;
    piece.extent = *extent;
    const Step step = stepOf(group);
    if (type == "RectilinearGrid")
      piece.nodes = axesOf(group, step, *extent);
    else if (type == "StructuredGrid")
      piece.nodes = pointsOf(group, step, *extent);
    else
      piece.nodes = uniformNodes(group);
    if (!extent->isFlat())  // flat ones have fewer dimensions, and are not drawn
      addArrays(group, piece, [&](const std::string& place, const std::string& array, bool of_cells) {
        const auto own = inStep(step, fmt::format("{}DataOffsets/{}", of_cells ? "Cell" : "Point", array));
        return imageArray(step.count > 0 ? own.value_or(step.number) : std::optional<uint64_t>(), *extent,
                          place, of_cells);
      });
    addBlock(name.empty() ? "block 1" : name, std::move(piece));
  }

  /// An array of k, j, i (and component): the box with this number, where there are several, of a step each.
  VtkArray imageArray(std::optional<uint64_t> number, const VtkExtent& extent, const std::string& place,
                      bool of_cells) const {
    const auto array = file_.required(place);
    std::vector<uint64_t> expected;
    if (number) expected.push_back(array->dims()[0]);
    for (const size_t axis : {2, 1, 0}) expected.push_back(extent.nodesAlong(axis) - (of_cells ? 1 : 0));
    uint64_t components = 1;
    if (array->dims().size() == expected.size() + 1) expected.push_back(components = array->dims().back());
    if (array->dims() != expected || components == 0 || components > kMaxComponents ||
        (number && *number >= expected[0]))
      file_.fail(place, fmt::format("has the dimensions {}; expected {}{} of an image of {} nodes",
                                    fmt::join(array->dims(), "x"), number ? "the steps, then " : "",
                                    of_cells ? "the cells" : "the points", extent.describe()));
    const uint64_t tuples = of_cells ? extent.cells() : extent.nodes();
    return vtkArrayOf(place.substr(place.rfind('/') + 1), array, number.value_or(0) * tuples * components,
                      tuples, static_cast<uint32_t>(components));
  }

  void addMesh(const std::string& group, const std::string& name) {
    const auto at = [&](const char* list) { return fmt::format("{}/{}", group, list); };
    const Step step = stepOf(group);
    const auto all = file_.array(at("NumberOfPoints"));
    const uint64_t total = all ? all->size() : 0, first = inStep(step, "PartOffsets").value_or(0),
                   parts = inStep(step, "NumberOfParts")
                               .value_or(total / std::clamp<uint64_t>(step.count, 1, total + 1));
    if (parts > kMaxVtkPieces - mesh_.pieces.size())
      file_.fail(group, fmt::format("has more than {} pieces", kMaxVtkPieces));
    const std::vector<uint64_t> points = file_.counts(at("NumberOfPoints"), first, parts),
                                cells = file_.counts(at("NumberOfCells"), first, parts),
                                ids = file_.counts(at("NumberOfConnectivityIds"), first, parts);
    Part part;
    part.begin = {inStep(step, "PointOffsets").value_or(0), inStep(step, "CellOffsets").value_or(0)};
    uint64_t id = inStep(step, "ConnectivityIdOffsets").value_or(0);
    // Counted, not taken from Steps: VTK's own writer leaves parts out there.
    const bool has_faces = file_.has(at("NumberOfFaces"));
    Faces faces;
    if (has_faces) {
      faces.count = file_.counts(at("NumberOfFaces"), first, parts);
      faces.points = file_.counts(at("NumberOfFaceConnectivityIds"), first, parts);
      faces.of_cells = file_.counts(at("NumberOfPolyhedronToFaceIds"), first, parts);
      faces.begin = sumBefore(at("NumberOfFaces"), first);
      faces.point = sumBefore(at("NumberOfFaceConnectivityIds"), first);
      faces.of_cell = sumBefore(at("NumberOfPolyhedronToFaceIds"), first);
    }
    for (uint64_t n = 0; n < parts; ++n) {
      part.count = {points[n], cells[n]};
      const uint64_t cell = part.begin[1] + part.before[1];
      if (points[n] > 0 && cells[n] > 0) {
        VtkPiece piece;
        VtkPoints places = file_.tuples(at("Points"), part.begin[0] + part.before[0], points[n]);
        if (places.components != 3)
          file_.fail(at("Points"), fmt::format("has {} components; expected 3", places.components));
        piece.nodes = std::move(places);
        addListed(group, step, part, piece);
        VtkCells of;
        of.cells = cells[n];
        of.types = file_.tuples(at("Types"), cell, cells[n]);
        of.ends = ends(at("Offsets"), cell + first + n, cells[n]);
        of.connectivity = file_.tuples(at("Connectivity"), id, ids[n]);
        if (has_faces && faces.count[n] > 0)
          of.shared_faces =
              VtkSharedFaces{ends(at("FaceOffsets"), faces.begin + first + n, faces.count[n]),
                             file_.tuples(at("FaceConnectivity"), faces.point, faces.points[n]),
                             ends(at("PolyhedronOffsets"), cell + first + n, cells[n]),
                             file_.tuples(at("PolyhedronToFaces"), faces.of_cell, faces.of_cells[n])};
        mesh_.names.push_back({name.empty() ? fmt::format("piece {}", mesh_.pieces.size() + 1)
                               : parts == 1 ? name
                                            : fmt::format("{}.{}", name, n + 1),
                               file_.name(), points[n], cells[n]});
        mesh_.pieces.push_back(std::move(piece));
        mesh_.cells.push_back(std::move(of));
      }
      for (const size_t of_cells : {0, 1}) part.before[of_cells] += part.count[of_cells];
      id += ids[n];
      if (!has_faces) continue;
      faces.begin += faces.count[n];
      faces.point += faces.points[n];
      faces.of_cell += faces.of_cells[n];
    }
  }

  struct Faces {
    std::vector<uint64_t> count, points, of_cells;  // [part]
    uint64_t begin = 0, point = 0, of_cell = 0;     // of the part
  };

  /// Ends of `count` lists, of count + 1 offsets that begin with 0.
  VtkArray ends(const std::string& place, uint64_t first, uint64_t count) const {
    VtkArray ends = file_.tuples(place, first + 1, count);
    if (const int64_t zero = file_.integers(place, first, 1)[0]; zero != 0)
      file_.fail(place,
                 fmt::format("begins with {} at number {}; expected 0; the file is damaged", zero, first));
    return ends;
  }

  void addAmr(const std::string& group, const std::string& name) {
    const std::vector<double> origin = file_.numbers(group, "Origin", 3);
    const Step step = stepOf(group);
    std::vector<AmrPatch> patches;
    std::vector<std::array<int64_t, 3>> ratios;
    std::vector<double> coarser;
    const size_t before = grid_.pieces.size();
    for (size_t level = 0; file_.has(fmt::format("{}/Level{}", group, level)); ++level) {
      const std::string of_level = fmt::format("{}/Level{}", group, level), boxes = of_level + "/AMRBox";
      if (level == kMaxAmrLevels)
        file_.fail(of_level, fmt::format("is one level too many; expected {}", kMaxAmrLevels));
      const std::vector<double> spacing = file_.numbers(of_level, "Spacing", 3);
      if (level > 0) {
        for (size_t axis = 0; axis < 3; ++axis) coarser[axis] /= spacing[axis];
        ratios.push_back(refinementOf(file_.name(), level - 1, coarser));
      }
      coarser = spacing;
      const Step in_level{step.group.empty() ? "" : fmt::format("{}/Level{}", step.group, level), step.number,
                          step.count};
      const auto stated = [&](const char* list) {  // before version 2.3 without an s at the end
        const auto found = inStep(in_level, list);
        return found ? found
                     : inStep(in_level,
                              std::string(list) == "AMRBoxOffsets" ? "AMRBoxOffset" : "NumberOfAMRBox");
      };
      const auto all = file_.array(boxes);
      const uint64_t first = stated("AMRBoxOffsets").value_or(0),
                     count = stated("NumberOfAMRBoxes").value_or(all ? all->size() / 6 : 0);
      if (count > kMaxAmrPatches - patches.size())
        file_.fail(boxes, fmt::format("has more than {} patches", kMaxAmrPatches));
      const std::vector<int64_t> ends = file_.integers(boxes, 6 * first, 6 * count);
      Part part;
      for (uint64_t n = 0; n < count; ++n) {
        const std::vector<double> of_box(ends.begin() + static_cast<ptrdiff_t>(6 * n),
                                         ends.begin() + static_cast<ptrdiff_t>(6 * n + 6));
        const auto cells = extentWith(of_box);
        if (!cells)
          file_.fail(boxes, fmt::format("has a box of {}; expected the first and last cell along i, j and k",
                                        fmt::join(of_box, " ")));
        VtkPiece piece;
        piece.extent = *cells;
        for (int64_t& upper : piece.extent.upper) ++upper;
        piece.nodes =
            VtkUniformNodes{{origin[0], origin[1], origin[2]}, {spacing[0], spacing[1], spacing[2]}};
        part.count = {piece.extent.nodes(), cells->nodes()};
        addListed(of_level, in_level, part, piece);
        for (const size_t of_cells : {0, 1}) part.before[of_cells] += part.count[of_cells];
        patches.push_back({level, *cells});
        addBlock(fmt::format("{}{}level {} patch {}", name, name.empty() ? "" : "/", level, n + 1),
                 std::move(piece));
      }
    }
    const auto refined = refinedCellsOf(patches, ratios);
    for (size_t n = 0; n < patches.size(); ++n) grid_.pieces[before + n].refined = refined[n];
  }

  const VtkHdfFile file_;
  const std::optional<uint32_t> time_step_;
  std::string type_, leaf_type_;
  VtkGrid grid_;  // and the times and warnings of a mesh
  VtkMesh mesh_;
  std::string left_out_;  // the first data set that is left out, and its type
  size_t left_out_count_ = 0;
};

}  // namespace

bool isVtkHdf(const InputFile& file) {
  return !rootLinksOf(file, {kRoot}).empty();
}

std::unique_ptr<DataSource> openVtkHdf(const OpenGridOptions& options) {
  return HdfGatherer(options).gather();
}

}  // namespace curvisplat
