// An array of a VTK file: tuples of numbers, of any type and encoding.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/byte_order.h"
#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"

namespace curvisplat {

enum class VtkType : uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64
};

size_t bytesOf(VtkType type);

struct VtkArray {
  std::string name;
  VtkType type = VtkType::kFloat32;
  uint32_t components = 1;
  uint64_t tuples = 0;
  ByteOrder order = ByteOrder::kLittle;
  std::shared_ptr<const ByteSource> bytes;
  std::vector<std::string> component_names;  // empty, or one for each component

  uint64_t tupleBytes() const { return components * bytesOf(type); }
};

/// Limit that keeps a tuple within the buffer of a reading thread.
inline constexpr uint32_t kMaxComponents = 4096;

/// A component, or the magnitude, of an array's tuples, and its destination.
template <typename Value>
struct WantedComponent {
  static constexpr int kMagnitude = -1;
  int component = 0;  // or kMagnitude: the Euclidean norm of the tuple
  Value* to = nullptr;
};

/// Reads tuples [first, first + count), each wanted component to its to[0 .. count). Value: double or float.
/// Throws Error as the array's bytes do. Needs a buffer of 256 KiB per thread.
template <typename Value>
void readTuples(const VtkArray& array, uint64_t first, uint64_t count,
                std::span<const WantedComponent<Value>> wanted);

extern template void readTuples(const VtkArray&, uint64_t, uint64_t,
                                std::span<const WantedComponent<double>>);
extern template void readTuples(const VtkArray&, uint64_t, uint64_t, std::span<const WantedComponent<float>>);

/// Parses the `count` numbers of the array `name` and passes them to `sink` as `type` in the machine's byte order. Throws
/// Error if there are fewer, or if one is not a number of that type.
void packNumbers(TextReader& text, const std::string& name, uint64_t count, VtkType type,
                 const SpoolFile::Sink& sink);

}  // namespace curvisplat
