// The first two passes of conversion: what is in the grid, and where it is dense.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/convert/bucket_plan.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// Reads all nodes once. Memory: the slabs. Throws Error if all nodes are blanked, or if the grid is too
/// large or too small for single precision.
///
/// If there are several ranks, each reads a share of the nodes, and all get the result; the sample is of the
/// share. Cell-centred grids are read whole by every rank.
GridSurvey surveyGrid(const NodeReader& reader, const SlabBuffers& slabs, const SurveyExtras& extras,
                      Progress& progress, Ranks& ranks = oneRank());

/// Throws Error if all samples are blanked, or if the grid is too large or too small for single precision.
void checkExtent(const GridSurvey& survey, const GridDescription& description);

/// The range of scalars is so wide that its square exceeds single precision.
class WideScalars final : public Error {
 public:
  WideScalars(const std::string& text, std::vector<uint32_t> scalars)
      : Error(text), scalars_(std::move(scalars)) {}
  const std::vector<uint32_t>& scalars() const { return scalars_; }  // places among the source's scalars

 private:
  std::vector<uint32_t> scalars_;
};

/// Throws WideScalars if one of the survey's scalars is too wide.
void checkRanges(const GridSurvey& survey, const GridDescription& description,
                 std::span<const uint32_t> scalars);

/// Sentences on values that no picture shows: those that single precision loses, and those of samples that are left out for the sake of
/// another scalar.
std::vector<std::string> warningsOfValues(const GridSurvey& survey, const DataSource& source,
                                          std::span<const uint32_t> scalars);

/// Counts the nodes that the grid does not blank, by cells of `root`. Reads coordinates alone: a node that
/// only its scalar blanks is counted, which makes the plan a little uneven at worst. `share`: the part of the
/// slabs to count.
void countNodes(const GridSource& source, const RootCube& root, const SlabBuffers& slabs,
                CountingGrid& counts, Progress& progress, const SlabShare& share = {});

/// Counts the nodes of a sample instead, without reading the grid.
void countSample(const PositionSample& sample, const RootCube& root, CountingGrid& counts);

/// The level to begin counting at: of voxels that nodes spread evenly over a box of `extent` would have to themselves. Nodes
/// may lie thousands of times as densely without more of them in a voxel than in a bucket.
uint32_t countingLevel(uint64_t nodes, const glm::dvec3& extent);

}  // namespace curvisplat
