// manifest.json: what a cache holds, in words and numbers for people and for the reader. Written last, by
// rename: a cache folder without it is unfinished. Design section 4.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/model/octree.h"

namespace curvisplat {

struct VariableInfo {
  uint32_t number = 0;      // var.<number>.bin
  std::string name;         // unique in the cache
  std::string unit;         // may be empty
  double min = 0, max = 0;  // of the nodes' values, before any merging
};

/// One time step; a steady cache has exactly one.
struct StepInfo {
  double time = 0;
  std::string geometry = "geometry.bin";
  std::vector<uint32_t> variables;  // numbers
};

/// Size and checksum (XXH3, 64 bit) of a file of the cache. Of bricks' payload files the checksum is the hash
/// of the table of their bricks' checksums, so that opening never reads payloads.
struct FileInfo {
  std::string name;
  uint64_t size = 0;
  uint64_t checksum = 0;
};

struct BlockInfo {
  std::string name;
  uint64_t ni = 0, nj = 0, nk = 0;
};

/// A splat cache, but of a format that this program does not read.
class OtherVersion : public Error {
 public:
  using Error::Error;
};

/// What a reader must know of to read a cache, by the names in the manifest. Of a version 2 cache only: it is
/// one of version 1 but for these.
inline constexpr const char* kBorderFaces = "border-faces";  // borders are cut at faces (border_code.h)

struct Manifest {
  std::vector<std::string> requirements;  // "requires"; none: version 1
  std::string title;
  std::string program;               // what wrote it: "curvisplat 0.1.0"
  std::vector<std::string> sources;  // the input files, as given
  std::string reader;                // the input's layout and options, in words
  RootCube root;
  glm::dvec3 lower{0.0}, upper{0.0};  // bounds of the grid's nodes
  std::vector<BlockInfo> blocks;
  bool cells = false;          // each splat stands for a cell of the grid, not for a node; runs tell its
                               // lowest node
  uint64_t nodes = 0;          // of the grid, or its cells
  uint64_t blanked_nodes = 0;  // of those, not drawn: iblank, --blank and non-finite together
  uint64_t splats = 0;         // at the finest level
  uint64_t bricks = 0;
  uint32_t levels = 0;  // deepest level + 1
  double volume = 0;    // sum of the finest level's weights
  std::vector<VariableInfo> variables;
  std::vector<StepInfo> steps;
  std::vector<FileInfo> files;  // every other file of the cache

  std::string toJson() const;
  /// Throws Error naming `path` where a field is missing, of the wrong type or out of range, where a file's
  /// name is not a plain name; OtherVersion where this program does not read the version, or does not know a
  /// feature that it requires.
  static Manifest fromJson(const std::string& text, const std::filesystem::path& path);
};

}  // namespace curvisplat
