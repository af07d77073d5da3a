#include "preprocess/grid/scalar_names.h"

#include <algorithm>

namespace curvisplat {

std::string simplifiedName(const std::string& name) {
  std::string simple;
  for (const char c : name) {
    if (c == ' ' || c == '_' || c == '-') continue;
    simple += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return simple;
}

bool answersTo(const GridScalar& scalar, const std::string& simple) {
  return simplifiedName(scalar.name) == simple ||
         std::find(scalar.aliases.begin(), scalar.aliases.end(), simple) != scalar.aliases.end();
}

}  // namespace curvisplat
