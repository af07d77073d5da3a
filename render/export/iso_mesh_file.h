// A triangle mesh that is written while it is made. All formats begin with their counts, so vertices and
// triangles wait in nameless files beside the target until all are there. Binary .ply and .stl in floats;
// .vtp with raw appended data, positions in doubles. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "stream/base/temporary_files.h"

namespace curvisplat {

class IsoMeshFile {
 public:
  /// Throws UsageError for another extension, Error if nothing can be written there.
  explicit IsoMeshFile(const std::filesystem::path& path);

  /// Adds a vertex, in world units, and returns its index. Throws Error if there are more than 2^31.
  uint32_t addVertex(const glm::dvec3& at, const glm::vec3& normal);
  void addTriangle(const std::array<uint32_t, 3>& corners);
  uint64_t vertices() const { return vertices_.count; }
  uint64_t triangles() const { return triangles_.count; }
  /// Writes the file: whole, or not at all. `name` is the scalar's.
  void finish(const std::string& name, double value);

 private:
  /// A list of records, of which the last ones wait in memory.
  template <typename T>
  struct Spool {
    explicit Spool(const ScratchFiles& scratch) : file(scratch) {}
    void add(const T& record);
    void flush();
    /// Passes all records to `take`, in order, a block at a time.
    void read(const std::function<void(std::span<const T>)>& take);

    NamelessFile file;
    std::vector<T> waiting;
    uint64_t count = 0;
  };
  struct Vertex {
    glm::dvec3 at;
    glm::vec3 normal;
    uint32_t unused = 0;
  };

  void writePly(OutputFile& file, const std::string& comment);
  void writeStl(OutputFile& file, const std::string& comment);
  void writeVtp(OutputFile& file, const std::string& name, double value);

  const std::filesystem::path path_;
  Spool<Vertex> vertices_;
  Spool<std::array<uint32_t, 3>> triangles_;
};

}  // namespace curvisplat
