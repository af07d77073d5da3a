#include "preprocess/formats/vtk/vtk_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {
namespace {

const std::vector<VtkArray>& dataOf(const VtkPiece& piece, Centring centring) {
  return centring == Centring::kNode ? piece.point_data : piece.cell_data;
}

}  // namespace

void VtkFields::describe(const std::vector<VtkPiece>& pieces, std::span<const size_t> blocks,
                         GridDescription& description) {
  addFields(pieces, blocks, Centring::kNode);
  addFields(pieces, blocks, Centring::kCell);
  ScalarList scalars(description);
  for (size_t n = 0; n < fields_.size(); ++n) addScalars(pieces, n, scalars);
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

void VtkFields::addScalars(const std::vector<VtkPiece>& pieces, size_t number, ScalarList& scalars) {
  const Field& field = fields_[number];
  std::vector<std::string> component_names;
  for (size_t piece = 0; piece < pieces.size() && component_names.empty(); ++piece)
    if (field.array_of_piece[piece] >= 0)
      component_names =
          dataOf(pieces[piece], field.centring)[static_cast<size_t>(field.array_of_piece[piece])]
              .component_names;
  const auto aliasesOf = [&](int component) -> std::vector<std::string> {
    const std::string name = simplifiedName(field.name);
    if (component == kMagnitude) return {name};
    std::vector<std::string> aliases;
    if (field.components == 1) return aliases;
    if (field.components <= 3) aliases.push_back(fmt::format("{}:{}", name, component));
    const auto c = static_cast<size_t>(component);
    if (c < component_names.size() && !component_names[c].empty())
      aliases.push_back(name + ":" + simplifiedName(component_names[c]));
    return aliases;
  };
  forEachComponent(field.components, [&](const std::string& suffix, int component) {
    const auto names = namesOfComponent(field.name, suffix, field.centring, number);
    scalars.add(names, field.centring).aliases = aliasesOf(component);
    scalars_.push_back({number, component});
  });
}

}  // namespace curvisplat
