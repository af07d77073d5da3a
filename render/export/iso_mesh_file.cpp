#include "render/export/iso_mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kBlockRecords = 4096;  // records
constexpr size_t kKeptBlocks = 64;      // of vertices, for .stl
constexpr size_t kBlockBytes = 1 << 18;

static_assert(std::endian::native == std::endian::little);

std::string xmlText(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

/// Bytes that are written in large blocks.
class Bytes {
 public:
  explicit Bytes(OutputFile& file) : file_(file) {}
  ~Bytes() = default;
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;

  template <typename T>
  void add(const T& value) {
    const auto bytes = std::as_bytes(std::span(&value, 1));
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    if (bytes_.size() >= kBlockBytes) flush();
  }
  void addText(const std::string& text) {
    for (const char c : text) add(c);
  }
  void flush() {
    file_.append(std::span<const std::byte>(bytes_));
    bytes_.clear();
  }

 private:
  OutputFile& file_;
  std::vector<std::byte> bytes_;
};

}  // namespace

bool isIsoMeshName(const std::filesystem::path& path) {
  const std::string extension = extensionOf(path);
  return extension == ".ply" || extension == ".stl" || extension == ".vtp";
}

template <typename T>
void IsoMeshFile::Spool<T>::add(const T& record) {
  waiting.push_back(record);
  ++count;
  if (waiting.size() == kBlockRecords) flush();
}

template <typename T>
void IsoMeshFile::Spool<T>::flush() {
  file.out().append(std::span<const T>(waiting));
  waiting.clear();
}

template <typename T>
void IsoMeshFile::Spool<T>::read(const std::function<void(std::span<const T>)>& take) {
  flush();
  std::vector<T> block;
  for (uint64_t begin = 0; begin < count; begin += kBlockRecords) {
    block.resize(std::min<uint64_t>(kBlockRecords, count - begin));
    file.in().readAt(begin * sizeof(T), std::as_writable_bytes(std::span(block)));
    take(block);
  }
}

IsoMeshFile::IsoMeshFile(const std::filesystem::path& path)
    : path_(path),
      vertices_(ScratchFiles(writableTarget(path).parent_path())),
      triangles_(ScratchFiles(writableTarget(path).parent_path())) {
  if (!isIsoMeshName(path))
    throw UsageError("-o {}: expected a name that ends with .ply, .stl or .vtp for --iso", path.string());
}

uint32_t IsoMeshFile::addVertex(const glm::dvec3& at, const glm::vec3& normal) {
  if (vertices_.count >= std::numeric_limits<int32_t>::max())
    throw Error("{}: the isosurface has more than 2^31 vertices; give fewer --voxels", path_.string());
  vertices_.add({at, normal});
  return static_cast<uint32_t>(vertices_.count - 1);
}

void IsoMeshFile::addTriangle(const std::array<uint32_t, 3>& corners) {
  triangles_.add(corners);
}

void IsoMeshFile::writePly(OutputFile& file, const std::string& comment) {
  Bytes out(file);
  out.addText(fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment {}\nelement vertex {}\nproperty float x\nproperty float "
      "y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face "
      "{}\nproperty list uchar int vertex_indices\nend_header\n",
      comment, vertices_.count, triangles_.count));
  vertices_.read([&](std::span<const Vertex> block) {
    for (const Vertex& vertex : block) {
      out.add(glm::vec3(vertex.at));
      out.add(vertex.normal);
    }
  });
  triangles_.read([&](std::span<const std::array<uint32_t, 3>> block) {
    for (const auto& corners : block) {
      out.add(uint8_t{3});
      out.add(corners);
    }
  });
  out.flush();
}

/// Triangles have corners of their own; most are among those that were written last.
void IsoMeshFile::writeStl(OutputFile& file, const std::string& comment) {
  if (triangles_.count > std::numeric_limits<uint32_t>::max())
    throw Error("{}: an STL file holds at most 2^32 triangles; write a .vtp file", path_.string());
  vertices_.flush();
  struct Block {
    uint64_t number = std::numeric_limits<uint64_t>::max();
    std::vector<Vertex> vertices;
  };
  std::vector<Block> kept(kKeptBlocks);
  const auto cornerAt = [&](uint32_t n) {
    const uint64_t number = n / kBlockRecords;
    Block& block = kept[number % kKeptBlocks];
    if (block.number != number) {
      block.number = number;
      block.vertices.resize(std::min<uint64_t>(kBlockRecords, vertices_.count - number * kBlockRecords));
      vertices_.file.in().readAt(number * kBlockRecords * sizeof(Vertex),
                                 std::as_writable_bytes(std::span(block.vertices)));
    }
    return glm::vec3(block.vertices[n % kBlockRecords].at);
  };
  Bytes out(file);
  out.addText(fmt::format("{:<80.80}", comment));
  out.add(static_cast<uint32_t>(triangles_.count));
  triangles_.read([&](std::span<const std::array<uint32_t, 3>> block) {
    for (const auto& [a, b, c] : block) {
      const glm::vec3 at_a = cornerAt(a), at_b = cornerAt(b), at_c = cornerAt(c);
      const glm::vec3 normal = glm::cross(at_b - at_a, at_c - at_a);
      const float length = glm::length(normal);
      out.add(length > 0 ? normal / length : glm::vec3(0.0f));
      for (const glm::vec3& corner : {at_a, at_b, at_c}) out.add(corner);
      out.add(uint16_t{0});
    }
  });
  out.flush();
}

void IsoMeshFile::writeVtp(OutputFile& file, const std::string& name, double value) {
  const uint64_t points = vertices_.count * sizeof(glm::dvec3), normals = vertices_.count * sizeof(glm::vec3),
                 scalars = vertices_.count * sizeof(float), corners = triangles_.count * 3 * sizeof(uint32_t),
                 ends = triangles_.count * sizeof(int64_t);
  Bytes out(file);
  uint64_t offset = 0;
  const auto array = [&](const char* type, const std::string& of, int components, uint64_t bytes) {
    const std::string text = fmt::format(
        R"(<DataArray type="{}" Name="{}" NumberOfComponents="{}" format="appended" offset="{}"/>)", type, of,
        components, offset);
    offset += sizeof(uint64_t) + bytes;
    return text;
  };
  const std::string of_points = array("Float64", "Points", 3, points),
                    of_normals = array("Float32", "Normals", 3, normals),
                    of_scalars = array("Float32", xmlText(name), 1, scalars),
                    of_corners = array("Int32", "connectivity", 1, corners),
                    of_ends = array("Int64", "offsets", 1, ends);
  out.addText(fmt::format(
      R"(<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<PolyData><Piece NumberOfPoints="{}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="{}">
<Points>{}</Points>
<PointData Scalars="{}" Normals="Normals">{}{}</PointData>
<Polys>{}{}</Polys>
</Piece></PolyData>
<AppendedData encoding="raw">_)",
      vertices_.count, triangles_.count, of_points, xmlText(name), of_normals, of_scalars, of_corners,
      of_ends));
  out.add(points);
  vertices_.read([&](std::span<const Vertex> block) {
    for (const Vertex& vertex : block) out.add(vertex.at);
  });
  out.add(normals);
  vertices_.read([&](std::span<const Vertex> block) {
    for (const Vertex& vertex : block) out.add(vertex.normal);
  });
  out.add(scalars);
  for (uint64_t n = 0; n < vertices_.count; ++n) out.add(static_cast<float>(value));
  out.add(corners);
  triangles_.read([&](std::span<const std::array<uint32_t, 3>> block) {
    for (const auto& of_triangle : block) out.add(of_triangle);
  });
  out.add(ends);
  for (uint64_t n = 1; n <= triangles_.count; ++n) out.add(static_cast<int64_t>(3 * n));
  out.addText("</AppendedData></VTKFile>\n");
  out.flush();
}

void IsoMeshFile::finish(const std::string& name, double value) {
  TemporaryFile temporary(writableTarget(path_));
  OutputFile file(temporary.path(), Caching::kPages, OutputFile::Existing::kEmpty, path_);
  const std::string comment = fmt::format("isosurface of {} at {:g}", name, value);
  const std::string extension = extensionOf(path_);
  if (extension == ".ply") writePly(file, comment);
  if (extension == ".stl") writeStl(file, comment);
  if (extension == ".vtp") writeVtp(file, name, value);
  file.close();
  temporary.putIntoPlace();
}

}  // namespace curvisplat
