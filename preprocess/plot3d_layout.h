// How a PLOT3D file lies on disk. To be completed with detection by the reader.
#pragma once

#include <optional>

namespace curvisplat {

enum class ByteOrder { little, big };
enum class RecordMarkers { none, bytes4, bytes8 };

/// What the user says of a layout; the rest is detected.
struct Plot3dForce {
  std::optional<bool> ascii;
  std::optional<ByteOrder> byte_order;
  std::optional<RecordMarkers> records;
  std::optional<int> precision_bytes;  // 4 or 8
  std::optional<bool> multi_block;
  std::optional<bool> blanking;
};

}  // namespace curvisplat
