#include "preprocess/formats/xdmf/xdmf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/xdmf/xdmf_document.h"
#include "preprocess/formats/xdmf/xdmf_function.h"
#include "preprocess/formats/xdmf/xdmf_items.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLooked = 2048;
// The words that a cell of a Mixed topology may have: a polyhedron's.
constexpr uint64_t kMaxWords = 100'000;

class Reader {
 public:
  explicit Reader(const OpenGridOptions& options)
      : document_(options.grid),
        items_(document_, options.namesFolder()),
        begins_(std::make_shared<SpoolFile>(options.temporary_folder)),
        values_(std::make_shared<SpoolFile>(options.temporary_folder)) {
    for (const pugi::xml_node grid : document_.domain().children("Grid")) findLeaves(grid, std::nullopt, 0);
    if (leaves_.empty()) throw Error("{}: has no Grid", name());
    chooseStep(options);
    leaveOutBareMeshes();
    joinGridsOfOneMesh();
  }

  XdmfFile run() {
    std::string flat;
    size_t flat_count = 0;
    std::vector<XdmfGrid> meshes;
    for (const Leaf& leaf : leaves_) {
      XdmfGrid grid = readGrid(leaf);
      if (grid.cells.count > 0) {
        meshes.push_back(std::move(grid));
        continue;
      }
      if (grid.nodes[0] == 0) continue;  // without solid cells
      if (std::all_of(grid.nodes.begin(), grid.nodes.end(), [](uint64_t n) { return n > 1; })) {
        file_.grids.push_back(std::move(grid));
        continue;
      }
      ++flat_count;
      if (flat.empty())
        flat = fmt::format("{} of {}x{}x{} nodes", grid.name, grid.nodes[0], grid.nodes[1], grid.nodes[2]);
    }
    if (file_.grids.empty() && meshes.empty())
      throw Error("{}: has no grid with volume{}; expected a three-dimensional grid", name(),
                  flat.empty() ? "" : ": " + flat + " is flat");
    if (file_.grids.empty())
      file_.grids = std::move(meshes);
    else if (!meshes.empty())
      warn(fmt::format("{} of {} grids are unstructured and left out, such as {}", meshes.size(),
                       leaves_.size(), meshes.front().name));
    if (flat_count > 0)
      file_.warnings.push_back(
          fmt::format("{} of {} grids are flat and left out, such as {}", flat_count, leaves_.size(), flat));
    file_.files = {name()};
    file_.files.insert(file_.files.end(), items_.files().begin(), items_.files().end());
    return std::move(file_);
  }

 private:
  struct Leaf {
    pugi::xml_node node;
    std::optional<double> time;
    std::vector<pugi::xml_node> attributes = {};
  };

  struct Times {
    bool spread = false;  // numbers: the first time, the step and the count
    std::vector<double> numbers;

    std::optional<double> at(size_t n) const {
      const auto number = static_cast<double>(n);
      if (spread) return number < numbers[2] ? std::optional(numbers[0] + numbers[1] * number) : std::nullopt;
      return n < numbers.size() ? std::optional(numbers[n]) : std::nullopt;
    }
  };

  std::string name() const { return document_.name(); }

  /// Times of the grids of a temporal collection, from its own Time element; none if it has none.
  const Times& timesOf(const pugi::xml_node& collection) {
    const auto [found, is_new] = times_.try_emplace(collection);
    Times& times = found->second;
    const pugi::xml_node time = document_.resolved(collection.child("Time")), given = time.child("DataItem");
    const std::string type = lowerCase(xdmfAttribute(time, {"TimeType", "Type"}));
    if (!is_new || !given || (type != "list" && type != "hyperslab")) return times;
    const pugi::xml_node item = document_.resolved(given);
    const std::string format = lowerCase(xdmfAttribute(item, {"Format"}));
    if (format.empty() || format == "xml") {
      times.numbers = document_.numbersIn(item, item.text().get());
    } else {
      const std::shared_ptr<const XdmfValues> values = items_.read(item);
      const auto grids = collection.children("Grid");
      const auto used = static_cast<uint64_t>(std::distance(grids.begin(), grids.end()));
      times.numbers.resize(static_cast<size_t>(std::min(values->size(), std::max<uint64_t>(used, 3))));
      values->read(0, times.numbers);
    }
    if (!std::all_of(times.numbers.begin(), times.numbers.end(), [](double t) { return std::isfinite(t); }))
      throw Error("{} has a time that is not a finite number", document_.describe(item));
    times.spread = type == "hyperslab";
    if (times.spread && times.numbers.size() != 3)
      throw Error("{} has {} numbers; expected the first time, the step and the count",
                  document_.describe(item), times.numbers.size());
    return times;
  }

  void findLeaves(const pugi::xml_node& given, std::optional<double> time, int depth) {
    if (depth > kXdmfMaxDepth) throw Error("{}: grids are nested more than {} deep", name(), kXdmfMaxDepth);
    if (++visited_ > kMaxGrids) throw Error("{}: has more than {} grids", name(), kMaxGrids);
    const pugi::xml_node grid = document_.resolved(given);
    const std::string type = lowerCase(xdmfAttribute(grid, {"GridType", "Type"}));
    const pugi::xml_node own_time = document_.resolved(grid.child("Time"));
    const std::string value = xdmfAttribute(own_time, {"Value"});
    if (!value.empty()) time = document_.numberIn(own_time, value);
    if (type == "subset") throw Error("{} is a SubSet, which is not read", document_.describe(grid));
    if (type.empty() || type == "uniform") {
      leaves_.push_back({grid, time});
      return;
    }
    const bool temporal = lowerCase(xdmfAttribute(grid, {"CollectionType"})) == "temporal";
    const Times none, &times = temporal ? timesOf(grid) : none;
    size_t number = 0;
    for (const pugi::xml_node child : grid.children("Grid")) {
      std::optional<double> of_child = time;
      if (temporal) of_child = times.at(number).value_or(static_cast<double>(number));
      findLeaves(child, of_child, depth + 1);
      ++number;
    }
  }

  void chooseStep(const OpenGridOptions& options) {
    std::set<double> times;
    for (const Leaf& leaf : leaves_)
      if (leaf.time) times.insert(*leaf.time);
    file_.times.assign(times.begin(), times.end());
    file_.time_step = chosenTimeStep(name(), file_.times, options.time_step);
    if (times.empty()) return;
    const double time = file_.times[file_.time_step];
    std::erase_if(leaves_, [&](const Leaf& leaf) { return leaf.time && *leaf.time != time; });
  }

  /// Leaves out grids without attributes that share cells or points with others: dolfinx and meshio write the mesh as a
  /// grid of its own, which each step includes, and it would be drawn twice.
  void leaveOutBareMeshes() {
    std::set<pugi::xml_node> drawn;  // topologies, and geometries of solid cells, of grids with attributes
    for (const Leaf& leaf : leaves_) {
      const pugi::xml_node topology = document_.resolved(leaf.node.child("Topology"));
      const XdmfCellType* const type =
          xdmfCellTypeNamed(lowerCase(xdmfAttribute(topology, {"TopologyType", "Type"})));
      if (!leaf.node.child("Attribute") || (type && type->shape == CellKind::kNone)) continue;
      drawn.insert(topology);
      drawn.insert(document_.resolved(leaf.node.child("Geometry")));
    }
    drawn.erase(pugi::xml_node());
    std::erase_if(leaves_, [&](const Leaf& leaf) {
      return !leaf.node.child("Attribute") &&
             (drawn.contains(document_.resolved(leaf.node.child("Topology"))) ||
              drawn.contains(document_.resolved(leaf.node.child("Geometry"))));
    });
  }

  /// Makes one grid of those of one mesh: dolfinx writes a collection of steps for each function, and a run
  /// that was restarted writes a time again. Where several grids have an attribute of one name, the last is
  /// read.
  void joinGridsOfOneMesh() {
    constexpr size_t kMaxCompared = 64 << 20;
    size_t compared = 0;
    std::map<std::string, size_t> texts;
    std::map<pugi::xml_node, size_t> numbers;
    const auto number_of = [&](const Leaf& leaf, const char* part) {
      const pugi::xml_node element = document_.resolved(leaf.node.child(part));
      const auto [found, is_new] = numbers.try_emplace(element);
      if (is_new) {
        std::ostringstream text;
        element.print(text, "", pugi::format_raw);
        if ((compared += text.view().size()) > kMaxCompared)
          throw Error("{}: its grids refer to too much text", document_.name());
        found->second = texts.try_emplace(std::move(text).str(), texts.size()).first->second;
      }
      return found->second;
    };
    std::map<std::pair<size_t, size_t>, size_t> place_of_mesh;
    std::map<std::tuple<size_t, std::string, std::string>, pugi::xml_node>
        last;  // the grid that has an attribute
    std::vector<Leaf> joined;
    std::vector<size_t> places;
    for (const Leaf& leaf : leaves_) {
      const bool whole = leaf.node.child("Topology") && leaf.node.child("Geometry");
      const std::pair mesh(number_of(leaf, "Topology"), number_of(leaf, "Geometry"));
      const size_t place =
          whole ? place_of_mesh.try_emplace(mesh, joined.size()).first->second : joined.size();
      if (place == joined.size()) joined.push_back(leaf);
      places.push_back(place);
      for (const pugi::xml_node attribute : leaf.node.children("Attribute")) {
        const auto [found, is_new] = last.try_emplace(keyOf(place, document_.resolved(attribute)), leaf.node);
        if (!is_new && found->second != leaf.node)
          warn(fmt::format("several grids of one mesh have the attribute {}{}; the last one is read",
                           std::get<1>(found->first),
                           leaf.time ? fmt::format(" at time {:g}", *leaf.time) : ""));
        found->second = leaf.node;
      }
    }
    for (size_t n = 0; n < leaves_.size(); ++n)
      for (const pugi::xml_node given : leaves_[n].node.children("Attribute"))
        if (const pugi::xml_node attribute = document_.resolved(given);
            last.at(keyOf(places[n], attribute)) == leaves_[n].node)
          joined[places[n]].attributes.push_back(attribute);
    leaves_ = std::move(joined);
  }

  /// An attribute of the grid at `place`: its name and centring.
  static std::tuple<size_t, std::string, std::string> keyOf(size_t place, const pugi::xml_node& attribute) {
    const std::string centre = lowerCase(xdmfAttribute(attribute, {"Center"}));
    return {place, xdmfAttribute(attribute, {"Name"}), centre.empty() ? "node" : centre};
  }

  XdmfGrid readGrid(const Leaf& leaf) {
    const pugi::xml_node& node = leaf.node;
    XdmfGrid grid;
    attributes_of_grid_.clear();
    grid.name = xdmfAttribute(node, {"Name"});
    if (grid.name.empty()) grid.name = fmt::format("grid {}", file_.grids.size() + 1);
    const pugi::xml_node topology = document_.resolved(node.child("Topology"));
    if (!topology)
      throw Error("{} has no Topology; expected 3DSMesh, 3DRectMesh or 3DCoRectMesh",
                  document_.describe(node));
    const std::string type = xdmfAttribute(topology, {"TopologyType", "Type"}), small = lowerCase(type);
    if (!small.ends_with("smesh") && !small.ends_with("rectmesh")) {
      if (small != "mixed" && !xdmfCellTypeNamed(small))
        throw Error(
            "{} has the topology {}, which is not read; expected 3DSMesh, 3DRectMesh, 3DCoRectMesh, Mixed, "
            "Tetrahedron, Hexahedron or the like",
            document_.describe(node), printable(type.substr(0, 40)));
      readMesh(leaf, topology, xdmfCellTypeNamed(small), grid);
      return grid;
    }
    const std::vector<uint64_t> counts =
        document_.countsIn(topology, xdmfAttribute(topology, {"Dimensions", "NumberOfElements"}));
    if (counts.empty() || counts.size() > 3)
      throw Error("{} has {} dimensions; expected 3", document_.describe(topology), counts.size());
    grid.nodes = {1, 1, 1};
    for (size_t d = 0; d < counts.size(); ++d) grid.nodes[counts.size() - 1 - d] = counts[d];
    uint64_t nodes = 1;
    for (const uint64_t n : grid.nodes) {
      if (n == 0 || nodes > kXdmfMaxCount / n)
        throw Error("{} has impossible dimensions", document_.describe(topology));
      nodes *= n;
    }
    if (std::any_of(grid.nodes.begin(), grid.nodes.end(), [](uint64_t n) { return n < 2; })) return grid;
    readGeometry(document_.resolved(node.child("Geometry")), grid, document_.describe(node));
    for (const pugi::xml_node& attribute : leaf.attributes) readAttribute(attribute, grid);
    return grid;
  }

  /// `type`: null for Mixed. Without solid cells the grid stays without points.
  void readMesh(const Leaf& leaf, const pugi::xml_node& topology, const XdmfCellType* type, XdmfGrid& grid) {
    const pugi::xml_node& node = leaf.node;
    const pugi::xml_node geometry = document_.resolved(node.child("Geometry")),
                         first = geometry.child("DataItem");
    if (type && type->shape == CellKind::kNone) {
      warn(fmt::format("grids of the topology {} have no volume and are left out", type->name));
      return;
    }
    if (!first) throw Error("{} has no Geometry with a DataItem", document_.describe(node));
    const std::string kind = lowerCase(xdmfAttribute(geometry, {"GeometryType", "Type"}));
    const uint64_t numbers = items_.read(first)->size();
    grid.nodes = {kind == "x_y_z" ? numbers : numbers / 3, 1, 1};
    readGeometry(geometry, grid, document_.describe(node));
    if (grid.kind != XdmfGrid::Kind::kPoints && grid.kind != XdmfGrid::Kind::kSeparate)
      throw Error("{}: its Geometry is {}; expected XYZ or X_Y_Z", document_.describe(node),
                  printable(kind.substr(0, 40)));
    const pugi::xml_node item = topology.child("DataItem");
    if (!item) throw Error("{} has no DataItem", document_.describe(topology));
    XdmfCells& cells = grid.cells;
    cells.connectivity = items_.read(item);
    if (const std::string base = xdmfAttribute(topology, {"BaseOffset"}); !base.empty())
      cells.first_point = document_.numberIn(topology, base);
    requireUsualOrder(topology);
    const std::string stated = xdmfAttribute(topology, {"NumberOfElements", "Dimensions"});
    const std::vector<uint64_t> counts =
        stated.empty() ? std::vector<uint64_t>() : document_.countsIn(topology, stated);
    const uint64_t expected = counts.empty() ? 0 : counts[0];
    if (type && !type->counted) {
      cells.shape = type->shape;
      cells.nodes_each = type->nodes;
      cells.curved = type->nodes > cornersOf(type->shape);
      cells.count = cells.connectivity->size() / type->nodes;
    } else {
      indexMixed(type, document_.describe(topology), cells);
    }
    if ((expected > 0 && cells.count != expected) ||
        (cells.nodes_each > 0 && cells.connectivity->size() % cells.nodes_each != 0))
      throw Error("{} has {} numbers, which are {} cells; expected {}", document_.describe(topology),
                  cells.connectivity->size(), cells.count, expected);
    takeCellsApart(leaf, grid);
    for (const pugi::xml_node& attribute : leaf.attributes) readAttribute(attribute, grid);
  }

  /// Refuses an Order of the points of a cell other than 0 1 2 ..., which no writer that is known uses.
  void requireUsualOrder(const pugi::xml_node& topology) const {
    const std::string order = xdmfAttribute(topology, {"Order"});
    const std::vector<std::string_view> points = wordsOf(order);
    for (size_t n = 0; n < points.size(); ++n)
      if (points[n] != std::to_string(n))
        throw Error("{} has its points in the Order {}, which is not read; expected 0 1 2 ...",
                    document_.describe(topology), printable(order.substr(0, 40)));
  }

  /// Finds where each cell begins. `only`: the type of all, which then does not stand before them.
  void indexMixed(const XdmfCellType* only, const std::string& where, XdmfCells& cells) {
    constexpr uint64_t kAtOnce = 32 << 10;
    NumberSpool<uint64_t> begins(begins_);
    const uint64_t all = cells.connectivity->size();
    std::vector<double> window;
    uint64_t window_begin = 0, at = 0;
    const auto next = [&] {
      if (at >= all) throw Error("{} ends within cell {}; the file is truncated", where, begins.size());
      if (at - window_begin >= window.size()) {
        window_begin = at;
        window.resize(static_cast<size_t>(std::min(kAtOnce, all - at)));
        cells.connectivity->read(at, window);
      }
      const double number = window[static_cast<size_t>(at++ - window_begin)];
      if (!(number >= 0 && number < 0x1p53))
        throw Error("{} has the number {} in cell {}", where, number, begins.size());
      return static_cast<uint64_t>(number);
    };
    const auto skip = [&](uint64_t numbers) {
      if (numbers > std::min(kMaxWords, all - at))
        throw Error("{}: cell {} has {} points; expected {} at most", where, begins.size(), numbers,
                    std::min(kMaxWords, all - at));
      at += numbers;
    };
    while (at < all) {
      const uint64_t begin = at, number = only ? only->number : next();
      const XdmfCellType* const type = xdmfCellType(number);
      if (!type)
        throw Error("{}: cell {} is of type {}, which XDMF does not have", where, begins.size(), number);
      begins.add(begin);
      cells.curved |= type->shape != CellKind::kNone && type->nodes > cornersOf(type->shape);
      if (type->shape == CellKind::kPolyhedron) {
        for (uint64_t faces = next(); faces > 0; --faces) {
          skip(next());
          if (at - begin > kMaxWords) throw Error("{}: cell {} has too many faces", where, begins.size() - 1);
        }
      } else {
        skip(type->counted ? next() : type->nodes);
      }
    }
    cells.count = begins.size();
    begins.add(all);
    cells.begins = begins.finish();
    cells.shape = only ? only->shape : CellKind::kNone;
  }

  void readGeometry(const pugi::xml_node& geometry, XdmfGrid& grid, const std::string& where) {
    if (!geometry) throw Error("{} has no Geometry", where);
    const std::string type = lowerCase(xdmfAttribute(geometry, {"GeometryType", "Type"}));
    std::vector<std::shared_ptr<const XdmfValues>> items;
    for (const pugi::xml_node item : geometry.children("DataItem")) {
      if (items.size() == 3) break;
      items.push_back(items_.read(item));
    }
    const auto expect = [&](size_t count) {
      if (items.size() != count)
        throw Error("{}: its Geometry has {} data items; expected {}", where, items.size(), count);
    };
    const auto expectSize = [&](size_t item, uint64_t size) {
      if (items[item]->size() != size)
        throw Error("{}: its Geometry has {} numbers; expected {} by its Topology", where,
                    items[item]->size(), size);
    };
    const uint64_t nodes = grid.nodes[0] * grid.nodes[1] * grid.nodes[2];
    if (type.empty() || type == "xyz") {
      expect(1);
      expectSize(0, 3 * nodes);
      grid.kind = XdmfGrid::Kind::kPoints;
      grid.places[0] = items[0];
    } else if (type == "x_y_z" || type == "vxvyvz") {
      expect(3);
      grid.kind = type == "x_y_z" ? XdmfGrid::Kind::kSeparate : XdmfGrid::Kind::kAxes;
      for (size_t axis = 0; axis < 3; ++axis) {
        expectSize(axis, type == "x_y_z" ? nodes : grid.nodes[axis]);
        grid.places[axis] = items[axis];
      }
    } else if (type == "origin_dxdydz") {
      expect(2);
      grid.kind = XdmfGrid::Kind::kUniform;
      // In the order of the dimensions, z first, as ParaView reads them.
      for (size_t item = 0; item < 2; ++item) {
        expectSize(item, 3);
        std::array<double, 3> values{};
        items[item]->read(0, values);
        std::reverse(values.begin(), values.end());
        (item == 0 ? grid.origin : grid.spacing) = values;
      }
    } else {
      throw Error("{}: its Geometry is {}, which is not read; expected XYZ, X_Y_Z, VXVYVZ or ORIGIN_DXDYDZ",
                  where, printable(type.substr(0, 40)));
    }
  }

  /// A function of finite elements.
  struct Function {
    std::string family, degree;

    bool isRead(const XdmfCells& cells) const {
      return cells.shape == CellKind::kTetrahedron && (cells.nodes_each == 4 || cells.nodes_each == 10) &&
             (family == "CG" || family == "DG") && (degree == "0" || degree == "1" || degree == "2");
    }
    /// The values of a component in a cell.
    uint64_t each() const { return degree == "0" ? 1 : degree == "1" ? 4 : 10; }
  };

  static std::optional<Function> functionOf(const pugi::xml_node& attribute) {
    if (xdmfAttribute(attribute, {"ItemType"}) != "FiniteElementFunction") return std::nullopt;
    return Function{xdmfAttribute(attribute, {"ElementFamily"}), xdmfAttribute(attribute, {"ElementDegree"})};
  }

  /// Gives each cell points of its own where a function jumps between cells, or has values between their corners.
  void takeCellsApart(const Leaf& leaf, XdmfGrid& grid) {
    XdmfCells& cells = grid.cells;
    for (const pugi::xml_node& attribute : leaf.attributes) {
      const auto function = functionOf(attribute);
      if (function && function->isRead(cells) && function->each() > 1 &&
          (function->family == "DG" || function->degree == "2" || cells.nodes_each > 4))
        cells.own_points = std::max({cells.own_points, cells.nodes_each, function->each()});
    }
    if (cells.own_points == 0) return;
    const std::string where = document_.describe(leaf.node);
    const std::vector<std::shared_ptr<const XdmfValues>> all(grid.places.begin(), grid.places.end());
    cells.curved = cells.own_points > 4;
    nodes_of_file_ = grid.nodes[0];
    grid.places[0] = ofNodes(
        grid, grid.kind == XdmfGrid::Kind::kSeparate ? xdmfJoined(all, where) : grid.places[0], 3, where);
    grid.kind = XdmfGrid::Kind::kPoints;
    grid.nodes[0] = cells.count * cells.own_points;
  }

  /// Values at nodes, for the points of cells that have points of their own.
  std::shared_ptr<const XdmfValues> ofNodes(const XdmfGrid& grid, std::shared_ptr<const XdmfValues> values,
                                            uint64_t components, const std::string& where) const {
    const XdmfCells& cells = grid.cells;
    return xdmfOfCells({cells.count, cells.nodes_each, components, cells.connectivity, true,
                        cells.first_point, std::move(values), where},
                       cells.own_points, values_);
  }

  /// The values of a function of finite elements; null, with a warning, if it is of a kind that is not read.
  std::shared_ptr<const XdmfValues> readFunction(const pugi::xml_node& node, const Function& function,
                                                 const std::string& name, const XdmfGrid& grid) {
    const XdmfCells& cells = grid.cells;
    std::vector<std::shared_ptr<const XdmfValues>> items;
    for (const pugi::xml_node item : node.children("DataItem"))
      if (items.size() < 2) items.push_back(items_.read(item));
    if (!function.isRead(cells) || items.size() < 2) {
      warn(fmt::format(
          "attribute {} is a function of finite elements ({} of degree {}), which is read in "
          "tetrahedra, for CG and DG "
          "of degree 0 to 2; it is left out",
          name, printable(function.family.substr(0, 40)), printable(function.degree.substr(0, 40))));
      return nullptr;
    }
    constexpr uint64_t kMaxComponents = 9;
    const uint64_t each = function.each(), components = items[0]->size() / (cells.count * each);
    if (components == 0 || components > kMaxComponents || components * each * cells.count != items[0]->size())
      throw Error("{} has {} degrees of freedom in {} cells; expected {} in each, or some times as many",
                  document_.describe(node), items[0]->size(), cells.count, each);
    const XdmfCellNumbers numbers{cells.count, each,
                                  components,  items[0],
                                  false,       cells.first_point,
                                  items[1],    document_.describe(node)};
    if (each > 1 && cells.own_points == 0)
      return xdmfAtNodes(numbers, grid.nodes[0], cells.connectivity, values_);
    return xdmfOfCells(numbers, each == 1 ? 1 : cells.own_points, values_);
  }

  void readAttribute(const pugi::xml_node& node, XdmfGrid& grid) {
    XdmfAttribute attribute;
    attribute.name = xdmfAttribute(node, {"Name"});
    if (attribute.name.empty()) attribute.name = fmt::format("attribute {}", grid.attributes.size() + 1);
    std::string centre = lowerCase(xdmfAttribute(node, {"Center"}));
    const auto function = functionOf(node);
    if (function) {
      attribute.values = readFunction(node, *function, attribute.name, grid);
      if (!attribute.values) return;
      centre = function->degree == "0" ? "cell" : "node";
    }
    if (!centre.empty() && centre != "node" && centre != "cell") {
      warn(fmt::format("attribute {} belongs to each {}; it is left out", attribute.name, centre));
      return;
    }
    attribute.centring = centre == "cell" ? Centring::kCell : Centring::kNode;
    const pugi::xml_node item = node.child("DataItem");
    if (!item) throw Error("{} has no DataItem", document_.describe(node));
    try {
      if (!attribute.values) attribute.values = items_.read(item);
    } catch (const XdmfComputedItem& error) {
      warn(fmt::format("attribute {} is left out: {}", attribute.name, error.what()));
      return;
    }
    const uint64_t less = attribute.centring == Centring::kCell && grid.cells.count == 0 ? 1 : 0;
    const uint64_t samples = attribute.centring == Centring::kCell && less == 0 ? grid.cells.count
                             : grid.cells.own_points > 0 && !function
                                 ? nodes_of_file_
                                 : (grid.nodes[0] - less) * (grid.nodes[1] - less) * (grid.nodes[2] - less);
    attribute.components = attribute.values->size() / samples;
    constexpr uint64_t kMaxComponents = 4096;
    if (attribute.values->size() % samples != 0 || attribute.components == 0 ||
        attribute.components > kMaxComponents)
      throw Error("{} has {} numbers; expected {}, or some times as many", document_.describe(node),
                  attribute.values->size(), samples);
    if (grid.cells.own_points > 0 && attribute.centring == Centring::kNode && !function)
      attribute.values = ofNodes(grid, attribute.values, attribute.components, document_.describe(node));
    if (!attributes_of_grid_.emplace(attribute.name, attribute.centring).second)
      warn(fmt::format("a second attribute {} is ignored", attribute.name));
    else
      grid.attributes.push_back(std::move(attribute));
  }

  void warn(std::string warning) {
    if (warned_.insert(warning).second) file_.warnings.push_back(std::move(warning));
  }

  static constexpr size_t kMaxGrids = 100'000;

  XdmfDocument document_;
  XdmfItems items_;
  const std::shared_ptr<SpoolFile> begins_;  // of the cells of all grids
  const std::shared_ptr<SpoolFile> values_;  // of functions of finite elements
  std::map<pugi::xml_node, Times> times_;    // of temporal collections
  std::vector<Leaf> leaves_;
  std::set<std::pair<std::string, Centring>> attributes_of_grid_;
  std::set<std::string> warned_;
  size_t visited_ = 0;
  uint64_t nodes_of_file_ = 0;  // of the grid whose cells have points of their own
  XdmfFile file_;
};

}  // namespace

bool isXdmf(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kLooked)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  if (begin.find('\0') != std::string::npos) return false;
  begin = lowerCase(begin);
  return begin.find("<xdmf") != std::string::npos || begin.find("<!doctype xdmf") != std::string::npos;
}

XdmfFile readXdmf(const OpenGridOptions& options) {
  return Reader(options).run();
}

}  // namespace curvisplat
