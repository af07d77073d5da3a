// What a Tecplot file contains: variables, and zones with the position of each variable's values. The result of both
// readers, of text (tecplot_text.h) and of binary files (tecplot_binary.h), and the input of TecplotSource.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// As binary files number them.
enum class TecplotType : uint8_t { kFloat = 1, kDouble, kInt32, kInt16, kByte };

size_t bytesOf(TecplotType type);

/// The values of one variable in one zone.
struct TecplotValues {
  Centring centring = Centring::kNode;
  bool passive = false;  // the zone has no values of it
  TecplotType type = TecplotType::kFloat;
  bool swap = false;
  bool from_single = false;  // of a text: the numbers have single precision, whatever the type
  std::shared_ptr<const ByteSource> bytes;
  uint64_t begin = 0, stride = 0;  // bytes: of the first value, and from one to the next
  uint64_t row_pitch = 0,
           columns = 0;  // values: from one row of i to the next, and rows from one plane to the next
};

/// Reads the values [first, first + to.size()), in the order of the file. Any number of threads. Needs a buffer of
/// 256 KiB per thread. Throws Error as the bytes do.
template <typename Value>
void readTecplotValues(const TecplotValues& values, uint64_t first, std::span<Value> to);

extern template void readTecplotValues(const TecplotValues&, uint64_t, std::span<float>);
extern template void readTecplotValues(const TecplotValues&, uint64_t, std::span<double>);

struct TecplotZone {
  std::string name;
  std::array<uint64_t, 3> nodes{1, 1, 1};
  std::optional<double> time;         // of a zone that belongs to a series; nullopt: it belongs to every step
  std::vector<TecplotValues> values;  // [variable]

  uint64_t nodeCount() const { return nodes[0] * nodes[1] * nodes[2]; }
  bool flat() const { return nodes[0] < 2 || nodes[1] < 2 || nodes[2] < 2; }
  /// "zone 2 (wing)", for messages; `number` from 0.
  std::string describe(size_t number) const;
};

struct TecplotData {
  std::string encoding;  // "ASCII", "binary, version 112, little-endian"
  std::vector<std::string> variables;
  std::vector<TecplotZone> zones;
};

/// Lets zone `to` use the values that zone `from` has of a variable. Throws Error unless `from` precedes it and has its
/// dimensions. `file`: for messages.
void shareTecplotValues(const std::string& file, TecplotData& data, size_t from, size_t to, size_t variable);

/// Throws Error if there are more variables than 65,536, or more than four million in all zones together: each has a
/// place in memory, whatever a damaged file says.
void checkTecplotCounts(const std::string& file, size_t zones, uint64_t variables);

/// Throws Error if the zone's dimensions are not positive, or if it has more than `most` nodes.
void checkTecplotZone(const std::string& file, const TecplotZone& zone, size_t number, uint64_t most);

/// Refuses a zone of finite elements by its name.
[[noreturn]] void refuseTecplotZone(const std::string& file, const TecplotZone& zone, size_t number,
                                    const std::string& type);

}  // namespace curvisplat
