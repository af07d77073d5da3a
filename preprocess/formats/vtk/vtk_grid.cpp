#include "preprocess/formats/vtk/vtk_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <type_traits>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

/// A box in a regular partition has six neighbours; more parts than this are not a sane partition.
constexpr size_t kMaxPartsOfAPiece = 64;

bool shareCells(const VtkExtent& a, const VtkExtent& b) {
  for (size_t axis = 0; axis < 3; ++axis)
    if (std::max(a.lower[axis], b.lower[axis]) >= std::min(a.upper[axis], b.upper[axis])) return false;
  return true;
}

/// Appends to `left` the cells of `part` outside `other`, which overlaps it: up to six boxes. Cuts along k
/// first, since whole planes are read together.
void subtract(VtkExtent part, const VtkExtent& other, std::vector<VtkExtent>& left) {
  for (const size_t axis : {2, 1, 0}) {
    if (part.lower[axis] < other.lower[axis]) {
      left.push_back(part);
      left.back().upper[axis] = part.lower[axis] = other.lower[axis];
    }
    if (part.upper[axis] > other.upper[axis]) {
      left.push_back(part);
      left.back().lower[axis] = part.upper[axis] = other.upper[axis];
    }
  }
}

}  // namespace

uint64_t VtkExtent::cells() const {
  uint64_t cells = 1;
  for (size_t axis = 0; axis < 3; ++axis) cells *= std::max<uint64_t>(1, nodesAlong(axis) - 1);
  return cells;
}

bool VtkExtent::isFlat() const {
  return nodesAlong(0) < 2 || nodesAlong(1) < 2 || nodesAlong(2) < 2;
}

std::string VtkExtent::describe() const {
  return fmt::format("{}x{}x{}", nodesAlong(0), nodesAlong(1), nodesAlong(2));
}

std::optional<VtkExtent> extentWith(std::span<const double> ends) {
  // Sums and products of a few of them stay below 2^63.
  constexpr double kMaxIndex = 0x1p30, kMaxNodes = 1e14;
  VtkExtent extent;
  double nodes = 1;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double lower = ends[2 * axis], upper = ends[2 * axis + 1];
    if (!(std::abs(lower) < kMaxIndex && std::abs(upper) < kMaxIndex && lower <= upper) ||
        lower != std::trunc(lower) || upper != std::trunc(upper))
      return std::nullopt;
    extent.lower[axis] = static_cast<int64_t>(lower);
    extent.upper[axis] = static_cast<int64_t>(upper);
    nodes *= upper - lower + 1;
  }
  return nodes <= kMaxNodes ? std::optional(extent) : std::nullopt;
}

std::vector<std::vector<VtkExtent>> ownedParts(const std::vector<VtkExtent>& pieces) {
  std::vector<std::vector<VtkExtent>> owned;
  for (size_t n = 0; n < pieces.size(); ++n) {
    std::vector<VtkExtent> parts = {pieces[n]};
    for (size_t before = 0; before < n && !parts.empty(); ++before) {
      if (!shareCells(pieces[n], pieces[before])) continue;
      std::vector<VtkExtent> left;
      for (const VtkExtent& part : parts) {
        if (shareCells(part, pieces[before]))
          subtract(part, pieces[before], left);
        else
          left.push_back(part);
      }
      parts = std::move(left);
      if (parts.size() > kMaxPartsOfAPiece)
        throw Error(
            "piece {} of the grid overlaps the previous pieces in {} parts; expected pieces that abut or "
            "overlap by ghost levels",
            n + 1, parts.size());
    }
    owned.push_back(std::move(parts));
  }
  return owned;
}

namespace {

int64_t floorOf(int64_t a, int64_t b) {
  return a / b - (a % b != 0 && a < 0);
}

/// The cells of the coarser level that lie in `fine`; empty (lower > upper) along an axis if there are none.
VtkExtent coarsened(const VtkExtent& fine, const std::array<int64_t, 3>& ratio) {
  VtkExtent coarse;
  for (size_t axis = 0; axis < 3; ++axis) {
    coarse.lower[axis] = -floorOf(-fine.lower[axis], ratio[axis]);
    coarse.upper[axis] = floorOf(fine.upper[axis] + 1, ratio[axis]) - 1;
  }
  return coarse;
}

}  // namespace

std::array<int64_t, 3> refinementOf(const std::string& file, size_t level, std::span<const double> ratio) {
  std::array<int64_t, 3> whole{};
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!(ratio[axis] >= 1 && ratio[axis] < 1e6) || std::abs(ratio[axis] - std::round(ratio[axis])) > 1e-3)
      throw Error("{}: refines level {} by {}; expected a whole number", file, level, ratio[axis]);
    whole[axis] = static_cast<int64_t>(std::round(ratio[axis]));
  }
  return whole;
}

std::vector<std::vector<VtkExtent>> refinedCellsOf(const std::vector<AmrPatch>& patches,
                                                   const std::vector<std::array<int64_t, 3>>& ratios) {
  std::vector<std::vector<VtkExtent>> refined(patches.size());
  for (const AmrPatch& fine : patches) {
    if (fine.level == 0) continue;
    const VtkExtent covered = coarsened(fine.cells, ratios.at(fine.level - 1));
    for (size_t n = 0; n < patches.size(); ++n) {
      if (patches[n].level + 1 != fine.level) continue;
      const VtkExtent& cells = patches[n].cells;
      VtkExtent common;
      bool any = true;
      for (size_t axis = 0; axis < 3; ++axis) {
        common.lower[axis] = std::max(covered.lower[axis], cells.lower[axis]) - cells.lower[axis];
        common.upper[axis] = std::min(covered.upper[axis], cells.upper[axis]) - cells.lower[axis];
        any &= common.lower[axis] <= common.upper[axis];
      }
      if (any) refined[n].push_back(common);
    }
  }
  return refined;
}

namespace {

constexpr size_t kStoredBytesAtOnce = size_t{256} << 10;
static_assert(kStoredBytesAtOnce >= kMaxComponents * sizeof(double));

/// Calls use(Stored{}) with the C++ type that `type` stands for.
template <typename Use>
auto withType(VtkType type, const Use& use) {
  switch (type) {
    case VtkType::kInt8:
      return use(int8_t{});
    case VtkType::kUint8:
      return use(uint8_t{});
    case VtkType::kInt16:
      return use(int16_t{});
    case VtkType::kUint16:
      return use(uint16_t{});
    case VtkType::kInt32:
      return use(int32_t{});
    case VtkType::kUint32:
      return use(uint32_t{});
    case VtkType::kInt64:
      return use(int64_t{});
    case VtkType::kUint64:
      return use(uint64_t{});
    case VtkType::kFloat32:
      return use(float{});
    case VtkType::kFloat64:
      break;
  }
  return use(double{});
}

template <typename Stored, typename Value>
void convertTuples(const std::byte* from, size_t count, uint32_t components, bool swap,
                   const WantedComponent<Value>& wanted, Value* to) {
  const size_t stride = components * sizeof(Stored);
  if (wanted.component != kMagnitude) {
    from += static_cast<size_t>(wanted.component) * sizeof(Stored);
    for (size_t n = 0; n < count; ++n)
      to[n] = convertedTo<Value>(loadStored<Stored>(from + n * stride, swap));
    return;
  }
  for (size_t n = 0; n < count; ++n) {
    double squares = 0;
    for (size_t c = 0; c < components; ++c) {
      const auto value =
          static_cast<double>(loadStored<Stored>(from + n * stride + c * sizeof(Stored), swap));
      squares += value * value;
    }
    to[n] = static_cast<Value>(std::sqrt(squares));
  }
}

/// Whether `value` can be stored as an integer of that type.
template <typename Stored>
bool fits(double value) {
  if constexpr (std::is_floating_point_v<Stored>) {
    return true;
  } else {
    // The largest 64-bit integers are not representable as doubles, but the next power of two is.
    const double beyond = std::ldexp(1.0, std::numeric_limits<Stored>::digits);
    return value >= static_cast<double>(std::numeric_limits<Stored>::min()) && value < beyond &&
           value == std::trunc(value);
  }
}

}  // namespace

size_t bytesOf(VtkType type) {
  return withType(type, [](auto stored) { return sizeof stored; });
}

template <typename Value>
void readTuples(const VtkArray& array, uint64_t first, uint64_t count,
                std::span<const WantedComponent<Value>> wanted) {
  CURVISPLAT_CHECK(first <= array.tuples && count <= array.tuples - first);
  static const PerThread<std::vector<std::byte>> buffers;
  std::vector<std::byte>& buffer = buffers.own();
  buffer.resize(kStoredBytesAtOnce);
  const uint64_t tuple_bytes = array.tupleBytes();
  const bool swap = array.order != kMachineByteOrder;
  for (uint64_t done = 0; done < count;) {
    const auto tuples =
        static_cast<size_t>(std::min<uint64_t>(count - done, kStoredBytesAtOnce / tuple_bytes));
    const auto bytes = std::span(buffer).first(static_cast<size_t>(tuples * tuple_bytes));
    array.bytes->readAt((first + done) * tuple_bytes, bytes);
    for (const WantedComponent<Value>& component : wanted)
      withType(array.type, [&](auto stored) {
        convertTuples<decltype(stored)>(bytes.data(), tuples, array.components, swap, component,
                                        component.to + done);
      });
    done += tuples;
  }
}

template void readTuples(const VtkArray&, uint64_t, uint64_t, std::span<const WantedComponent<double>>);
template void readTuples(const VtkArray&, uint64_t, uint64_t, std::span<const WantedComponent<float>>);

void packNumbers(TextReader& text, const std::string& name, uint64_t count, VtkType type,
                 const SpoolFile::Sink& sink) {
  const auto place = [&] { return fmt::format("{}: byte {}", text.file().name(), text.offset()); };
  withType(type, [&](auto stored) {
    using Stored = decltype(stored);
    std::vector<Stored> piece;
    piece.reserve(kStoredBytesAtOnce / sizeof(Stored));
    const auto add = [&](Stored number) {
      piece.push_back(number);
      if (piece.size() < piece.capacity()) return;
      sink(std::as_bytes(std::span(piece)));
      piece.clear();
    };
    for (uint64_t n = 0; n < count; ++n) {
      const std::string_view word = text.word();
      if constexpr (std::is_integral_v<Stored>) {  // exact beyond 2^53
        Stored whole = 0;
        const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), whole);
        if (error == std::errc{} && stop == word.data() + word.size() && !word.empty()) {
          add(whole);
          continue;
        }
      }
      double value = 0;
      if (word.empty())
        throw Error(
            "{}: array {} has {} numbers; expected {}{}", place(), name, n, count,
            text.offset() >= text.file().size() ? "; the file is truncated, or the count is wrong" : "");
      if (!parseNumber(word, value))
        throw Error("{}: array {} has {} numbers, then \"{}\"; expected a number", place(), name, n,
                    printable(word.substr(0, 30)));
      if (!fits<Stored>(value))
        throw Error("{}: array {}: {} is not an integer of {} bits", place(), name, value,
                    8 * sizeof(Stored));
      add(static_cast<Stored>(value));
    }
    if (!piece.empty()) sink(std::as_bytes(std::span(piece)));
  });
}

}  // namespace curvisplat
