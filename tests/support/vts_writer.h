// Writes small structured grids as VTK XML files in every encoding there is: what the reader must find again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace curvisplat {

struct VtsEncoding {
  enum class Format { kAscii, kInlineBase64, kAppendedRaw, kAppendedBase64 };
  enum class Compressor { kNone, kZlib, kLz4, kLzma };

  Format format = Format::kAppendedRaw;
  Compressor compressor = Compressor::kNone;
  size_t header_bytes = 4;  // or 8
  bool big_endian = false;
  size_t block_bytes = 1 << 15;  // of compressed blocks

  std::string describe() const;
};

struct VtsArray {
  std::string name;
  std::string type = "Float32";  // VTK's word
  uint32_t components = 1;
  std::vector<double> values;  // component fastest
};

struct VtsGrid {
  std::array<int64_t, 6> extent{};
  VtsArray points{"Points", "Float32", 3, {}};
  std::vector<VtsArray> point_data, cell_data;
};

/// The whole file. With `data_begins`, tells where the bytes of the arrays begin in it (appended formats).
std::string vtsFile(const VtsGrid& grid, const VtsEncoding& encoding, size_t* data_begins = nullptr);

/// Values as numbers of that type in that byte order.
std::string packedNumbers(const std::vector<double>& values, const std::string& type, bool big_endian);

/// All formats with all compressors, header integers and byte orders.
std::vector<VtsEncoding> allVtsEncodings();

/// A quarter of an annulus of ni x nj x nk nodes, bent along k; lower corner of its extent at `first`.
/// Points "p" (single), "U" (three components), "id" (integer), cells "T"; all values are single precision.
VtsGrid annulusVtsGrid(int64_t ni, int64_t nj, int64_t nk, std::array<int64_t, 3> first = {0, 0, 0});

}  // namespace curvisplat
