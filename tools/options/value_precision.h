// The value of --value-precision.
#pragma once

#include <string_view>

#include "stream/codec/values_codec.h"
#include "tools/options/choices.h"

namespace curvisplat {

/// "normal" or "fine"; throws UsageError that names `option` otherwise.
inline ValuePrecision parseValuePrecision(std::string_view option, std::string_view text) {
  requireChoice(option, text, {"normal", "fine"});
  return text == "fine" ? ValuePrecision::kFine : ValuePrecision::kNormal;
}

}  // namespace curvisplat
