#include "preprocess/formats/xdmf/xdmf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <pugixml.hpp>
#include <set>
#include <sstream>

#include "preprocess/formats/common/ascii_spool.h"
#include "preprocess/formats/common/stored_values.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/xdmf/xdmf_hdf5.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/paths.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLooked = 2048;
constexpr int kMaxDepth = 32;
constexpr uint64_t kMaxNodesAlong = uint64_t{1} << 40;

std::string lower(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

std::string trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t\r\n") + 1 - first));
}

/// The first of the attributes that there is.
std::string attributeOf(const pugi::xml_node& node, std::initializer_list<const char*> names) {
  for (const char* const name : names)
    if (const pugi::xml_attribute attribute = node.attribute(name)) return trimmed(attribute.value());
  return "";
}

class Reader {
 public:
  explicit Reader(const OpenGridOptions& options)
      : path_(options.grid), folder_(folderOf(options.grid)), pool_(std::make_shared<OpenFiles>()) {
    const std::string text = readTextFile(path_);
    const pugi::xml_parse_result parsed = document_.load_buffer(text.data(), text.size());
    if (!parsed)
      throw Error("{}: byte {}: is not valid XML ({})", name(), parsed.offset, parsed.description());
    const pugi::xml_node domain = document_.child("Xdmf").child("Domain");
    if (!domain) throw Error("{}: has no Domain; expected an XDMF file with a grid", name());
    if (text.find("<xi:include") != std::string::npos)
      throw Error("{}: includes parts by XInclude, which is not read; write the grids out", name());
    file_.files = {name()};
    for (const pugi::xml_node grid : domain.children("Grid")) findLeaves(grid, std::nullopt, 0);
    if (leaves_.empty()) throw Error("{}: has no Grid; expected a structured grid", name());
    chooseStep(options);
  }

  XdmfFile run() {
    std::string flat;
    size_t flat_count = 0;
    for (const Leaf& leaf : leaves_) {
      XdmfGrid grid = readGrid(leaf.node);
      if (std::all_of(grid.nodes.begin(), grid.nodes.end(), [](uint64_t n) { return n > 1; })) {
        file_.grids.push_back(std::move(grid));
        continue;
      }
      ++flat_count;
      if (flat.empty())
        flat = fmt::format("{} of {}x{}x{} nodes", grid.name, grid.nodes[0], grid.nodes[1], grid.nodes[2]);
    }
    if (file_.grids.empty())
      throw Error("{}: has no grid with volume: {} is flat; expected a three-dimensional grid", name(), flat);
    if (flat_count > 0)
      file_.warnings.push_back(
          fmt::format("{} of {} grids are flat and left out, such as {}", flat_count, leaves_.size(), flat));
    return std::move(file_);
  }

 private:
  struct Leaf {
    pugi::xml_node node;
    std::optional<double> time;
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

  std::string name() const { return path_.string(); }

  std::string describe(const pugi::xml_node& node) const {
    const std::string own = attributeOf(node, {"Name"});
    const std::string of = own.empty() ? own : fmt::format(" {}", printable(own.substr(0, 60)));
    return fmt::format("{}: {}{}", name(), node.name(), of);
  }

  /// The element that `node` refers to, or itself.
  pugi::xml_node resolved(pugi::xml_node node) const {
    for (int depth = 0; depth < kMaxDepth; ++depth) {
      std::string path = attributeOf(node, {"Reference"});
      if (path.empty()) return node;
      if (path == "XML") path = trimmed(node.text().get());
      // Nothing that takes long to look up.
      const bool simple = path.size() < 1000 && path.starts_with('/') &&
                          path.find("//") == std::string::npos &&
                          path.find_first_of("(*|:") == std::string::npos;
      pugi::xml_node found;
      try {
        if (simple) found = document_.select_node(path.c_str()).node();
      } catch (const pugi::xpath_exception&) {
      }
      if (!found)
        throw Error("{} refers to {}, which the file does not have", describe(node), printable(path));
      node = found;
    }
    throw Error("{} refers to itself", describe(node));
  }

  double numberIn(const pugi::xml_node& node, const std::string& text) const {
    double value = 0;
    if (!parseNumber(text, value) || !std::isfinite(value))
      throw Error("{} has {}; expected a number", describe(node), printable(text.substr(0, 40)));
    return value;
  }

  std::vector<double> numbersIn(const pugi::xml_node& node, const std::string& text) const {
    std::vector<double> numbers;
    std::istringstream words(text);
    for (std::string word; words >> word;) {
      double value = 0;
      if (!parseNumber(word, value))
        throw Error("{} has {}; expected a number", describe(node), printable(word.substr(0, 40)));
      numbers.push_back(value);
    }
    return numbers;
  }

  std::vector<uint64_t> countsIn(const pugi::xml_node& node, const std::string& text) const {
    std::vector<uint64_t> counts;
    for (const double number : numbersIn(node, text)) {
      if (!(number >= 0 && number <= static_cast<double>(kMaxNodesAlong)) || number != std::floor(number))
        throw Error("{} has {}; expected dimensions", describe(node), printable(text.substr(0, 40)));
      counts.push_back(static_cast<uint64_t>(number));
    }
    return counts;
  }

  /// Times of the grids of a temporal collection, from its own Time element; none if it has none.
  const Times& timesOf(const pugi::xml_node& collection) {
    const auto [found, is_new] = times_.try_emplace(collection);
    Times& times = found->second;
    const pugi::xml_node time = collection.child("Time"), given = time.child("DataItem");
    const std::string type = lower(attributeOf(time, {"TimeType", "Type"}));
    if (!is_new || !given || (type != "list" && type != "hyperslab")) return times;
    const pugi::xml_node item = resolved(given);
    const std::string format = lower(attributeOf(item, {"Format"}));
    if (format.empty() || format == "xml") {
      times.numbers = numbersIn(item, item.text().get());
    } else {
      const std::shared_ptr<const XdmfValues> values = readItem(item, 0);
      const auto grids = collection.children("Grid");
      const auto used = static_cast<uint64_t>(std::distance(grids.begin(), grids.end()));
      times.numbers.resize(static_cast<size_t>(std::min(values->size(), std::max<uint64_t>(used, 3))));
      values->read(0, times.numbers);
    }
    if (!std::all_of(times.numbers.begin(), times.numbers.end(), [](double t) { return std::isfinite(t); }))
      throw Error("{} has a time that is no number", describe(item));
    times.spread = type == "hyperslab";
    if (times.spread && times.numbers.size() != 3)
      throw Error("{} has {} numbers; expected the first time, the step and the count", describe(item),
                  times.numbers.size());
    return times;
  }

  void findLeaves(const pugi::xml_node& given, std::optional<double> time, int depth) {
    if (depth > kMaxDepth) throw Error("{}: grids are nested more than {} deep", name(), kMaxDepth);
    if (++visited_ > kMaxGrids) throw Error("{}: has more than {} grids", name(), kMaxGrids);
    const pugi::xml_node grid = resolved(given);
    const std::string type = lower(attributeOf(grid, {"GridType", "Type"}));
    const std::string value = attributeOf(grid.child("Time"), {"Value"});
    if (!value.empty()) time = numberIn(grid.child("Time"), value);
    if (type == "subset") throw Error("{} is a SubSet, which is not read", describe(grid));
    if (type.empty() || type == "uniform") {
      leaves_.push_back({grid, time});
      return;
    }
    const bool temporal = lower(attributeOf(grid, {"CollectionType"})) == "temporal";
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

  XdmfGrid readGrid(const pugi::xml_node& node) {
    XdmfGrid grid;
    grid.name = attributeOf(node, {"Name"});
    if (grid.name.empty()) grid.name = fmt::format("grid {}", file_.grids.size() + 1);
    const pugi::xml_node topology = resolved(node.child("Topology"));
    if (!topology)
      throw Error("{} has no Topology; expected 3DSMesh, 3DRectMesh or 3DCoRectMesh", describe(node));
    const std::string type = attributeOf(topology, {"TopologyType", "Type"}), small = lower(type);
    if (!small.ends_with("smesh") && !small.ends_with("rectmesh"))
      throw Error(
          "{} has the topology {}, an unstructured grid, which is not read; expected 3DSMesh, 3DRectMesh or "
          "3DCoRectMesh",
          describe(node), printable(type.substr(0, 40)));
    const std::vector<uint64_t> counts =
        countsIn(topology, attributeOf(topology, {"Dimensions", "NumberOfElements"}));
    if (counts.empty() || counts.size() > 3)
      throw Error("{} has {} dimensions; expected 3", describe(topology), counts.size());
    grid.nodes = {1, 1, 1};
    for (size_t d = 0; d < counts.size(); ++d) grid.nodes[counts.size() - 1 - d] = counts[d];
    uint64_t nodes = 1;
    for (const uint64_t n : grid.nodes) {
      if (n == 0 || nodes > kMaxNodesAlong / n)
        throw Error("{} has impossible dimensions", describe(topology));
      nodes *= n;
    }
    if (std::any_of(grid.nodes.begin(), grid.nodes.end(), [](uint64_t n) { return n < 2; })) return grid;
    readGeometry(resolved(node.child("Geometry")), grid, describe(node));
    for (const pugi::xml_node attribute : node.children("Attribute"))
      readAttribute(resolved(attribute), grid);
    return grid;
  }

  void readGeometry(const pugi::xml_node& geometry, XdmfGrid& grid, const std::string& where) {
    if (!geometry) throw Error("{} has no Geometry", where);
    const std::string type = lower(attributeOf(geometry, {"GeometryType", "Type"}));
    std::vector<std::shared_ptr<const XdmfValues>> items;
    for (const pugi::xml_node item : geometry.children("DataItem")) {
      if (items.size() == 3) break;
      items.push_back(readItem(item, 0));
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

  void readAttribute(const pugi::xml_node& node, XdmfGrid& grid) {
    XdmfAttribute attribute;
    attribute.name = attributeOf(node, {"Name"});
    if (attribute.name.empty()) attribute.name = fmt::format("attribute {}", grid.attributes.size() + 1);
    const std::string centre = lower(attributeOf(node, {"Center"}));
    if (!centre.empty() && centre != "node" && centre != "cell") {
      warn(fmt::format("attribute {} belongs to each {}; it is left out", attribute.name, centre));
      return;
    }
    attribute.centring = centre == "cell" ? Centring::kCell : Centring::kNode;
    const pugi::xml_node item = node.child("DataItem");
    if (!item) throw Error("{} has no DataItem", describe(node));
    attribute.values = readItem(item, 0);
    const uint64_t less = attribute.centring == Centring::kCell ? 1 : 0;
    const uint64_t samples = (grid.nodes[0] - less) * (grid.nodes[1] - less) * (grid.nodes[2] - less);
    attribute.components = attribute.values->size() / samples;
    constexpr uint64_t kMaxComponents = 4096;
    if (attribute.values->size() % samples != 0 || attribute.components == 0 ||
        attribute.components > kMaxComponents)
      throw Error("{} has {} numbers; expected {}, or some times as many", describe(node),
                  attribute.values->size(), samples);
    const auto known = [&](const XdmfAttribute& other) {
      return other.name == attribute.name && other.centring == attribute.centring;
    };
    if (std::any_of(grid.attributes.begin(), grid.attributes.end(), known))
      warn(fmt::format("a second attribute {} is ignored", attribute.name));
    else
      grid.attributes.push_back(std::move(attribute));
  }

  void warn(std::string warning) {
    if (std::find(file_.warnings.begin(), file_.warnings.end(), warning) == file_.warnings.end())
      file_.warnings.push_back(std::move(warning));
  }

  std::shared_ptr<const XdmfValues> readItem(const pugi::xml_node& given, int depth) {
    if (depth > kMaxDepth) throw Error("{}: data items are nested more than {} deep", name(), kMaxDepth);
    const pugi::xml_node item = resolved(given);
    // Items that many grids refer to are kept once.
    std::shared_ptr<const XdmfValues>& known = items_[item];
    if (!known) known = readNewItem(item, depth);
    return known;
  }

  std::shared_ptr<const XdmfValues> readNewItem(const pugi::xml_node& item, int depth) {
    const std::string type = lower(attributeOf(item, {"ItemType", "Type"}));
    if (type == "hyperslab") return readSlab(item, depth);
    if (!type.empty() && type != "uniform")
      throw Error("{} is a {}, which is not computed; write its numbers", describe(item),
                  printable(type.substr(0, 40)));
    std::vector<uint64_t> dims = countsIn(item, attributeOf(item, {"Dimensions"}));
    const std::string format = lower(attributeOf(item, {"Format"}));
    const std::string text = trimmed(item.text().get());
    if (format.empty() || format == "xml")
      return xdmfInline(numbersIn(item, text), std::move(dims), describe(item));
    if (format == "hdf") return readHdf5(item, text, std::move(dims));
    if (format == "binary") return readBinary(item, text, std::move(dims));
    throw Error("{} has the format {}; expected XML, HDF or Binary", describe(item),
                printable(format.substr(0, 40)));
  }

  std::shared_ptr<const XdmfValues> readSlab(const pugi::xml_node& item, int depth) {
    const pugi::xml_node selection = item.child("DataItem"), source = selection.next_sibling("DataItem");
    if (!source) throw Error("{} is a HyperSlab without two data items", describe(item));
    const std::vector<uint64_t> numbers = countsIn(selection, selection.text().get());
    const std::shared_ptr<const XdmfValues> all = readItem(source, depth + 1);
    const size_t rank = all->dims().size();
    if (numbers.size() != 3 * rank)
      throw Error("{} has {} numbers; expected start, stride and count of {} dimensions", describe(item),
                  numbers.size(), rank);
    const auto part = [&](size_t n) {
      return std::vector<uint64_t>(numbers.begin() + static_cast<ptrdiff_t>(n * rank),
                                   numbers.begin() + static_cast<ptrdiff_t>((n + 1) * rank));
    };
    return xdmfHyperslab(all, {part(0), part(1), part(2)}, describe(item));
  }

  void addFile(const std::filesystem::path& path) {
    if (std::find(file_.files.begin(), file_.files.end(), path.string()) == file_.files.end())
      file_.files.push_back(path.string());
  }

  std::filesystem::path existing(const pugi::xml_node& item, const std::string& text) const {
    const std::filesystem::path path = folder_ / text;
    if (!isRegularFile(path)) throw Error("{} names {}, which does not exist", describe(item), path.string());
    return path;
  }

  std::shared_ptr<const XdmfValues> readHdf5(const pugi::xml_node& item, const std::string& text,
                                             std::vector<uint64_t> dims) {
    const size_t colon = text.rfind(':');
    if (colon == std::string::npos || colon + 1 == text.size())
      throw Error("{} has \"{}\"; expected FILE:/DATA", describe(item), printable(text.substr(0, 60)));
    const std::filesystem::path path = existing(item, text.substr(0, colon));
    addFile(path);
    return openXdmfHdf5(hdf5_sets_, path, text.substr(colon + 1), std::move(dims));
  }

  std::shared_ptr<const XdmfValues> readBinary(const pugi::xml_node& item, const std::string& text,
                                               std::vector<uint64_t> dims) {
    XdmfBinary binary;
    const std::filesystem::path path = existing(item, text);
    addFile(path);
    binary.file = std::make_shared<const PooledFile>(pool_, path);
    const std::string kind = lower(attributeOf(item, {"NumberType", "DataType"}));
    const std::string precision = attributeOf(item, {"Precision"}), seek = attributeOf(item, {"Seek"});
    binary.kind = kind == "int" ? 'i' : kind == "uint" || kind == "uchar" ? 'u' : kind == "char" ? 'i' : 'f';
    binary.bytes = kind == "uchar" || kind == "char" ? 1 : 4;
    if (!precision.empty()) binary.bytes = static_cast<int>(std::clamp(numberIn(item, precision), 0.0, 99.0));
    const bool known = binary.bytes == 4 || binary.bytes == 8 ||
                       (binary.kind != 'f' && (binary.bytes == 1 || binary.bytes == 2));
    if (!known) throw Error("{} has numbers of {} bytes; expected 4 or 8", describe(item), binary.bytes);
    if (!seek.empty()) binary.seek = countsIn(item, seek).at(0);
    const std::string order = lower(attributeOf(item, {"Endian"}));
    if (order == "big") binary.swap = kMachineByteOrder == ByteOrder::kLittle;
    if (order == "little") binary.swap = kMachineByteOrder == ByteOrder::kBig;
    return openXdmfBinary(binary, std::move(dims));
  }

  static constexpr size_t kMaxGrids = 100'000;

  std::filesystem::path path_, folder_;
  std::shared_ptr<OpenFiles> pool_;
  const std::shared_ptr<XdmfHdf5Sets> hdf5_sets_ = std::make_shared<XdmfHdf5Sets>();
  pugi::xml_document document_;
  std::map<pugi::xml_node, std::shared_ptr<const XdmfValues>> items_;
  std::map<pugi::xml_node, Times> times_;  // of temporal collections
  std::vector<Leaf> leaves_;
  size_t visited_ = 0;
  XdmfFile file_;
};

}  // namespace

bool isXdmf(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kLooked)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  if (begin.find('\0') != std::string::npos) return false;
  begin = lower(std::move(begin));
  return begin.find("<xdmf") != std::string::npos || begin.find("<!doctype xdmf") != std::string::npos;
}

XdmfFile readXdmf(const OpenGridOptions& options) {
  return Reader(options).run();
}

}  // namespace curvisplat
