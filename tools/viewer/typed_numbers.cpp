#include "tools/viewer/typed_numbers.h"

#include <imgui.h>

#include <algorithm>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {

std::optional<std::array<double, TypedNumbers::kMax>> TypedNumbers::draw(const char* label,
                                                                         std::span<const double> values,
                                                                         const char* format) {
  CURVISPLAT_CHECK_OP(values.size(), <=, kMax);
  const ImGuiID id = ImGui::GetID(label);
  std::array<double, kMax> numbers = typed_;
  if (field_ != id) std::ranges::copy(values, numbers.begin());
  if (ImGui::InputScalarN(label, ImGuiDataType_Double, numbers.data(), static_cast<int>(values.size()),
                          nullptr, nullptr, format, ImGuiInputTextFlags_CharsScientific)) {
    field_ = id;
    typed_ = numbers;
  }
  if (field_ != id) return std::nullopt;
  if (ImGui::IsItemActive()) return std::nullopt;
  // Tab leaves one field in a frame, and enters the next in another.
  if (!std::exchange(tabs_, false) && ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Tab), false)) {
    tabs_ = true;
    return std::nullopt;
  }
  field_ = 0;
  if (std::ranges::equal(values, std::span(typed_).first(values.size()))) return std::nullopt;
  return typed_;
}

}  // namespace curvisplat
