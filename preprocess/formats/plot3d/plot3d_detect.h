// Finds out how a PLOT3D file is laid out: every layout is tried, exact sizes come before trailing bytes, and
// what is left is judged by its values. Never guesses: a file that fits no layout, or two equally well, is an
// Error that says what was found and how to force a layout.
#pragma once

#include <filesystem>
#include <memory>

#include "preprocess/formats/plot3d/plot3d_fit.h"
#include "stream/base/file.h"

namespace curvisplat {

struct DetectedPlot3d {
  Plot3dFit fit;
  int written_precision_bytes = 4;  // 4 or 8: of an ASCII file by its digits
};

/// `file` is spooled to `temporary_folder` if it is a text.
DetectedPlot3d detectPlot3dGrid(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
                                const std::filesystem::path& temporary_folder);

/// A Q or a function file with the blocks of `grid`.
DetectedPlot3d detectPlot3dSolution(std::shared_ptr<const InputFile> file, const Plot3dForce& force,
                                    const std::filesystem::path& temporary_folder,
                                    const std::filesystem::path& grid_path,
                                    const std::vector<Plot3dBlock>& grid_blocks);

}  // namespace curvisplat
