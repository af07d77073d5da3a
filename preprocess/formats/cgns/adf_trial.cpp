#include "preprocess/formats/cgns/adf_trial.h"

#include <algorithm>
#include <string>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/library_trial.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr int kMaxDepth = 16;
constexpr size_t kMaxVisited = 20'000;
constexpr uint64_t kSmall = 4096;  // values that are read as a whole

/// The first and the last value, or all.
void readValues(const CgnsFile& file, const CgnsNode& node, const CgnsShape& shape) {
  if (shape.type == "C1") {
    file.texts(node);
  } else if (shape.number() && shape.count() <= kSmall) {
    file.numbers(node);
  } else if (shape.number()) {
    CgnsBox box{{}, {1, 1, 1}, {1, 1}};
    double value = 0;
    for (const bool last : {false, true}) {
      for (size_t axis = 0; last && axis < std::min<size_t>(3, shape.dims.size()); ++axis)
        box.first[axis] = shape.dims[axis] - 1;
      file.read(node, shape, box, &value);
    }
  }
}

/// Errors end the visit of a node, not of those beside it.
void visit(const CgnsFile& file, const CgnsNode& node, int depth, size_t& visited) {
  if (depth > kMaxDepth || ++visited > kMaxVisited) return;
  try {
    if (depth > 0) readValues(file, node, file.shape(node));
  } catch (const Error&) {
    // The reader finds the same, if it needs the node.
  }
  try {
    for (const CgnsNode& child : file.children(node)) visit(file, child, depth + 1, visited);
  } catch (const Error&) {
  }
}

}  // namespace

void tryAdf(const std::filesystem::path& path) {
  const std::string begin = beginningOf(InputFile(path), 7);
  if (begin.size() < 7 || !begin.ends_with("ADF")) return;
  tryLibrary("libcgns", path, [&] {
    const CgnsFile file(path);
    size_t visited = 0;
    visit(file, file.root(), 0, visited);
  });
}

}  // namespace curvisplat
