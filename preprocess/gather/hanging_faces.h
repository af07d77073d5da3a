// Finds faces of cells that lie against faces of half or twice their size: one of the cells is refined, and nodes hang
// between them. Such faces are not alike, as FaceMatcher has it, but have a corner in common. Which are found depends
// neither on memory nor on the order in which faces come. One thread calls.
//
// Most meshes have none, and most outer faces lie against nothing, so only corners at which normals oppose each other go
// to disk:
//
//    faces --> look(): directions at each corner --+--> none oppose each other: done
//                                                  +--> faces again, add(): such corners, sorted --> pairs
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/gather/streams_file.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

class HangingFaces {
 public:
  /// The four corners of a face, points of the mesh.
  using Corners = std::array<uint64_t, 4>;
  struct Face {
    uint64_t cell;
    glm::dvec3 centre_of_cell, centre;
    /// The vectors from the centre to the middles of two edges, the first turned to the second around `inward`.
    std::array<glm::vec3, 2> half_axes{};

    /// A vector at right angles to the face, into its cell, as long as the area.
    glm::dvec3 inward() const { return 4.0 * glm::cross(glm::dvec3(half_axes[0]), glm::dvec3(half_axes[1])); }
  };
  /// Face::half_axes of a face with these corners.
  static std::array<glm::vec3, 2> halfAxes(const std::array<glm::dvec3, 4>& corners,
                                           const glm::dvec3& inward);
  /// Takes a face, one that it lies against, and the values of that one's cell.
  using Take =
      std::function<void(const Face& face, const Face& other, std::span<const std::byte> values_of_other)>;

  /// A cell has `value_bytes` of values. Corners are sorted into several streams for each of `ranges`, of which one is
  /// in memory at a time. The directions take their bytes from the first look() to finish().
  struct Memory {
    uint64_t direction_bytes, corner_bytes;
  };
  HangingFaces(size_t value_bytes, size_t ranges, const Memory& memory, ScratchFiles scratch);

  /// Notes the direction of a face that has no other one alike.
  void look(const Corners& corners, const Face& face);
  /// Whether faces may lie against each other: false if add() and finish() have nothing to do. After all look()s.
  bool mayHang() const { return may_hang_; }
  /// Adds a face that look() has seen.
  void add(const Corners& corners, const Face& face, std::span<const std::byte> values);
  /// Passes both faces of each pair, once for each corner that they have in common, in an order that depends on memory.
  /// Once, after all faces.
  void finish(const Take& take, const Progress& progress);

  /// Bytes of a face at one corner, in the file.
  static uint64_t bytesOfCorner(size_t value_bytes) { return sizeof(Record) + value_bytes; }
  /// Returns how many of `bytes` do not stay in memory.
  static uint64_t bytesInFile(uint64_t bytes, size_t ranges, uint64_t memory_bytes) {
    return StreamsFile::bytesInFile(bytes, streamsFor(ranges, memory_bytes), memory_bytes);
  }

 private:
  struct Record {
    uint64_t corner;
    Face face;  // values follow
  };
  static size_t streamsFor(size_t ranges, uint64_t memory_bytes);
  uint8_t& directionsAt(uint64_t corner) { return directions_[corner % direction_bytes_]; }
  Record recordAt(size_t at) const;
  /// `corner`: the places of its records.
  void pairAt(std::span<const std::pair<uint64_t, size_t>> corner, const Take& take);

  const size_t value_bytes_;
  const uint64_t direction_bytes_;
  std::vector<uint8_t> directions_;  // [corner % direction_bytes_], a bit for each direction
  bool may_hang_ = false;
  StreamsFile file_;
  std::vector<std::byte> record_, records_;
  std::vector<std::pair<Face, std::span<const std::byte>>> at_corner_;
};

}  // namespace curvisplat
