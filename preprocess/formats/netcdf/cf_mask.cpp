#include "preprocess/formats/netcdf/cf_mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <sstream>
#include <string_view>
#include <utility>

#include "preprocess/formats/netcdf/cf_roles.h"
#include "stream/base/words.h"

namespace curvisplat {
namespace {

bool isOneOf(std::string_view text, std::initializer_list<std::string_view> words) {
  return std::find(words.begin(), words.end(), text) != words.end();
}

bool isWaterMask(const std::string& name, const std::string& standard_name) {
  return standard_name == "sea_binary_mask" || name.starts_with("mask_") || name.starts_with("hfac") ||
         isOneOf(name, {"tmask", "umask", "vmask", "wmask", "fmask", "tmaskutil", "umaskutil", "vmaskutil",
                        "maskc", "maskw", "masks", "wet", "wet_c", "wet_t", "wet_u", "wet_v"});
}

/// The flag values whose meanings say that there is nothing. `ocean`: as CfMask::of().
std::vector<double> hiddenFlags(const NetcdfVariable& variable, bool ocean) {
  const auto values = variable.attributes.find("flag_values");
  if (values == variable.attributes.end()) return {};
  std::vector<double> hidden;
  std::istringstream meanings(lowerCase(variable.text("flag_meanings")));
  std::string meaning;
  for (size_t n = 0; n < values->second.numbers.size() && meanings >> meaning; ++n) {
    const bool nothing = isOneOf(meaning, {"hole", "blank", "blanked", "solid", "masked", "outside",
                                           "missing", "no_data", "nodata", "invalid"});
    if (nothing || (ocean && isOneOf(meaning, {"land", "dry", "dry_land", "ground"})))
      hidden.push_back(values->second.numbers[n]);
  }
  return hidden;
}

/// A file of NEMO's masks has those of all points on the same dimensions. The point (t, u, v or w) is in the
/// name of the levels: deptht, depthu.
char nemoPoint(const NetcdfFiles& files, const CfDimensions& block, size_t levels) {
  const std::string& name = files.dimensions()[block.axes[levels]].name;
  return name.size() == 6 && name.starts_with("depth") && isOneOf(name.substr(5), {"t", "u", "v", "w"})
             ? name[5]
             : 't';
}

bool ofAnotherPoint(const std::string& name, char point) {
  if (name.size() < 5 || name.substr(1, 4) != "mask" ||
      !isOneOf(name.substr(0, 1), {"t", "u", "v", "w", "f"}))
    return false;
  return name[0] != point && !(name[0] == 't' && point == 'w');
}

}  // namespace

std::optional<CfMask::Rule> CfMask::ruleOf(const NetcdfVariable& variable, bool ocean) {
  const std::string name = lowerCase(variable.name),
                    standard_name = lowerCase(variable.text("standard_name"));
  if (!variable.numeric) return std::nullopt;
  if (!hiddenFlags(variable, ocean).empty()) return Rule::kFlags;
  if (isWaterMask(name, standard_name)) return ocean ? std::optional(Rule::kZero) : std::nullopt;
  if (standard_name == "land_binary_mask" || isOneOf(name, {"landmask", "land_mask"}))
    return ocean ? std::optional(Rule::kNotZero) : std::nullopt;
  if (isOneOf(name, {"kmt", "kmu"})) return Rule::kLevels;
  return std::nullopt;
}

bool CfMask::isMask(const NetcdfVariable& variable) {
  return ruleOf(variable, true).has_value();
}

std::optional<CfMask> CfMask::of(const NetcdfFiles& files, const NetcdfVariable& variable,
                                 const CfDimensions& block, size_t levels, bool ocean) {
  const char point = nemoPoint(files, block, levels);
  std::optional<CfMask> best;
  int best_rank = 0;
  for (const NetcdfVariable& candidate : files.variables()) {
    if (candidate.name == variable.name || ofAnotherPoint(lowerCase(candidate.name), point)) continue;
    const auto rule = ruleOf(candidate, ocean);
    if (!rule) continue;
    const auto term = CfTerm::of(files, candidate, block);
    if (!term || !term->onNodes() || term->axes() < 2) continue;
    if (rule == Rule::kLevels && term->varies(levels)) continue;
    // Its own dimensions before dimensions of their lengths; masks of all levels before those of the surface.
    const int rank = 1 + (term->exact() ? 2 : 0) + (term->axes() == 3 ? 1 : 0);
    if (rank <= best_rank) continue;
    best_rank = rank;
    CfMask mask;
    mask.term_ = *term;
    mask.rule_ = *rule;
    mask.levels_ = levels;
    mask.hidden_ = hiddenFlags(candidate, ocean);
    const std::string words = rule == Rule::kZero      ? "is 0"
                              : rule == Rule::kNotZero ? "is not 0"
                              : rule == Rule::kLevels
                                  ? "counts fewer levels"
                                  : fmt::format("is {:g}", fmt::join(mask.hidden_, " or "));
    mask.description_ = fmt::format("{} {}", candidate.name, words);
    best = std::move(mask);
  }
  return best;
}

bool CfMask::hides(double value, uint64_t level) const {
  switch (rule_) {
    case Rule::kZero:
      return value == 0 || std::isnan(value);
    case Rule::kNotZero:
      return value != 0;
    case Rule::kLevels:
      return !(value > static_cast<double>(level));
    case Rule::kFlags:
      return std::isnan(value) || std::find(hidden_.begin(), hidden_.end(), value) != hidden_.end();
  }
  return false;
}

void CfMask::apply(const NetcdfFiles& files, const CfRange& range, std::span<uint8_t> blank) const {
  const CfValues values = term_.read(files, range);
  size_t n = 0;
  for (uint64_t k = 0; k < range.end[2] - range.begin[2]; ++k)
    for (uint64_t j = 0; j < range.end[1] - range.begin[1]; ++j)
      for (uint64_t i = 0; i < range.end[0] - range.begin[0]; ++i, ++n) {
        const std::array<uint64_t, 3> at{i, j, k};
        blank[n] |= hides(values.at(i, j, k), range.begin[levels_] + at[levels_]);
      }
}

}  // namespace curvisplat
