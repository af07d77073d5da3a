#include "preprocess/formats/gmsh/gmsh_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/gmsh/gmsh_data.h"
#include "preprocess/formats/gmsh/gmsh_elements.h"
#include "preprocess/formats/gmsh/gmsh_parts.h"
#include "preprocess/formats/gmsh/gmsh_reader.h"
#include "preprocess/formats/gmsh/gmsh_tags.h"
#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kAtOnce = 65536;
constexpr size_t kMaxBlocks = 1'000'000, kMaxData = 100'000;

class GmshSource final : public ElementSource {
 public:
  explicit GmshSource(const OpenGridOptions& options);

 private:
  /// A run of elements of one kind.
  struct Block {
    const GmshElement* element = nullptr;
    uint64_t count = 0, nodes = 0;  // nodes: of the first one, in nodes_
  };
  struct Section {
    uint64_t begin = 0, bytes = 0;  // 0: the file has none so far
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
  void readMesh(const std::string& section);
  uint64_t readBlocks();
  int readDimension();
  void readNodes(bool parametric);
  void readElements();
  void readElement(const GmshElement& element, uint64_t tag, NumberSpool<uint64_t>& nodes);
  void flushNodes(NumberSpool<uint64_t>& nodes);
  const GmshElement& elementOf(int type) const;
  void addFields(std::optional<uint32_t> time_step);
  std::span<const uint64_t> nodesOf(uint64_t element);

  std::shared_ptr<SpoolFile> place_spool_, node_spool_, value_spool_, tag_spool_, element_tag_spool_;
  GmshReader reader_;
  bool version4_ = true, wide_ = true;  // 4.x; 4.1, whose tags are wide
  std::string version_;
  GmshPart part_;
  GmshTags node_tags_, element_tags_;
  SpooledNumbers places_, nodes_;
  std::vector<Block> blocks_;
  std::vector<uint64_t> pending_, of_element_, before_;  // tags of nodes
  uint64_t cells_ = 0, left_out_ = 0, repeated_ = 0;
  Section node_section_, element_section_;
  std::vector<GmshData> data_;
  std::vector<uint64_t> ahead_;  // nodes of elements, for nodesOf()
  PartOfList ahead_of_;          // whose they are; at: of the first one
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
  while (const auto section = reader_.line()) {
    if (!section->starts_with('$'))
      reader_.fail(fmt::format("has \"{}\" in the place of a section", printable(*section)));
    const std::string name = section->substr(1);
    if (name == "Nodes" || name == "ParametricNodes" || name == "Elements") {
      readMesh(name);
      continue;
    }
    if (name == "PartitionedEntities") part_ = readGmshPart(reader_);
    if (hasGmshData(name)) data_.push_back(readGmshData(reader_, name));
    if (data_.size() > kMaxData) reader_.fail(fmt::format("has more than {} sections of values", kMaxData));
    reader_.skipTo("$End" + name);
  }
  if (node_section_.bytes == 0 || element_section_.bytes == 0)
    reader_.fail(fmt::format("has no ${}", node_section_.bytes > 0 ? "Elements" : "Nodes"));
  if (cells_ == 0)
    throw Error("{}: has no elements with a volume; expected a mesh in three dimensions", reader_.name());
  if (left_out_ > 0)
    description_.warnings.push_back(
        fmt::format("{} of an order above 2 without nodes inside {} drawn by their corners",
                    countText(left_out_, "element"), isOrAre(left_out_)));
  if (repeated_ > 0)
    description_.notes.push_back(fmt::format("{} repeated for further physical groups {} drawn once",
                                             countText(repeated_, "element"), isOrAre(repeated_)));
  if (part_.parts > 1 && !options.is_part)
    description_.warnings.push_back(
        fmt::format("{} is part {} of a mesh that Gmsh saved in {} files: give all of them, as NAME_*.msh",
                    options.grid.filename().string(), part_.part, part_.parts));
  description_.files = {reader_.name()};
  description_.format = fmt::format("Gmsh {}, {}", version_, reader_.isBinary() ? "binary" : "ASCII");
  description_.coordinate_bytes = 8;
  description_.pieces.push_back({"mesh", reader_.name(), node_tags_.count(), cells_});
  addFields(options.time_step);
}

void GmshSource::readFormat() {
  const double version = readGmshFormat(reader_);
  version4_ = version >= 4;
  wide_ = version == 4.1;
  version_ = fmt::format("{:.1f}", version4_ ? version : 2.2);
}

/// Reads nodes or elements. Gmsh appends views to a file with their mesh, which is passed over if it is the same again.
void GmshSource::readMesh(const std::string& section) {
  const bool elements = section == "Elements";
  Section& known = elements ? element_section_ : node_section_;
  const uint64_t begin = reader_.offset();
  if (known.bytes == 0) elements ? readElements() : readNodes(section == "ParametricNodes");
  reader_.skipTo("$End" + section);
  const uint64_t bytes = reader_.offset() - begin;
  if (known.bytes > 0 && (bytes != known.bytes || !reader_.isSame(begin, known.begin, bytes)))
    throw Error("{}: has several meshes; expected one: save each to a file of its own", reader_.name());
  if (known.bytes == 0) known = {begin, bytes};
}

/// The number of the blocks that follow. Version 4.1 has the least and the largest number after that of all.
uint64_t GmshSource::readBlocks() {
  const uint64_t blocks = reader_.nextCount(true);
  for (int n = 0; n < (wide_ ? 3 : 1); ++n) reader_.nextTag(true);
  return blocks;
}

/// The dimension of a block's entity, which comes before its number in version 4.1.
int GmshSource::readDimension() {
  const auto first = reader_.next<int32_t>(), second = reader_.next<int32_t>();
  return wide_ ? first : second;
}

void GmshSource::readNodes(bool parametric) {
  NumberSpool<double> places(place_spool_);
  const auto addPlace = [&](int parameters) {
    for (int axis = 0; axis < 3; ++axis) places.add(reader_.next<double>());
    for (int n = 0; n < parameters; ++n) reader_.next<double>();
  };
  if (version4_) {
    const uint64_t blocks = readBlocks();
    for (uint64_t block = 0; block < blocks; ++block) {
      const int dimension = readDimension();
      const bool has_parameters = reader_.next<int32_t>() != 0;
      if (dimension < 0 || dimension > 3)
        reader_.fail(fmt::format("has an entity of {} dimensions", dimension));
      const uint64_t count = reader_.nextCount(true);
      for (uint64_t n = 0; wide_ && n < count; ++n) node_tags_.add(reader_.nextTag(true));
      for (uint64_t n = 0; n < count; ++n) {
        if (!wide_) node_tags_.add(reader_.nextTag(false));
        addPlace(has_parameters ? dimension : 0);
      }
    }
  } else {
    const double count = reader_.textNumber();
    if (!(count >= 0 && count <= static_cast<double>(reader_.size())))
      reader_.fail(fmt::format("counts {} nodes", count));
    reader_.endLine();
    for (uint64_t n = 0; n < static_cast<uint64_t>(count); ++n) {
      node_tags_.add(reader_.nextTag(false));
      addPlace(0);
      if (!parametric) continue;
      const auto dimension = reader_.next<int32_t>();
      reader_.next<int32_t>();
      for (int k = 0; k < dimension && dimension < 3; ++k) reader_.next<double>();
    }
  }
  node_tags_.finish();
  places_ = places.finish();
}

const GmshElement& GmshSource::elementOf(int type) const {
  if (const GmshElement* const element = gmshElement(type)) return *element;
  throw Error("{}: has elements of type {}, which is not read; convert it (meshio convert FILE mesh.vtu)",
              reader_.name(), type);
}

/// Adds an element with a volume, or passes over another one.
void GmshSource::readElement(const GmshElement& element, uint64_t tag, NumberSpool<uint64_t>& nodes) {
  if (element.kind == CellKind::kNone) {
    for (size_t n = 0; n < element.nodes; ++n) reader_.nextTag(wide_);
    return;
  }
  before_.swap(of_element_);
  of_element_.clear();
  for (size_t n = 0; n < element.nodes; ++n) of_element_.push_back(reader_.nextTag(wide_));
  // Version 2 has an element once for each of its physical groups, one after another, each with a number of its own.
  if (!version4_ && of_element_ == before_) {
    ++repeated_;
    element_tags_.addAnother(tag);
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
  left_out_ += !element.isCurved() && element.nodes > cornersOf(element.kind) ? 1 : 0;
  has_curved_cells_ |= element.isCurved();
  element_tags_.add(tag);
  pending_.insert(pending_.end(), of_element_.begin(), of_element_.end());
  if (pending_.size() >= kAtOnce) flushNodes(nodes);
}

void GmshSource::flushNodes(NumberSpool<uint64_t>& nodes) {
  node_tags_.replace(pending_);
  for (const uint64_t node : pending_) nodes.add(node);
  pending_.clear();
}

void GmshSource::readElements() {
  if (node_section_.bytes == 0) reader_.fail("has $Elements before $Nodes");
  NumberSpool<uint64_t> nodes(node_spool_);
  if (version4_) {
    const uint64_t blocks = readBlocks();
    for (uint64_t block = 0; block < blocks; ++block) {
      readDimension();
      const GmshElement& element = elementOf(reader_.next<int32_t>());
      const uint64_t count = reader_.nextCount(true);
      for (uint64_t n = 0; n < count; ++n) readElement(element, reader_.nextTag(wide_), nodes);
    }
  } else {
    const double count = reader_.textNumber();
    if (!(count >= 0 && count <= static_cast<double>(reader_.size())))
      reader_.fail(fmt::format("counts {} elements", count));
    reader_.endLine();
    for (uint64_t n = 0; n < static_cast<uint64_t>(count);) {
      // In binary elements of one kind follow their header; in text each one has its own.
      uint64_t tag = reader_.isBinary() ? 0 : reader_.nextTag(false);
      const GmshElement& element = elementOf(reader_.next<int32_t>());
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

void GmshSource::addFields(std::optional<uint32_t> time_step) {
  // Some programs number the steps alone.
  const bool has_times = std::any_of(data_.begin(), data_.end(),
                                     [&](const GmshData& data) { return data.time != data_.front().time; });
  std::set<double> times;
  for (GmshData& data : data_) times.insert(data.time = has_times ? data.time : data.step);
  if (times.size() > 1) description_.times.assign(times.begin(), times.end());
  description_.time_step = chosenTimeStep(reader_.name(), description_.times, time_step);
  const double time = times.size() > 1 ? description_.times[description_.time_step] : 0;
  std::map<std::pair<std::string, Centring>, std::vector<const GmshData*>> of_name;
  std::vector<std::pair<std::string, Centring>> names;
  for (const GmshData& data : data_) {
    if (times.size() > 1 && data.time != time) continue;
    auto& sections = of_name[{data.name, data.centring}];
    if (sections.empty()) names.emplace_back(data.name, data.centring);
    if (!sections.empty() && sections.front()->components != data.components)
      throw Error("{}: has {} with {} and with {} components", reader_.name(), data.name,
                  sections.front()->components, data.components);
    sections.push_back(&data);
  }
  const GmshSamples samples{value_spool_, node_tags_, element_tags_,
                            [&](uint64_t element) { return nodesOf(element); }};
  ScalarList list(description_);
  for (const auto& name : names) {
    const auto& sections = of_name[name];
    const uint64_t components = sections.front()->components;
    size_t number = 0;
    forEachComponent(components, [&](const std::string& suffix, int component) {
      list.add(namesOfComponent(name.first, suffix, name.second, ++number), name.second);
      scalars_.push_back({fields_.size(), component});
    });
    fields_.push_back({spooledGmshData(reader_, sections, samples), components});
  }
}

/// The nodes of an element, in the order of the file; the result is valid until the next call. For one thread.
std::span<const uint64_t> GmshSource::nodesOf(uint64_t element) {
  if (element < ahead_of_.at || element - ahead_of_.at >= ahead_of_.count)
    forEachPartOfLists(
        blocks_, element, 1, [](const Block& block) { return block.count; },
        [&](const PartOfList& part) {
          const Block& block = blocks_[part.list];
          const uint64_t count = std::min(kAtOnce / block.element->nodes, block.count - part.first);
          ahead_of_ = {part.list, part.first, count, element};
          ahead_.resize(count * block.element->nodes);
          nodes_.read(block.nodes + part.first * block.element->nodes, std::span(ahead_));
        });
  const size_t nodes = blocks_[ahead_of_.list].element->nodes;
  return std::span<const uint64_t>(ahead_).subspan((element - ahead_of_.at) * nodes, nodes);
}

void GmshSource::readPlaces(uint32_t, uint64_t first, uint64_t count, const Places& to) const {
  std::vector<double> places(3 * count);
  places_.read(3 * first, std::span(places));
  for (size_t n = 0; n < places.size(); ++n) to.axes[n % 3][n / 3] = places[n];
}

void GmshSource::appendCells(uint32_t, uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<uint64_t> nodes, turned;
  forEachPartOfLists(
      blocks_, first, count, [](const Block& block) { return block.count; },
      [&](const PartOfList& part) {
        const GmshElement& element = *blocks_[part.list].element;
        nodes.resize(part.count * element.nodes);
        nodes_.read(blocks_[part.list].nodes + part.first * element.nodes, std::span(nodes));
        for (uint64_t n = 0; n < part.count; ++n) {
          const auto of_cell = std::span<const uint64_t>(nodes).subspan(n * element.nodes, element.nodes);
          if (!element.isCurved()) {
            out.append(element.kind, of_cell.first(cornersOf(element.kind)));
            continue;
          }
          turned.clear();
          for (const uint16_t node : element.order) turned.push_back(of_cell[node]);
          appendCurved(element.kind, turned, out);
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
  const std::string begin = beginningOf(file, std::string_view("$MeshFormat").size());
  return begin == "$MeshFormat" || begin.starts_with("$Comments");
}

uint64_t gmshFiles(const std::filesystem::path& path) {
  return isRegularFile(path) && isGmsh(InputFile(path)) ? gmshParts(path) : 1;
}

std::unique_ptr<DataSource> openGmsh(const OpenGridOptions& options) {
  return std::make_unique<GmshSource>(options);
}

}  // namespace curvisplat
