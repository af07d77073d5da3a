// What the passes up to "seams" leave for those that build: the splats on disk, and what is known of them.
#pragma once

#include <cstdint>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"

namespace curvisplat {

struct ScatteredSplats {
  GridSurvey survey;
  ScatterCounts counts;
  uint64_t merged_nodes = 0;
  BucketTree tree;       // with contents, as it was scattered by: before any bucket was divided
  BucketChains buckets;  // of the temporary file
};

}  // namespace curvisplat
