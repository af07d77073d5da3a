#include "preprocess/grid/node_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Nodes are tested in pieces; only a piece with something to blank is processed node by node.
constexpr size_t kPiece = 4096;

/// x * 0 is 0 if x is finite, else NaN, so one sum tests a whole piece. The sum is split into lanes, since
/// the compiler must not reorder floating-point additions.
template <typename Value>
bool allFinite(std::span<const Value> values) {
  constexpr size_t kLanes = 32 / sizeof(Value);
  std::array<Value, kLanes> sums{};
  size_t n = 0;
  for (; n + kLanes <= values.size(); n += kLanes)
    for (size_t lane = 0; lane < kLanes; ++lane) sums[lane] += values[n + lane] * Value{0};
  for (; n < values.size(); ++n) sums[0] += values[n] * Value{0};
  return std::all_of(sums.begin(), sums.end(), [](Value sum) { return sum == 0; });
}

bool holds(std::span<const float> values, float wanted) {
  unsigned found = 0;
  for (const float value : values) found |= value == wanted;
  return found != 0;
}

template <typename Value>
void markNotFinite(std::span<const Value> values, std::span<uint8_t> mark) {
  for (size_t n = 0; n < values.size(); ++n) mark[n] |= !std::isfinite(values[n]);
}

/// Marks nodes, from number `first` on, at which no scalar is finite.
void markWithoutAny(const std::vector<std::vector<float>>& scalars, size_t first, std::span<uint8_t> mark) {
  for (size_t n = 0; n < mark.size() && !scalars.empty(); ++n)
    mark[n] = std::none_of(scalars.begin(), scalars.end(), [&](const std::vector<float>& values) {
      return std::isfinite(values[first + n]);
    });
}

/// Blanks the nodes that are marked and not yet blanked. Returns their number.
uint64_t blankMarked(std::span<const uint8_t> mark, std::span<uint8_t> blank) {
  uint64_t blanked = 0;
  for (size_t n = 0; n < mark.size(); ++n) {
    blanked += mark[n] & (blank[n] ^ 1);
    blank[n] |= mark[n];
  }
  return blanked;
}

Centring centringOf(const GridDescription& description, const std::vector<uint32_t>& scalars) {
  if (scalars.empty()) return Centring::kNode;
  const GridScalar& first = description.scalars.at(scalars.front());
  for (const uint32_t scalar : scalars) {
    const GridScalar& other = description.scalars.at(scalar);
    if (other.centring == first.centring) continue;
    const bool cells = first.centring == Centring::kCell;
    throw Error(
        "{} is node-centred, but {} is cell-centred; a cache holds one kind: convert them to two caches",
        cells ? other.name : first.name, cells ? first.name : other.name);
  }
  return first.centring;
}

void markCellsWithoutAny(NodeArrays& out) {
  for (size_t n = 0; n < out.x.size(); ++n) {
    const auto all = [&](auto is) {
      return std::all_of(out.scalars.begin(), out.scalars.end(),
                         [&](const auto& values) { return is(values[n]); });
    };
    if (all([](float value) { return std::isnan(value); }))
      out.blank[n] |= kNoValue;
    else if (all([](float value) { return !std::isfinite(value); }))
      out.blank[n] |= kValueNotFinite;
  }
}

void markCells(std::optional<double> blank_value, bool of_any_value, NodeArrays& out) {
  for (size_t n = 0; n < out.x.size(); ++n) {
    const bool finite = std::isfinite(out.x[n]) && std::isfinite(out.y[n]) && std::isfinite(out.z[n]);
    out.blank[n] = out.blank[n] != 0 || !finite ? kNoNode : 0;
  }
  if (of_any_value) return markCellsWithoutAny(out);
  const float wanted = static_cast<float>(blank_value.value_or(0));
  for (const std::vector<float>& scalar : out.scalars)
    for (size_t n = 0; n < scalar.size(); ++n) {
      if (std::isnan(scalar[n]))
        out.blank[n] |= kNoValue;
      else if (blank_value && scalar[n] == wanted)
        out.blank[n] |= kBlankValue;
      else if (std::isinf(scalar[n]))
        out.blank[n] |= kValueNotFinite;
    }
}

}  // namespace

std::string notFiniteText(const GridDescription& description) {
  const std::string undefined =
      description.undefined.empty() ? "" : fmt::format(", or undefined: {}", description.undefined);
  return fmt::format(
      "not finite in single precision (NaN, infinite, or a value beyond 3.4e+38 in magnitude{})", undefined);
}

BlankCounts& BlankCounts::operator+=(const BlankCounts& other) {
  by_grid += other.by_grid;
  by_value += other.by_value;
  not_finite += other.not_finite;
  if (lost.size() < other.lost.size()) lost.resize(other.lost.size());
  for (size_t n = 0; n < other.lost.size(); ++n) {
    lost[n].samples += other.lost[n].samples;
    lost[n].set += other.lost[n].set;
  }
  return *this;
}

uint64_t idOfPosition(double x, double y, double z) {
  uint64_t id = 0;
  for (const double number : {x, y, z}) id = (id ^ std::bit_cast<uint64_t>(number)) * 0x9e3779b97f4a7c15;
  return id ^ id >> 32;
}

void BlankCounts::addLost(const std::vector<std::vector<float>>& scalars, size_t sample, uint64_t id,
                          std::optional<double> blank_value) {
  const auto has = [&](const std::vector<float>& values) {
    return std::isfinite(values[sample]) &&
           !(blank_value && values[sample] == static_cast<float>(*blank_value));
  };
  if (std::all_of(scalars.begin(), scalars.end(), has) || std::none_of(scalars.begin(), scalars.end(), has))
    return;
  lost.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    if (!has(scalars[n])) continue;
    ++lost[n].samples;
    lost[n].set += (id + 1) * 0xd6e8feb86659fd93;
  }
}

NodeReader::NodeReader(const GridSource& source, std::vector<uint32_t> scalars,
                       std::optional<double> blank_value)
    : source_(&source),
      scalars_(std::move(scalars)),
      blank_value_(blank_value),
      centring_(centringOf(source.description(), scalars_)) {}

BlankCounts NodeReader::read(uint32_t block, const NodeBox& box, NodeArrays& out) const {
  readBox(*source_, block, box, scalars_, out);
  if (of_any_value_ && blank_value_)
    for (std::vector<float>& scalar : out.scalars)
      std::replace(scalar.begin(), scalar.end(), static_cast<float>(*blank_value_),
                   std::numeric_limits<float>::quiet_NaN());
  BlankCounts counts;
  if (centring_ == Centring::kCell) {
    markCells(blank_value_, of_any_value_, out);
    return counts;
  }
  std::array<uint8_t, kPiece> mark_buffer;
  for (size_t first = 0; first < out.x.size(); first += kPiece) {
    const size_t count = std::min(kPiece, out.x.size() - first);
    const std::span<uint8_t> blank(&out.blank[first], count);
    const std::span<uint8_t> mark = std::span(mark_buffer).first(count);
    counts.by_grid += std::accumulate(blank.begin(), blank.end(), uint64_t{0});
    const auto add_lost = [&] {  // of the nodes that are marked and not yet blanked
      for (size_t n = 0; n < count && out.scalars.size() > 1; ++n)
        if (mark[n] && !blank[n])
          counts.addLost(out.scalars, first + n,
                         idOfPosition(out.x[first + n], out.y[first + n], out.z[first + n]), blank_value_);
    };

    if (blank_value_ && !of_any_value_) {
      const auto wanted = static_cast<float>(*blank_value_);
      for (const std::vector<float>& scalar : out.scalars) {
        const std::span<const float> values(&scalar[first], count);
        if (!holds(values, wanted)) continue;
        for (size_t n = 0; n < count; ++n) mark[n] = values[n] == wanted;
        add_lost();
        counts.by_value += blankMarked(mark, blank);
      }
    }

    bool finite = true;
    for (const auto* axis : {&out.x, &out.y, &out.z})
      finite &= allFinite(std::span<const double>(&(*axis)[first], count));
    for (const std::vector<float>& scalar : out.scalars)
      finite &= allFinite(std::span<const float>(&scalar[first], count));
    if (finite) continue;
    std::fill(mark.begin(), mark.end(), uint8_t{0});
    for (const auto* axis : {&out.x, &out.y, &out.z})
      markNotFinite(std::span<const double>(&(*axis)[first], count), mark);
    counts.not_finite += blankMarked(mark, blank);
    std::fill(mark.begin(), mark.end(), uint8_t{0});
    if (of_any_value_)
      markWithoutAny(out.scalars, first, mark);
    else
      for (const std::vector<float>& scalar : out.scalars)
        markNotFinite(std::span<const float>(&scalar[first], count), mark);
    add_lost();
    counts.not_finite += blankMarked(mark, blank);
  }
  return counts;
}

}  // namespace curvisplat
