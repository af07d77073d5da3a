// Tries one PLOT3D layout after another on a file: which of them do its header, its record markers and its
// size agree with? The values are looked at by plot3d_detect.h only.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/plot3d/payload_file.h"
#include "preprocess/formats/plot3d/plot3d_header.h"
#include "preprocess/formats/plot3d/plot3d_layout.h"
#include "stream/base/file.h"

namespace curvisplat {

/// A file under one layout.
struct Plot3dFit {
  Plot3dLayout layout;
  PayloadFile payload;
  std::vector<Plot3dBlock> blocks;
  uint32_t components = 3;  // grid 3, Q 5, OVERFLOW and function files their own
  uint64_t trailing_bytes = 0;
  uint32_t species = 0;  // of an OVERFLOW file
};

/// Why a layout does not fit, and how far it did: of all of them the furthest tells most of the file.
struct Plot3dMisfit {
  LayoutMisfit::Reached reached = LayoutMisfit::nothing;
  Plot3dLayout layout;  // as far as it was decided
  std::string reason;
  std::vector<Plot3dBlock> blocks;  // from `dimensions` on
};

/// What is tried: either the file itself, or the spool of an ASCII file.
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

/// Trailing bytes are accepted up to an eighth of what a C file should have, so that a truncated file of a
/// larger layout does not pass as a smaller one; behind records any
/// number is. Throws Error if the disk
/// fails.
/// 2-D files fit as such (exact sizes only), so that they can be told and refused.
Plot3dFits fitPlot3d(const Plot3dCandidates& candidates);

}  // namespace curvisplat
