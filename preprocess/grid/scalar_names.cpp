#include "preprocess/grid/scalar_names.h"

#include <algorithm>

#include "stream/base/words.h"

namespace curvisplat {

std::string simplifiedName(const std::string& name) {
  std::string simple = lowerCase(name);
  std::erase_if(simple, [](char c) { return c == ' ' || c == '_' || c == '-'; });
  return simple;
}

bool answersTo(const GridScalar& scalar, const std::string& simple) {
  return simplifiedName(scalar.name) == simple ||
         std::find(scalar.aliases.begin(), scalar.aliases.end(), simple) != scalar.aliases.end();
}

}  // namespace curvisplat
