// What the passes up to "seams" leave for those that build: the splats on disk, and what is known of them. And what scatter
// has noted of the splats that were on disk before it ended.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/splat_origin.h"

namespace curvisplat {

struct ScatteredSplats {
  GridSurvey survey;
  ScatterCounts counts;
  uint64_t merged_nodes = 0;
  std::string overlap;   // Manifest::overlap
  BucketTree tree;       // with contents, as it was scattered by: before any bucket was divided
  BucketChains buckets;  // of the temporary file
  std::vector<BucketChains> buckets_of_ranks = {};  // from rank 1 on, where several have scattered
  std::optional<ScatterState> unfinished;           // not all splats are there: how far scatter had come

  uint64_t temporaryBytes() const {
    uint64_t bytes = buckets.size;
    for (const BucketChains& of_rank : buckets_of_ranks) bytes += of_rank.size;
    return bytes;
  }
};

}  // namespace curvisplat
