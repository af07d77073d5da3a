// Tries each PLOT3D layout on a file and compares it with the header, the record markers and the size. Values
// are judged later, in plot3d_detect.h.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_layout.h"
#include "stream/base/file.h"

namespace curvisplat {

/// A file interpreted by one layout.
struct Plot3dFit {
  Plot3dLayout layout;
  PayloadFile payload;
  std::vector<Plot3dBlock> blocks;
  uint32_t components = 3;  // grid: 3, Q: 5, OVERFLOW and function files: from their header
  uint64_t trailing_bytes = 0;
  uint32_t species = 0;  // OVERFLOW files only
};

/// Why a layout does not fit, and how far it fitted. The misfit that got furthest is reported.
struct Plot3dMisfit {
  LayoutMisfit::Reached reached = LayoutMisfit::kNothing;
  Plot3dLayout layout;  // the properties decided so far
  std::string reason;
  std::vector<Plot3dBlock> blocks;  // from `dimensions` on
};

/// The input of the search: the file itself, or the spool file of an ASCII file.
struct Plot3dCandidates {
  std::shared_ptr<const InputFile> file;
  uint64_t size = 0;
  bool ascii = false;
  std::vector<Plot3dKind> kinds;
  Plot3dForce force;
};

struct Plot3dFits {
  std::vector<Plot3dFit> fits;
  std::vector<Plot3dMisfit> misfits;
};

/// Files without records may have trailing bytes up to an eighth of the expected size, so that a truncated
/// file of a larger layout does not pass as one of a smaller layout; after records any number is accepted.
/// 2-D files fit as such (exact sizes only), so that they can be recognised and refused. Throws Error if
/// reading fails.
Plot3dFits fitPlot3d(const Plot3dCandidates& candidates);

}  // namespace curvisplat
