#include "preprocess/formats/exodus/exodus_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/exodus/exodus_names.h"
#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// Files of before 2004 have all scalars of the nodes in one variable; later ones have a number behind its name.
constexpr const char* kAllOfNodes = "vals_nod_var";

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

uint64_t lengthOf(const NetcdfFile& file, const std::string& dimension) {
  for (const NetcdfDimension& d : file.dimensions())
    if (d.name == dimension) return d.length;
  return 0;
}

// Elements of the highest order that the format knows have 64 nodes.
constexpr uint64_t kMaxNodes = 1024;

/// The numbers of the element blocks, of their variables connect1, connect2, ...: a damaged dimension num_el_blk
/// may be any number.
std::vector<size_t> blocksIn(const NetcdfFile& file) {
  constexpr std::string_view kPrefix = "connect";
  const uint64_t most = lengthOf(file, "num_el_blk");
  std::vector<size_t> numbers;
  for (const NetcdfVariable& variable : file.variables()) {
    if (!variable.name.starts_with(kPrefix)) continue;
    const std::string_view digits = std::string_view(variable.name).substr(kPrefix.size());
    size_t number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    const bool whole = error == std::errc{} && end == digits.data() + digits.size() && digits[0] != '0';
    if (whole && number <= most) numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

/// "HEX20" -> HEX; the corners of a solid come first in all of them.
CellKind kindOf(std::string type) {
  std::transform(type.begin(), type.end(), type.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; });
  if (type.starts_with("HEX")) return CellKind::kHexahedron;
  if (type.starts_with("TET")) return CellKind::kTetrahedron;
  if (type.starts_with("WED")) return CellKind::kWedge;
  if (type.starts_with("PYR")) return CellKind::kPyramid;
  return CellKind::kNone;
}

class ExodusSource final : public ElementSource {
 public:
  explicit ExodusSource(const OpenGridOptions& options);

 private:
  struct Block {
    size_t number = 0;  // from 1, in the names of variables
    CellKind kind = CellKind::kNone;
    uint64_t elements = 0, nodes_each = 0;
    const NetcdfVariable* connect = nullptr;
  };
  static uint64_t elementsOf(const Block& block) { return block.elements; }

  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override;
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override;
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override;
  void findBlocks();
  void findScalars(const char* names, const char* values, Centring centring);
  std::vector<std::string> namesIn(const char* variable) const;
  void readVariable(const NetcdfVariable* variable, uint64_t first, std::span<float> to,
                    std::optional<size_t> of_all = {}) const;

  std::unique_ptr<NetcdfFile> file_;
  std::vector<Block> blocks_;
  std::vector<size_t> number_of_scalar_;  // [description_.scalars], from 1
  uint64_t nodes_ = 0, elements_ = 0;
};

ExodusSource::ExodusSource(const OpenGridOptions& options)
    : file_(std::make_unique<NetcdfFile>(options.grid)), nodes_(lengthOf(*file_, "num_nodes")) {
  const std::string name = options.grid.string();
  if (lengthOf(*file_, "num_dim") != 3)
    throw Error("{}: is an Exodus file of {} dimensions; expected 3", name, lengthOf(*file_, "num_dim"));
  findBlocks();
  const NetcdfVariable* const times = file_->find("time_whole");
  if (times && times->dims.size() == 1) {
    description_.times.resize(file_->dimension(*times, 0).length);
    if (!description_.times.empty())
      file_->read(*times, {{0}, {description_.times.size()}}, std::span(description_.times));
  }
  description_.time_step = chosenTimeStep(name, description_.times, options.time_step);
  description_.format =
      fmt::format("Exodus ({}), {}", file_->kind(), countText(blocks_.size(), "element block"));
  description_.files = {name};
  if (const std::string note = noteOnOtherExodusFiles(options.grid); !note.empty() && !options.is_part)
    description_.warnings.push_back(note);
  description_.pieces.push_back({"piece 1", name, nodes_, elements_});
  const NetcdfVariable* const x = file_->find(file_->find("coord") ? "coord" : "coordx");
  if (!x) throw Error("{}: has no coordinates (coordx)", name);
  description_.coordinate_bytes = x->value_bytes == 8 ? 8 : 4;
  findScalars("name_nod_var", kAllOfNodes, Centring::kNode);
  findScalars("name_elem_var", "vals_elem_var", Centring::kCell);
}

void ExodusSource::findBlocks() {
  const std::string name = file_->path().string();
  uint64_t solid = 0, others = 0;
  for (const size_t number : blocksIn(*file_)) {
    const NetcdfVariable* const connect = file_->find(fmt::format("connect{}", number));
    if (connect->dims.size() != 2)
      throw Error(
          "{}: {} has {} dimensions; expected elements and their nodes (blocks of polyhedra are not read)",
          name, connect->name, connect->dims.size());
    Block block;
    block.number = number;
    block.connect = connect;
    block.elements = file_->dimension(*connect, 0).length;
    block.nodes_each = file_->dimension(*connect, 1).length;
    const std::string type = connect->text("elem_type");
    block.kind = kindOf(type);
    if (block.kind != CellKind::kNone && block.nodes_each < cornersOf(block.kind))
      throw Error("{}: {} is of {} with {} nodes each, too few; the file is damaged", name, connect->name,
                  type, block.nodes_each);
    if (block.kind != CellKind::kNone && block.nodes_each > kMaxNodes)
      throw Error("{}: {} is of {} with {} nodes each; expected at most {}; the file is damaged", name,
                  connect->name, type, block.nodes_each, kMaxNodes);
    (block.kind == CellKind::kNone ? others : solid) += block.elements;
    has_curved_cells_ |= block.nodes_each > cornersOf(block.kind) && block.kind != CellKind::kNone;
    elements_ += block.elements;
    blocks_.push_back(block);
  }
  if (solid == 0)
    throw Error(
        "{}: is a finite-element mesh (Exodus) without solid elements ({} others); expected HEX, TET, WEDGE "
        "or PYRAMID",
        name, others);
  if (others > 0)
    description_.warnings.push_back(
        fmt::format("{} elements are not HEX, TET, WEDGE or PYRAMID and are left out", others));
}

std::vector<std::string> ExodusSource::namesIn(const char* variable) const {
  std::vector<std::string> names;
  const NetcdfVariable* const found = file_->find(variable);
  if (!found || found->dims.size() != 2) return names;
  const std::string text = file_->readText(*found);
  const auto length = static_cast<size_t>(file_->dimension(*found, 1).length);
  for (size_t at = 0; length > 0 && at + length <= text.size(); at += length) {
    std::string name = text.substr(at, length);
    name = name.substr(0, name.find('\0'));
    name.erase(name.find_last_not_of(' ') + 1);
    names.push_back(name);
  }
  return names;
}

void ExodusSource::findScalars(const char* names, const char* values, Centring centring) {
  const std::vector<std::string> all = namesIn(names);
  ScalarList list(description_);
  for (size_t n = 0; n < all.size(); ++n) {
    bool any = false;
    if (centring == Centring::kNode)
      any = file_->find(fmt::format("{}{}", values, n + 1)) || file_->find(values);
    for (const Block& block : blocks_)
      any = any || file_->find(fmt::format("{}{}eb{}", values, n + 1, block.number)) != nullptr;
    if (!any) continue;
    const std::string name = all[n].empty() ? fmt::format("variable {}", n + 1) : all[n];
    list.add({name, name + (centring == Centring::kCell ? ":cell" : fmt::format(":{}", n + 1))}, centring);
    number_of_scalar_.push_back(n + 1);
  }
}

/// Values [first, ...) of the open step; NaN without a variable. `of_all`: which of all scalars, in a variable that has them together.
void ExodusSource::readVariable(const NetcdfVariable* variable, uint64_t first, std::span<float> to,
                                std::optional<size_t> of_all) const {
  if (!variable) return std::fill(to.begin(), to.end(), kNaN);
  if (description_.times.empty())
    throw Error("{}: has no time step: its variables ({}) hold no values yet", file_->path().string(),
                variable->name);
  const size_t last = of_all ? 2 : 1;
  if (variable->dims.size() != last + 1 || file_->dimension(*variable, 0).length <= description_.time_step ||
      (of_all && *of_all >= file_->dimension(*variable, 1).length) ||
      first + to.size() > file_->dimension(*variable, last).length)
    throw Error("{}: {} has other dimensions than time steps and {} values; the file is damaged",
                file_->path().string(), variable->name, first + to.size());
  if (to.empty()) return;
  if (of_all)
    file_->read(*variable, {{description_.time_step, *of_all, first}, {1, 1, to.size()}}, to);
  else
    file_->read(*variable, {{description_.time_step, first}, {1, to.size()}}, to);
}

void ExodusSource::readPlaces(uint32_t, uint64_t first, uint64_t count, const Places& to) const {
  const NetcdfVariable* const all = file_->find("coord");
  for (size_t axis = 0; axis < 3; ++axis) {
    const std::string name = fmt::format("coord{}", "xyz"[axis]);
    const NetcdfVariable* const one = file_->find(name);
    const NetcdfVariable* const variable = all ? all : one;
    if (!variable || variable->dims.size() != (all ? 2u : 1u) ||
        file_->dimension(*variable, all ? 1 : 0).length != nodes_ ||
        (all && file_->dimension(*all, 0).length != 3))
      throw Error("{}: has no {} of {} nodes; the file is damaged", file_->path().string(), name, nodes_);
    const NetcdfBox box = all ? NetcdfBox{{axis, first}, {1, count}} : NetcdfBox{{first}, {count}};
    if (count > 0) file_->read(*variable, box, to.span(axis, count));
  }
}

void ExodusSource::appendCells(uint32_t, uint64_t first, uint64_t count, MeshCells& out) const {
  std::vector<double> stored;
  std::vector<uint64_t> points;
  forEachPartOfLists(blocks_, first, count, elementsOf, [&](const PartOfList& part) {
    const Block& block = blocks_[part.list];
    // Elements that are left out are not read: they may have any number of nodes.
    const uint64_t nodes_each = block.kind == CellKind::kNone ? 0 : block.nodes_each;
    stored.resize(part.count * nodes_each);
    if (!stored.empty())
      file_->read(*block.connect, {{part.first, 0}, {part.count, nodes_each}}, std::span(stored));
    points.resize(nodes_each);
    for (uint64_t element = 0; element < part.count; ++element) {
      for (size_t n = 0; n < points.size(); ++n) points[n] = pointNumber(stored[element * nodes_each + n], 1);
      appendCurvedAsExodus(block.kind, false, points, out);
    }
  });
}

void ExodusSource::readValues(uint32_t, uint32_t scalar, uint64_t first, std::span<float> to) const {
  const size_t number = number_of_scalar_.at(scalar);
  if (description_.scalars[scalar].centring == Centring::kNode) {
    if (const NetcdfVariable* const of_all = file_->find(kAllOfNodes))
      return readVariable(of_all, first, to, number - 1);
    return readVariable(file_->find(fmt::format("{}{}", kAllOfNodes, number)), first, to);
  }
  forEachPartOfLists(blocks_, first, to.size(), elementsOf, [&](const PartOfList& part) {
    readVariable(file_->find(fmt::format("vals_elem_var{}eb{}", number, blocks_[part.list].number)),
                 part.first, to.subspan(part.at, part.count));
  });
}

}  // namespace

bool isExodus(const InputFile& file) {
  if (!NetcdfFile::recognises(file)) return false;
  try {
    const NetcdfFile netcdf(file.path());
    return lengthOf(netcdf, "num_nodes") > 0 && lengthOf(netcdf, "num_dim") > 0 &&
           (netcdf.hasAttribute("api_version") || netcdf.hasAttribute("floating_point_word_size"));
  } catch (const Error&) {
    return false;  // its reader says what is wrong
  }
}

std::unique_ptr<DataSource> openExodus(const OpenGridOptions& options) {
  return std::make_unique<ExodusSource>(options);
}

}  // namespace curvisplat
