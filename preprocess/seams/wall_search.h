// Finds the thin walls of a structured grid: nodes at one position whose values differ, such as those on the two sides of
// a wing without thickness. Halves there are not merged, although their positions say that the grid goes on.
//
//    seams, sorted ---> sets of like halves ---> values of all stored scalars, ---> sides, where values differ
//                       external sort by face     read face by face                  external sort by set
//
// Positions alone do not tell a wall from the cut behind it (a C-grid's wake), nor does a velocity of zero: seams end at
// walls, and walls of inviscid flows move. Where the values of both sides agree, merging them loses nothing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "preprocess/grid/node_reader.h"
#include "preprocess/seams/seams.h"
#include "preprocess/seams/thin_walls.h"
#include "stream/base/progress.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {

/// Values at one position differ if they are further apart than this share of their own scale: the scalar's spread, from 5
/// to 95 % of a sample of the grid's rows, and the distance from its median (DESIGN.md, "Long tails": a derived scalar's
/// range says nothing). A delta wing's values are up to 0.7 of the range apart on the wing, and from 0.02 on at its trailing
/// edge; those of its wake 7e-5 at most, and less than 1e-4 of the range is noise.
inline constexpr double kWallShare = 0.01;

struct WallSearchMemory {
  uint64_t bytes = 0;
  std::filesystem::path temporary_folder;
};

/// The boxes of nodes that are not to be merged with those at their places.
struct FoundWalls {
  std::vector<WallSide> boxes;
  bool too_many =
      false;  // more than half a million nodes on walls, as where each block has values of its own; no boxes
};

/// Finds them by the scalars that the grid's files store at nodes, whichever of them are converted; without any, and for maps
/// of the Earth, there are none. Scalars of whole numbers, such as those of blocks or processes, and what cannot be read decide
/// nothing. To be called when `seams` has all splats, before they are merged. Throws Error if a file or the disk fails,
/// Interrupted if the progress is stopped.
FoundWalls findThinWalls(SeamMerger& seams, const NodeReader& reader, const WallSearchMemory& memory,
                         const Progress& progress);

/// How many nodes of the boxes are on no side of `others`.
uint64_t countMissing(std::span<const WallSide> boxes, std::span<const GridBlock> blocks,
                      const ThinWalls& others);

}  // namespace curvisplat
