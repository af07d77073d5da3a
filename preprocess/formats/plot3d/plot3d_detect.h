// Detects the layout of a PLOT3D file. Tries every layout; prefers exact sizes to trailing bytes; then
// judges the remaining ones by their values. Never guesses: a file that fits no layout, or two equally well,
// is an Error that reports what was found and how to set the layout.
#pragma once

#include <filesystem>
#include <memory>

#include "preprocess/formats/plot3d/plot3d_fit.h"
#include "stream/base/file.h"

namespace curvisplat {

struct DetectedPlot3d {
  Plot3dFit fit;
  int written_precision_bytes = 4;  // 4 or 8; for an ASCII file inferred from its digits
};

/// An ASCII file is spooled to `temporary_folder`.
DetectedPlot3d detectPlot3dGrid(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
                                const std::filesystem::path& temporary_folder);

/// Detects a Q or function file that belongs to the grid with `grid_blocks`.
DetectedPlot3d detectPlot3dSolution(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
                                    const std::filesystem::path& temporary_folder,
                                    const std::filesystem::path& grid_path,
                                    const std::vector<Plot3dBlock>& grid_blocks);

}  // namespace curvisplat
