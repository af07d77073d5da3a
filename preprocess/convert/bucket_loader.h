// Loads the buckets of a temporary file, ahead of the work, and groups each one's records by the cells
// that are to be built. Several threads load a bucket together: one alone would take longer than 16 take to build it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/build_cell.h"
#include "preprocess/grid/read_ahead.h"
#include "stream/base/unfilled_array.h"
#include "stream/base/worker_team.h"

namespace curvisplat {

/// The node of the tree that is built as a whole from the records in `leaf`: the leaf itself, or the highest
/// node above it that fits a brick, or whose splats all coincide. It depends on the splats alone, where the
/// leaf depends on the plan.
uint32_t buildUnitOf(const BucketTree& tree, uint32_t leaf);

struct LoadedBucket {
  struct Part {
    uint32_t unit = 0;  // node of the tree
    size_t begin = 0, count = 0;
  };

  uint32_t bucket = 0;
  bool too_large = false;  // has more records than allowed: nothing is loaded
  UnfilledArray<std::byte> bytes;
  UnfilledArray<uint32_t> places;  // of the records: RecordSpan's
  std::vector<Part> parts;         // of `places`, in Morton order

  RecordSpan records(const Part& part) {
    return {bytes.data(), places.span().subspan(part.begin, part.count)};
  }
};

/// The buckets first .. end - 1.
struct BucketRange {
  uint32_t first = 0, end = 0;
};

/// Loads the buckets of a range that are not empty, in order. Ends after one that is too large, so that
/// its division has the memory for itself. In memory are two buckets of `most_bytes`, 4 bytes a record
/// of three, and a chunk for each reader.
/// Tree and file must not change meanwhile.
class BucketLoader {
 public:
  /// `readers`: threads that load a bucket, 1 to BucketChains::kCount. One does if the system cannot start the others.
  BucketLoader(const BucketTree& tree, const BucketFile& file, size_t variables, const BucketRange& range,
               uint64_t most_bytes, unsigned readers);
  ~BucketLoader();

  /// The next bucket, until it is given back; null at the end. Throws Error if the disk fails. Two may be taken. One thread at a time.
  LoadedBucket* take() { return ahead_.take(); }
  /// Of those taken, the one that was taken first. Any thread.
  void giveBack() { ahead_.giveBack(); }

 private:
  struct Reader;

  bool fill(LoadedBucket& loaded);
  void read(LoadedBucket& loaded);
  void sortParts(LoadedBucket& loaded);
  void place(LoadedBucket& loaded);
  void forEachReader(const std::function<void(Reader&, size_t)>& job);

  const BucketTree* tree_;
  const BucketFile* file_;
  const size_t variables_;
  uint32_t position_;
  const uint32_t end_;
  const uint64_t most_bytes_;
  bool ended_ = false;
  std::unique_ptr<WorkerTeam> team_;  // of all readers but the first, which is the thread that reads ahead
  std::vector<Reader> readers_;
  // By the record's place in the bucket over the least bytes of a record, which no two share: 2 x its part among its reader's, and 1
  // if it is irregular.
  UnfilledArray<uint32_t> tags_;
  ReadAhead<LoadedBucket> ahead_;  // last: its thread uses the others
};

}  // namespace curvisplat
