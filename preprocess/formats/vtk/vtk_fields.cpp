#include "preprocess/formats/vtk/vtk_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {
namespace {

constexpr int kMagnitude = WantedComponent<float>::kMagnitude;

const std::vector<VtkArray>& dataOf(const VtkPiece& piece, Centring centring) {
  return centring == Centring::kNode ? piece.point_data : piece.cell_data;
}

}  // namespace

void VtkFields::describe(const std::vector<VtkPiece>& pieces, std::span<const size_t> blocks,
                         GridDescription& description) {
  addFields(pieces, blocks, Centring::kNode);
  addFields(pieces, blocks, Centring::kCell);
  std::set<std::string> names;
  for (const GridScalar& scalar : description.scalars) names.insert(scalar.name);
  for (size_t n = 0; n < fields_.size(); ++n) addScalars(pieces, n, names, description);
  for (const Field& field : fields_) {
    const auto without = std::count_if(blocks.begin(), blocks.end(),
                                       [&](size_t piece) { return field.array_of_piece[piece] < 0; });
    if (without > 0)
      description.warnings.push_back(
          fmt::format("{} of {} blocks have no array {}; they are not drawn with it", without, blocks.size(),
                      field.name));
  }
}

const VtkArray* VtkFields::arrayOf(const Field& field, const std::vector<VtkPiece>& pieces, size_t piece) {
  const int32_t position = field.array_of_piece[piece];
  return position < 0 ? nullptr : &dataOf(pieces[piece], field.centring)[static_cast<size_t>(position)];
}

void VtkFields::addFields(const std::vector<VtkPiece>& pieces, std::span<const size_t> blocks,
                          Centring centring) {
  const size_t before = fields_.size();
  std::map<std::pair<std::string, uint32_t>, size_t> known;
  std::string active;
  for (const size_t block : blocks) {
    const VtkPiece& piece = pieces[block];
    const std::vector<VtkArray>& data = dataOf(piece, centring);
    for (size_t n = 0; n < data.size(); ++n) {
      const VtkArray& array = data[n];
      const auto [field, is_new] = known.try_emplace({array.name, array.components}, fields_.size());
      if (is_new)
        fields_.push_back({array.name, centring, array.components, std::vector<int32_t>(pieces.size(), -1)});
      fields_[field->second].array_of_piece[block] = static_cast<int32_t>(n);
    }
    if (active.empty())
      active = centring == Centring::kNode ? piece.active_point_data : piece.active_cell_data;
  }
  std::stable_partition(fields_.begin() + static_cast<ptrdiff_t>(before), fields_.end(),
                        [&](const Field& field) { return field.name == active; });
}

/// `names`: of all scalars; those of the field are added.
void VtkFields::addScalars(const std::vector<VtkPiece>& pieces, size_t number, std::set<std::string>& names,
                           GridDescription& description) {
  const Field& field = fields_[number];
  std::vector<std::string> component_names;
  for (size_t piece = 0; piece < pieces.size() && component_names.empty(); ++piece)
    if (field.array_of_piece[piece] >= 0)
      component_names =
          dataOf(pieces[piece], field.centring)[static_cast<size_t>(field.array_of_piece[piece])]
              .component_names;
  const auto add = [&](const std::string& suffix, int component, std::vector<std::string> aliases) {
    GridScalar scalar;
    scalar.name = field.name + suffix;
    scalar.centring = field.centring;
    if (names.count(scalar.name)) {
      if (field.centring == Centring::kCell) scalar.name = field.name + ":cell" + suffix;
      if (names.count(scalar.name)) scalar.name += fmt::format(":{}", number);
    }
    names.insert(scalar.name);
    scalar.aliases = std::move(aliases);
    description.scalars.push_back(std::move(scalar));
    scalars_.push_back({number, component});
  };
  const auto aliasesOf = [&](uint32_t component, bool has_letter) {
    std::vector<std::string> aliases;
    const std::string begin = simplifiedName(field.name) + ":";
    if (has_letter) aliases.push_back(begin + std::to_string(component));
    if (component < component_names.size() && !component_names[component].empty())
      aliases.push_back(begin + simplifiedName(component_names[component]));
    return aliases;
  };
  if (field.components == 1) return add("", 0, {});
  const bool vector = field.components <= 3;
  if (vector) add(":mag", kMagnitude, {simplifiedName(field.name)});
  for (uint32_t c = 0; c < field.components; ++c)
    add(vector ? fmt::format(":{}", "xyz"[c]) : fmt::format(":{}", c), static_cast<int>(c),
        aliasesOf(c, vector));
}

}  // namespace curvisplat
