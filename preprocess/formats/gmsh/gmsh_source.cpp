#include "preprocess/formats/gmsh/gmsh_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/gmsh/gmsh_reader.h"
#include "preprocess/formats/gmsh/gmsh_tags.h"
#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kAtOnce = 65536, kSamplesAtOnce = 1 << 20;
constexpr size_t kMaxBlocks = 1'000'000, kMaxData = 100'000;

// ---- kinds of elements ----

struct Element {
  int type;
  size_t nodes;
  CellKind kind;
  std::array<uint8_t, 27> order{};  // of second order: Gmsh's node for each of VTK's
};

/// Source: Gmsh's reference manual, "Node ordering" and "MSH file format".
constexpr Element kElements[] = {
    {4, 4, CellKind::kTetrahedron},
    {5, 8, CellKind::kHexahedron},
    {6, 6, CellKind::kWedge},
    {7, 5, CellKind::kPyramid},
    {11, 10, CellKind::kTetrahedron, {0, 1, 2, 3, 4, 5, 6, 7, 9, 8}},
    {12, 27, CellKind::kHexahedron, {0,  1,  2,  3,  4,  5,  6,  7,  8,  11, 13, 9,  16, 18,
                                     19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26}},
    {13, 18, CellKind::kWedge, {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16}},
    {14, 14, CellKind::kPyramid, {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12, 13}},
    {17, 20, CellKind::kHexahedron, {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15}},
    {18, 15, CellKind::kWedge, {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11}},
    {19, 13, CellKind::kPyramid, {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12}},
    // Cells of orders above 2, which are drawn by their corners.
    {29, 20, CellKind::kTetrahedron},
    {30, 35, CellKind::kTetrahedron},
    {31, 56, CellKind::kTetrahedron},
    {92, 64, CellKind::kHexahedron},
    {93, 125, CellKind::kHexahedron},
    {90, 40, CellKind::kWedge},
    {91, 75, CellKind::kWedge},
    {118, 30, CellKind::kPyramid},
    {119, 55, CellKind::kPyramid},
    // Points, lines and faces.
    {15, 1, CellKind::kNone},
    {1, 2, CellKind::kNone},
    {2, 3, CellKind::kNone},
    {3, 4, CellKind::kNone},
    {8, 3, CellKind::kNone},
    {9, 6, CellKind::kNone},
    {10, 9, CellKind::kNone},
    {16, 8, CellKind::kNone},
    {20, 9, CellKind::kNone},
    {21, 10, CellKind::kNone},
    {22, 12, CellKind::kNone},
    {23, 15, CellKind::kNone},
    {24, 15, CellKind::kNone},
    {25, 21, CellKind::kNone},
    {26, 4, CellKind::kNone},
    {27, 5, CellKind::kNone},
    {28, 6, CellKind::kNone},
    {36, 16, CellKind::kNone},
    {37, 25, CellKind::kNone},
    {38, 36, CellKind::kNone},
};

bool isCurved(const Element& element) {
  return element.order[1] != 0;
}
bool isOfHigherOrder(const Element& element) {
  return !isCurved(element) && element.nodes > cornersOf(element.kind);
}

// ---- the source ----

class GmshSource final : public ElementSource {
 public:
  explicit GmshSource(const OpenGridOptions& options);

 private:
  /// A run of elements of one kind.
  struct Block {
    const Element* element = nullptr;
    uint64_t count = 0, nodes = 0;  // nodes: of the first one, in nodes_
  };
  /// The header of a section of values, and where they begin.
  struct Data {
    std::string name;
    Centring centring = Centring::kNode;
    double time = 0;
    uint64_t components = 1, count = 0, offset = 0;
  };
  struct Scalar {
    size_t field = 0;
    int component = 0;
  };
  struct Field {
    SpooledNumbers values;
    uint64_t components = 1;
  };

  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override;
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override;
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override;
  void readFormat();
  void readNodes();
  void readElements();
  void readElement(const Element& element, uint64_t tag, NumberSpool<uint64_t>& nodes);
  void flushNodes(NumberSpool<uint64_t>& nodes);
  const Element& elementOf(int type) const;
  void readDataHeader(Centring centring);
  void addFields(std::optional<uint32_t> time_step);
  SpooledNumbers valuesOf(const std::vector<const Data*>& sections, uint64_t samples, const GmshTags& tags);

  std::shared_ptr<SpoolFile> place_spool_, node_spool_, value_spool_, tag_spool_, element_tag_spool_;
  GmshReader reader_;
  bool version4_ = true;
  GmshTags node_tags_, element_tags_;
  SpooledNumbers places_, nodes_;
  std::vector<Block> blocks_;
  std::vector<uint64_t> pending_;  // tags of nodes
  uint64_t cells_ = 0, left_out_ = 0;
  bool has_nodes_ = false, has_elements_ = false;
  std::vector<Data> data_;
  std::vector<Field> fields_;
  std::vector<Scalar> scalars_;  // [description_.scalars]
};

GmshSource::GmshSource(const OpenGridOptions& options)
    : place_spool_(std::make_shared<SpoolFile>(options.temporary_folder)),
      node_spool_(std::make_shared<SpoolFile>(options.temporary_folder)),
      value_spool_(std::make_shared<SpoolFile>(options.temporary_folder)),
      tag_spool_(std::make_shared<SpoolFile>(options.temporary_folder)),
      element_tag_spool_(std::make_shared<SpoolFile>(options.temporary_folder)),
      reader_(std::make_shared<const PooledFile>(std::make_shared<OpenFiles>(), options.grid)),
      node_tags_(tag_spool_, options.grid.string(), "nodes"),
      element_tags_(element_tag_spool_, options.grid.string(), "elements") {
  readFormat();
  std::set<std::string> left_out;
  while (const auto section = reader_.line()) {
    if (!section->starts_with('$'))
      reader_.fail(fmt::format("has \"{}\" in the place of a section", printable(*section)));
    const std::string name = section->substr(1);
    if (name == "Nodes")
      readNodes();
    else if (name == "Elements")
      readElements();
    else if (name == "NodeData" || name == "ElementData")
      readDataHeader(name == "NodeData" ? Centring::kNode : Centring::kCell);
    else if (name == "ElementNodeData" || name == "ParametricElements")
      left_out.insert(name);
    reader_.skipTo("$End" + name);
  }
  if (!has_nodes_ || !has_elements_)
    reader_.fail(fmt::format("has no ${}", has_nodes_ ? "Elements" : "Nodes"));
  if (cells_ == 0)
    throw Error("{}: has no elements with a volume; expected a mesh in three dimensions", reader_.name());
  for (const std::string& name : left_out)
    description_.warnings.push_back(fmt::format("left out: ${}", name));
  if (left_out_ > 0)
    description_.warnings.push_back(fmt::format("{} of an order above 2 {} drawn by their corners",
                                                countText(left_out_, "element"), isOrAre(left_out_)));
  description_.files = {reader_.name()};
  description_.format =
      fmt::format("Gmsh {}, {}", version4_ ? "4.1" : "2.2", reader_.isBinary() ? "binary" : "ASCII");
  description_.coordinate_bytes = 8;
  description_.pieces.push_back({"mesh", reader_.name(), node_tags_.count(), cells_});
  addFields(options.time_step);
}

void GmshSource::readFormat() {
  reader_.requiredLine();
  const double version = reader_.textNumber(), binary = reader_.textNumber(), bytes = reader_.textNumber();
  version4_ = version == 4.1;
  if (!version4_ && version != 2 && version != 2.1 && version != 2.2)
    throw Error(
        "{}: is a Gmsh mesh of version {}; expected 4.1 or 2.2: save it so (gmsh FILE -save -format msh41 -o "
        "OUT.msh)",
        reader_.name(), version);
  if (binary == 1) {
    if (bytes != 8) reader_.fail(fmt::format("has numbers of {} bytes; expected 8", bytes));
    reader_.setBinary(false);
    reader_.endLine();
    if (const auto one = reader_.next<int32_t>(); one != 1) {
      if (byteSwapped(static_cast<uint32_t>(one)) != 1) reader_.fail("has no 1 to tell its byte order");
      reader_.setBinary(true);
    }
  }
  reader_.skipTo("$EndMeshFormat");
}

void GmshSource::readNodes() {
  if (std::exchange(has_nodes_, true)) reader_.fail("has $Nodes twice");
  NumberSpool<double> places(place_spool_);
  const auto addPlace = [&](int parameters) {
    for (int axis = 0; axis < 3; ++axis) places.add(reader_.next<double>());
    for (int n = 0; n < parameters; ++n) reader_.next<double>();
  };
  if (version4_) {
    const uint64_t blocks = reader_.nextCount(true);
    for (int n = 0; n < 3; ++n) reader_.nextTag(true);
    for (uint64_t block = 0; block < blocks; ++block) {
      const auto dimension = reader_.next<int32_t>();
      reader_.next<int32_t>();
      const auto parametric = reader_.next<int32_t>();
      if (dimension < 0 || dimension > 3)
        reader_.fail(fmt::format("has an entity of {} dimensions", dimension));
      const uint64_t count = reader_.nextCount(true);
      for (uint64_t n = 0; n < count; ++n) node_tags_.add(reader_.nextTag(true));
      for (uint64_t n = 0; n < count; ++n) addPlace(parametric != 0 ? dimension : 0);
    }
  } else {
    const double count = reader_.textNumber();
    if (!(count >= 0 && count <= static_cast<double>(reader_.size())))
      reader_.fail(fmt::format("counts {} nodes", count));
    reader_.endLine();
    for (uint64_t n = 0; n < static_cast<uint64_t>(count); ++n) {
      node_tags_.add(reader_.nextTag(false));
      addPlace(0);
    }
  }
  node_tags_.finish();
  places_ = places.finish();
}

const Element& GmshSource::elementOf(int type) const {
  for (const Element& element : kElements)
    if (element.type == type) return element;
  throw Error("{}: has elements of type {}, which is not read; convert it (meshio convert FILE mesh.vtu)",
              reader_.name(), type);
}

/// Adds an element if it has a volume, and skips it otherwise.
void GmshSource::readElement(const Element& element, uint64_t tag, NumberSpool<uint64_t>& nodes) {
  if (element.kind == CellKind::kNone) {
    for (size_t n = 0; n < element.nodes; ++n) reader_.nextTag(version4_);
    return;
  }
  if (blocks_.empty() || blocks_.back().element != &element) {
    if (blocks_.size() == kMaxBlocks)
      throw Error(
          "{}: has its elements in more than {} lists of one kind; sort them by kind (save it as version "
          "4.1)",
          reader_.name(), kMaxBlocks);
    blocks_.push_back({&element, 0, nodes.size() + pending_.size()});
  }
  ++blocks_.back().count;
  ++cells_;
  left_out_ += isOfHigherOrder(element) ? 1 : 0;
  has_curved_cells_ |= isCurved(element);
  element_tags_.add(tag);
  for (size_t n = 0; n < element.nodes; ++n) pending_.push_back(reader_.nextTag(version4_));
  if (pending_.size() >= kAtOnce) flushNodes(nodes);
}

void GmshSource::flushNodes(NumberSpool<uint64_t>& nodes) {
  node_tags_.replace(pending_);
  for (const uint64_t node : pending_) nodes.add(node);
  pending_.clear();
}

void GmshSource::readElements() {
  if (!has_nodes_) reader_.fail("has $Elements before $Nodes");
  if (std::exchange(has_elements_, true)) reader_.fail("has $Elements twice");
  NumberSpool<uint64_t> nodes(node_spool_);
  if (version4_) {
    const uint64_t blocks = reader_.nextCount(true);
    for (int n = 0; n < 3; ++n) reader_.nextTag(true);
    for (uint64_t block = 0; block < blocks; ++block) {
      reader_.next<int32_t>();
      reader_.next<int32_t>();
      const Element& element = elementOf(reader_.next<int32_t>());
      const uint64_t count = reader_.nextCount(true);
      for (uint64_t n = 0; n < count; ++n) readElement(element, reader_.nextTag(true), nodes);
    }
  } else {
    const double count = reader_.textNumber();
    if (!(count >= 0 && count <= static_cast<double>(reader_.size())))
      reader_.fail(fmt::format("counts {} elements", count));
    reader_.endLine();
    for (uint64_t n = 0; n < static_cast<uint64_t>(count);) {
      // In binary elements of one kind follow their header; in text each one has its own.
      uint64_t tag = reader_.isBinary() ? 0 : reader_.nextTag(false);
      const Element& element = elementOf(reader_.next<int32_t>());
      const uint64_t some = reader_.isBinary() ? reader_.nextCount(false) : 1;
      const uint64_t tags = reader_.nextCount(false);
      if (some == 0) reader_.fail("has a list of no elements");
      for (uint64_t k = 0; k < some; ++k, ++n) {
        if (reader_.isBinary()) tag = reader_.nextTag(false);
        for (uint64_t t = 0; t < tags; ++t) reader_.next<int32_t>();
        readElement(element, tag, nodes);
      }
    }
  }
  flushNodes(nodes);
  nodes_ = nodes.finish();
  element_tags_.finish();
}

/// Reads the header of a section of values: its names, real numbers and integers, which are always text.
void GmshSource::readDataHeader(Centring centring) {
  Data data;
  data.centring = centring;
  const auto countOf = [&](const char* what) {
    const double count = reader_.textNumber();
    if (!(count >= 0 && count <= 1000)) reader_.fail(fmt::format("counts {} {}", count, what));
    return static_cast<size_t>(count);
  };
  for (size_t n = countOf("names"); n > 0; --n) {
    const std::string words = reader_.requiredLine();
    if (data.name.empty()) data.name = words;
  }
  std::erase(data.name, '"');
  const size_t reals = countOf("times");
  for (size_t n = 0; n < reals; ++n)
    if (const double real = reader_.textNumber(); n == 0) data.time = real;
  const size_t integers = countOf("sizes");
  std::vector<double> sizes(std::max<size_t>(3, integers));
  for (size_t n = 0; n < integers; ++n) sizes[n] = reader_.textNumber();
  if (integers < 3 || !(sizes[1] >= 1 && sizes[1] <= 9) ||
      !(sizes[2] >= 0 && sizes[2] <= static_cast<double>(reader_.size())))
    reader_.fail(fmt::format("has values of {} components for {} samples", sizes[1], sizes[2]));
  reader_.endLine();
  data.components = static_cast<uint64_t>(sizes[1]);
  data.count = static_cast<uint64_t>(sizes[2]);
  data.offset = reader_.offset();
  if (reader_.isBinary() &&
      data.count * (4 + 8 * data.components) > reader_.size() - std::min(reader_.size(), data.offset))
    reader_.fail("ends within values");
  if (reader_.isBinary()) reader_.seek(data.offset + data.count * (4 + 8 * data.components));
  if (data.name.empty()) data.name = centring == Centring::kNode ? "NodeData" : "ElementData";
  if (data_.size() == kMaxData) reader_.fail(fmt::format("has more than {} sections of values", kMaxData));
  data_.push_back(std::move(data));
}

void GmshSource::addFields(std::optional<uint32_t> time_step) {
  std::set<double> times;
  for (const Data& data : data_) times.insert(data.time);
  if (times.size() > 1) description_.times.assign(times.begin(), times.end());
  description_.time_step = chosenTimeStep(reader_.name(), description_.times, time_step);
  const double time = times.size() > 1 ? description_.times[description_.time_step] : 0;
  std::map<std::pair<std::string, Centring>, std::vector<const Data*>> of_name;
  std::vector<std::pair<std::string, Centring>> names;
  for (const Data& data : data_) {
    if (times.size() > 1 && data.time != time) continue;
    auto& sections = of_name[{data.name, data.centring}];
    if (sections.empty()) names.emplace_back(data.name, data.centring);
    if (!sections.empty() && sections.front()->components != data.components)
      throw Error("{}: has {} with {} and with {} components", reader_.name(), data.name,
                  sections.front()->components, data.components);
    sections.push_back(&data);
  }
  ScalarList list(description_);
  for (const auto& name : names) {
    const auto& sections = of_name[name];
    const bool nodes = name.second == Centring::kNode;
    const uint64_t components = sections.front()->components;
    size_t number = 0;
    forEachComponent(components, [&](const std::string& suffix, int component) {
      list.add(namesOfComponent(name.first, suffix, name.second, ++number), name.second);
      scalars_.push_back({fields_.size(), component});
    });
    fields_.push_back(
        {valuesOf(sections, nodes ? node_tags_.count() : cells_, nodes ? node_tags_ : element_tags_),
         components});
  }
}

/// Spools the values of all samples, in their order; NaN for samples that the sections leave out.
SpooledNumbers GmshSource::valuesOf(const std::vector<const Data*>& sections, uint64_t samples,
                                    const GmshTags& tags) {
  const uint64_t components = sections.front()->components;
  NumberSpool<double> spool(value_spool_);
  std::vector<double> part, some;
  std::vector<uint64_t> numbers;
  for (uint64_t begin = 0; begin < samples; begin += kSamplesAtOnce) {
    const uint64_t count = std::min(kSamplesAtOnce, samples - begin);
    part.assign(count * components, kNaN);
    for (const Data* data : sections) {
      reader_.seek(data->offset);
      for (uint64_t n = 0; n < data->count; n += numbers.size()) {
        numbers.resize(std::min(kAtOnce, data->count - n));
        some.resize(numbers.size() * components);
        for (size_t k = 0; k < numbers.size(); ++k) {
          numbers[k] = reader_.nextTag(false);
          for (uint64_t c = 0; c < components; ++c) some[k * components + c] = reader_.next<double>();
        }
        tags.replace(numbers);
        for (size_t k = 0; k < numbers.size(); ++k)
          if (numbers[k] >= begin && numbers[k] - begin < count)
            std::copy_n(&some[k * components], components, &part[(numbers[k] - begin) * components]);
      }
    }
    for (const double value : part) spool.add(value);
  }
  return spool.finish();
}

void GmshSource::readPlaces(uint32_t, uint64_t first, uint64_t count, const Places& to) const {
  std::vector<double> places(3 * count);
  places_.read(3 * first, std::span(places));
  for (size_t n = 0; n < places.size(); ++n) to.axes[n % 3][n / 3] = places[n];
}

void GmshSource::appendCells(uint32_t, uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> nodes;
  std::array<uint64_t, 27> turned{};
  forEachPartOfLists(
      blocks_, first, count, [](const Block& block) { return block.count; },
      [&](const PartOfList& part) {
        const Element& element = *blocks_[part.list].element;
        nodes.resize(part.count * element.nodes);
        nodes_.read(blocks_[part.list].nodes + part.first * element.nodes, std::span(nodes));
        for (uint64_t n = 0; n < part.count; ++n) {
          const auto of_cell = std::span<const uint64_t>(nodes).subspan(n * element.nodes, element.nodes);
          if (!isCurved(element)) {
            out.append(element.kind, of_cell.first(cornersOf(element.kind)));
            continue;
          }
          for (size_t k = 0; k < element.nodes; ++k) turned[k] = of_cell[element.order[k]];
          appendCurved(element.kind, std::span(turned).first(element.nodes), out);
        }
      });
}

void GmshSource::readValues(uint32_t, uint32_t scalar, uint64_t first, std::span<float> to) const {
  const auto [number, component] = scalars_[scalar];
  const Field& field = fields_[number];
  std::vector<double> values(to.size() * field.components);
  field.values.read(first * field.components, std::span(values));
  for (size_t n = 0; n < to.size(); ++n) {
    const std::span<const double> tuple = std::span(values).subspan(n * field.components, field.components);
    double value = 0;
    if (component == kMagnitude) {
      for (const double one : tuple) value += one * one;
      value = std::sqrt(value);
    } else {
      value = tuple[static_cast<size_t>(component)];
    }
    to[n] = convertedTo<float>(value);
  }
}

}  // namespace

bool isGmsh(const InputFile& file) {
  std::string begin(std::string_view("$MeshFormat").size(), '\0');
  if (file.size() < begin.size()) return false;
  file.readAt(0, std::span(begin.data(), begin.size()));
  return begin == "$MeshFormat";
}

std::unique_ptr<DataSource> openGmsh(const OpenGridOptions& options) {
  return std::make_unique<GmshSource>(options);
}

}  // namespace curvisplat
