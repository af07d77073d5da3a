#include "preprocess/formats/plot3d/plot3d_layout.h"

#include <fmt/format.h>

namespace curvisplat {

std::string describe(Plot3dKind kind) {
  switch (kind) {
    case Plot3dKind::kGrid:
      return "grid";
    case Plot3dKind::kQ:
      return "Q solution";
    case Plot3dKind::kOverflow:
      return "OVERFLOW Q solution";
    case Plot3dKind::kFunction:
      break;
  }
  return "function file";
}

std::string describe(const Plot3dLayout& layout) {
  std::string words;
  if (layout.ascii) {
    words = "ASCII";
  } else {
    words = layout.byte_order == ByteOrder::kBig ? "big-endian" : "little-endian";
    switch (layout.records) {
      case RecordMarkers::kNone:
        words += ", C (no record markers)";
        break;
      case RecordMarkers::kBytes4:
        words += ", Fortran (4-byte record markers)";
        break;
      case RecordMarkers::kBytes8:
        words += ", Fortran (8-byte record markers)";
        break;
    }
    words += layout.precision_bytes == 8 ? ", double precision" : ", single precision";
  }
  words += layout.multi_block ? ", multi-block" : ", single-block";
  if (layout.two_dimensional) words += ", 2-D";
  if (layout.kind == Plot3dKind::kGrid) words += layout.blanking ? ", iblank" : ", no iblank";
  return words;
}

std::string describe(const std::vector<Plot3dBlock>& blocks) {
  constexpr size_t kNamed = 4;
  std::string words = blocks.size() == 1 ? "1 block of " : fmt::format("{} blocks (", blocks.size());
  for (size_t n = 0; n < blocks.size() && n < kNamed; ++n)
    words += fmt::format("{}{}x{}x{}", n ? ", " : "", blocks[n].ni, blocks[n].nj, blocks[n].nk);
  if (blocks.size() > kNamed) words += ", ...";
  if (blocks.size() > 1) words += ")";
  return words;
}

}  // namespace curvisplat
