#include "preprocess/grid/grid_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "stream/base/calendar.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Copies the part of a row, i0 and on, to the place of row number `row` of parts.
template <typename Value>
void copyPart(const std::vector<Value>& from, const NodeBox& box, uint64_t nodes, uint64_t row,
              std::vector<Value>& to) {
  std::copy_n(from.begin() + static_cast<ptrdiff_t>(box.i0), nodes,
              to.begin() + static_cast<ptrdiff_t>(row * nodes));
}

}  // namespace

void GridSource::readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                                NodeArrays& out) const {
  const uint64_t nodes = box.rowNodes(description().blocks.at(block).ni);
  const size_t all = nodes * (box.j1 - box.j0) * (box.k1 - box.k0);
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(all);
  out.blank.resize(all);
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(all);
  NodeArrays whole;
  uint64_t row = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j, ++row) {
      read(block, {j, j + 1, k, k + 1}, scalars, whole);
      copyPart(whole.x, box, nodes, row, out.x);
      copyPart(whole.y, box, nodes, row, out.y);
      copyPart(whole.z, box, nodes, row, out.z);
      copyPart(whole.blank, box, nodes, row, out.blank);
      for (size_t n = 0; n < scalars.size(); ++n) copyPart(whole.scalars[n], box, nodes, row, out.scalars[n]);
    }
}

bool GridSource::readFringePart(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  const uint64_t nodes = box.rowNodes(description().blocks.at(block).ni);
  out.resize(nodes * (box.j1 - box.j0) * (box.k1 - box.k0));
  std::vector<uint8_t> whole;
  uint64_t row = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j, ++row) {
      if (!readFringe(block, {j, j + 1, k, k + 1}, whole)) return false;
      copyPart(whole, box, nodes, row, out);
    }
  return true;
}

std::string simplifiedName(const std::string& name) {
  std::string simple = lowerCase(name);
  std::erase_if(simple, [](char c) { return c == ' ' || c == '_' || c == '-'; });
  return simple;
}

bool answersTo(const GridScalar& scalar, const std::string& simple) {
  return simplifiedName(scalar.name) == simple ||
         std::find(scalar.aliases.begin(), scalar.aliases.end(), simple) != scalar.aliases.end();
}

uint32_t chosenTimeStep(const std::string& file, std::span<const double> times,
                        std::optional<uint32_t> asked) {
  const size_t steps = std::max<size_t>(1, times.size());
  if (asked && *asked >= steps)
    throw Error("{}: has {}; --time-step {} is out of range; {}", file,
                steps == 1 ? "one time step" : fmt::format("{} time steps", steps), *asked,
                steps == 1 ? "leave it out" : fmt::format("expected 0 to {}", steps - 1));
  return asked.value_or(0);
}

std::optional<std::string> timesText(const GridDescription& description) {
  const std::vector<double>& times = description.times;
  if (times.size() < 2) return std::nullopt;
  constexpr int kMaxDigits = 17;
  int digits = 6;
  const bool differ = times[0] < times[1] || times[0] > times[1];  // not NaN
  while (differ && digits < kMaxDigits && numberText(times[0], digits) == numberText(times[1], digits))
    ++digits;
  if (digits > 6) digits = std::min(digits + 2, kMaxDigits);  // where they tell the first steps apart
  const TimeUnit unit{description.time_unit, description.calendar};
  const auto first = dateOf(times.front(), unit), last = dateOf(times.back(), unit);
  return fmt::format("{} time steps from {} to {}{}", times.size(), numberText(times.front(), digits),
                     numberText(times.back(), digits),
                     first && last && *first != *last ? fmt::format(" ({} to {})", *first, *last) : "");
}

std::optional<std::string> timeStepNote(const GridDescription& description, std::optional<uint32_t> asked) {
  const auto text = timesText(description);
  if (asked || !text) return std::nullopt;
  return fmt::format("{}; using the first: choose with --time-step 0..{}", *text,
                     description.times.size() - 1);
}

std::optional<double> statedTime(const GridDescription& description) {
  if (!description.times.empty()) return description.times[description.time_step];
  if (!description.flow.empty() && description.flow.front().time != 0) return description.flow.front().time;
  return std::nullopt;
}

}  // namespace curvisplat
