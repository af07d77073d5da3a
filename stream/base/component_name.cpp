#include "stream/base/component_name.h"

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "stream/base/text.h"

namespace curvisplat {

std::string_view vectorOf(std::string_view name) {
  const auto isIn = [](char c, std::string_view set) { return set.find(c) != std::string_view::npos; };
  if (const size_t colon = name.rfind(':'); colon != std::string_view::npos) {
    const std::string_view part = name.substr(colon + 1);
    const bool number =
        !part.empty() && std::all_of(part.begin(), part.end(), [&](char c) { return isIn(c, "0123456789"); });
    const bool axis = part.size() == 1 && isIn(part[0], "xyz");
    return number || axis || part == "mag" ? name.substr(0, colon) : std::string_view();
  }
  if (name.size() < 2 || !isIn(name.back(), "XYZ")) return {};
  const char before = name[name.size() - 2];
  return before >= 'a' && before <= 'z' ? name.substr(0, name.size() - 1) : std::string_view();
}

namespace {

/// The words of a name, which end where letters do, or where a capital follows a small letter; in small letters.
std::vector<std::string> wordsIn(std::string_view name) {
  const auto isSmall = [](char c) { return c >= 'a' && c <= 'z'; };
  const auto isCapital = [](char c) { return c >= 'A' && c <= 'Z'; };
  std::vector<std::string> words;
  char before = 0;
  for (const char c : name) {
    const bool is_letter = isSmall(c) || isCapital(c), follows = isSmall(before) || isCapital(before);
    if (is_letter && (!follows || (isSmall(before) && isCapital(c)))) words.emplace_back();
    if (is_letter) words.back() += lowerCase({&c, 1});
    before = c;
  }
  return words;
}

}  // namespace

ScalarKind kindOf(std::string_view name) {
  constexpr std::string_view kNumbers[] = {"id", "ids", "groups"};
  constexpr std::string_view kMaterials[] = {"mat",    "material", "materials",
                                             "region", "physical", "attribute"};
  constexpr std::string_view kPlaces[] = {"coord", "coords",     "coordinate", "coordinates",
                                          "lon",   "lat",        "longitude",  "latitude",
                                          "depth", "topography", "bathymetry", "elevation"};
  const std::string_view vector = vectorOf(name);
  const std::vector<std::string> words = wordsIn(vector.empty() ? name : vector);
  if (words.empty()) return ScalarKind::kField;
  const auto isIn = [](const std::string& word, std::span<const std::string_view> set) {
    return std::ranges::find(set, word) != set.end();
  };
  const bool is_number = isIn(words.back(), kNumbers);
  if (isIn(words.back(), kMaterials) || (is_number && isIn(words.front(), kMaterials)))
    return ScalarKind::kMaterial;
  if (is_number || name == "vtkCompositeIndex") return ScalarKind::kNumbering;
  const bool is_axis = name.size() == 1 && name >= "x" && name <= "z";          // "Z" is a mixture fraction
  const bool ends_so = isIn(words.back(), kPlaces) && words.back() != "depth";  // "optical_depth" is a field
  return is_axis || isIn(words.front(), kPlaces) || ends_so ? ScalarKind::kPlace : ScalarKind::kField;
}

}  // namespace curvisplat
