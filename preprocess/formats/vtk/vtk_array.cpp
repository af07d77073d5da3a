#include "preprocess/formats/vtk/vtk_array.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "preprocess/formats/common/ascii_spool.h"
#include "preprocess/formats/common/stored_values.h"
#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;
static_assert(kBufferBytes >= kMaxComponents * sizeof(double));

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
  if (wanted.component != WantedComponent<Value>::kMagnitude) {
    from += static_cast<size_t>(wanted.component) * sizeof(Stored);
    for (size_t n = 0; n < count; ++n)
      to[n] = static_cast<Value>(loadStored<Stored>(from + n * stride, swap));
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
  thread_local std::vector<std::byte> buffer(kBufferBytes);
  const uint64_t tuple_bytes = array.tupleBytes();
  const bool swap = array.order != kMachineByteOrder;
  for (uint64_t done = 0; done < count;) {
    const auto tuples = static_cast<size_t>(std::min<uint64_t>(count - done, kBufferBytes / tuple_bytes));
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
    piece.reserve(kBufferBytes / sizeof(Stored));
    for (uint64_t n = 0; n < count; ++n) {
      const std::string_view word = text.word();
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
      piece.push_back(static_cast<Stored>(value));
      if (piece.size() < piece.capacity() && n + 1 < count) continue;
      sink(std::as_bytes(std::span(piece)));
      piece.clear();
    }
  });
}

}  // namespace curvisplat
