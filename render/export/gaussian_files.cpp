// Files of 3D Gaussian splats: the bytes of each format, .ply, .spz and .glb, and then the file.
#include "render/export/gaussian_files.h"

#include <fmt/format.h>
#include <zlib.h>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "render/export/gaussian_splats.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr float kColourBasis = 0.28209479177387814f;  // the constant spherical harmonic
constexpr double kSpzWidth = 1000;                    // of the data's box, in the file's units

/// The zeroth coefficient of a colour.
glm::vec3 coefficientOf(const glm::vec3& colour) {
  return (colour - 0.5f) / kColourBasis;
}

float logit(float opacity) {
  return std::log(opacity / (1 - opacity));
}

/// A length that has a logarithm.
glm::vec3 positive(const glm::vec3& deviation) {
  return glm::max(deviation, glm::vec3(1e-30f));
}

template <typename T>
void append(std::vector<std::byte>& out, const T& value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof value);
}

std::vector<std::byte> plyOf(std::span<const GaussianSplat> splats) {
  std::string header =
      fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", splats.size());
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                           "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    header += fmt::format("property float {}\n", name);
  header += "end_header\n";
  std::vector<std::byte> out;
  out.reserve(header.size() + splats.size() * 17 * sizeof(float));
  for (const char c : header) out.push_back(static_cast<std::byte>(c));
  for (const GaussianSplat& splat : splats) {
    const glm::vec3 colour = coefficientOf(splat.colour), scale = glm::log(positive(splat.deviation));
    append(out, std::array{splat.position.x, splat.position.y, splat.position.z, 0.0f, 0.0f, 0.0f, colour.x,
                           colour.y, colour.z, logit(splat.opacity), scale.x, scale.y, scale.z,
                           splat.rotation.w, splat.rotation.x, splat.rotation.y, splat.rotation.z});
  }
  return out;
}

uint8_t byteOf(float value) {
  return static_cast<uint8_t>(std::clamp(std::round(value), 0.0f, 255.0f));
}

/// A .spz file before compression: a header, then each quantity of all splats.
std::vector<std::byte> spzBytes(std::span<const GaussianSplat> splats) {
  struct Header {
    uint32_t magic = 0x5053474e, version = 2, points = 0;
    uint8_t sh_degree = 0, fractional_bits = 12, flags = 0, reserved = 0;
  };
  static_assert(sizeof(Header) == 16);
  const SpzFrame frame = spzFrameOf(splats);
  std::vector<std::byte> out;
  out.reserve(sizeof(Header) + 19 * splats.size());
  Header header;
  header.points = static_cast<uint32_t>(splats.size());
  append(out, header);
  for (const GaussianSplat& splat : splats) {
    const glm::dvec3 at = (glm::dvec3(splat.position) - frame.centre) * frame.scale;
    for (int axis = 0; axis < 3; ++axis) {
      const auto fixed = static_cast<int32_t>(std::lround(at[axis] * 4096));
      for (int byte = 0; byte < 3; ++byte) out.push_back(static_cast<std::byte>(fixed >> (8 * byte) & 0xff));
    }
  }
  // Rounded down, as viewers round those of other files: they draw footprints wider than they are
  // (README.md).
  for (const GaussianSplat& splat : splats) append(out, byteOf(std::floor(255 * splat.opacity)));
  for (const GaussianSplat& splat : splats) {
    const glm::vec3 coefficient = coefficientOf(splat.colour);
    for (int c = 0; c < 3; ++c) append(out, byteOf((coefficient[c] * 0.15f + 0.5f) * 255));
  }
  for (const GaussianSplat& splat : splats) {
    const glm::vec3 scale = glm::log(positive(splat.deviation * static_cast<float>(frame.scale)));
    for (int axis = 0; axis < 3; ++axis) append(out, byteOf((scale[axis] + 10) * 16));
  }
  for (const GaussianSplat& splat : splats) {
    const glm::quat q = splat.rotation.w < 0 ? -splat.rotation : splat.rotation;
    for (const float part : {q.x, q.y, q.z}) append(out, byteOf(part * 127.5f + 127.5f));
  }
  return out;
}

std::vector<std::byte> gzip(std::span<const std::byte> bytes) {
  z_stream stream{};
  constexpr int kGzipFormat = 16;
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS + kGzipFormat, 8,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error("cannot compress: zlib has too little memory");
  std::vector<std::byte> out(deflateBound(&stream, static_cast<uLong>(bytes.size())));
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  size_t taken = 0, given = 0;
  // zlib counts in 32 bits.
  while (true) {
    constexpr size_t kMax = size_t{1} << 30;
    const size_t in = std::min(bytes.size() - taken, kMax), room = std::min(out.size() - given, kMax);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data() + taken));
    stream.avail_in = static_cast<uInt>(in);
    stream.avail_out = static_cast<uInt>(room);
    const int status = deflate(&stream, taken + in == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    taken += in - stream.avail_in;
    given += room - stream.avail_out;
    if (status == Z_STREAM_END || (status != Z_OK && status != Z_BUF_ERROR)) break;
  }
  deflateEnd(&stream);
  out.resize(given);
  return out;
}

using Json = nlohmann::ordered_json;

constexpr int kFloats = 5126, kBytes = 5121, kPoints = 0, kVertices = 34962;

/// A quarter turn about x: (x, y, z) becomes (x, z, -y).
const glm::quat kUpright{std::sqrt(0.5f), -std::sqrt(0.5f), 0, 0};

glm::vec3 upright(const glm::vec3& p) {
  return {p.x, p.z, -p.y};
}

/// A glTF file while it is put together: attributes one after the other in one buffer.
class Glb {
 public:
  explicit Glb(size_t splats) : splats_(splats) {}

  /// Adds an attribute of `parts` numbers for each splat; `write` appends those of one.
  template <typename T, size_t parts, typename Of>
  void add(const char* name, std::span<const GaussianSplat> splats, const Of& of) {
    static constexpr std::array<const char*, 5> kTypes{"", "SCALAR", "", "VEC3", "VEC4"};
    const size_t begin = bytes_.size();
    for (const GaussianSplat& splat : splats) {
      const std::array<T, parts> numbers = of(splat);
      const auto* const from = reinterpret_cast<const std::byte*>(numbers.data());
      bytes_.insert(bytes_.end(), from, from + sizeof numbers);
    }
    views_.push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", bytes_.size() - begin}, {"target", kVertices}});
    Json accessor = {{"bufferView", accessors_.size()},
                     {"componentType", sizeof(T) == 4 ? kFloats : kBytes},
                     {"count", splats_},
                     {"type", kTypes[parts]}};
    if (sizeof(T) == 1) accessor["normalized"] = true;
    attributes_[name] = accessors_.size();
    accessors_.push_back(std::move(accessor));
  }

  /// Sets the bounds of the attribute that was added last.
  void setBounds(const glm::vec3& lower, const glm::vec3& upper) {
    accessors_.back()["min"] = {lower.x, lower.y, lower.z};
    accessors_.back()["max"] = {upper.x, upper.y, upper.z};
  }

  std::vector<std::byte> file() const {
    const Json extension = {{"kernel", "ellipse"},
                            {"colorSpace", "srgb_rec709_display"},
                            {"projection", "perspective"},
                            {"sortingMethod", "cameraDistance"}};
    const Json primitive = {{"attributes", attributes_},
                            {"mode", kPoints},
                            {"extensions", {{"KHR_gaussian_splatting", extension}}}};
    const Json json = {{"asset", {{"version", "2.0"}, {"generator", "curvisplat " CURVISPLAT_VERSION}}},
                       {"extensionsUsed", Json::array({"KHR_gaussian_splatting"})},
                       {"buffers", Json::array({{{"byteLength", bytes_.size()}}})},
                       {"bufferViews", views_},
                       {"accessors", accessors_},
                       {"meshes", Json::array({{{"primitives", Json::array({primitive})}}})},
                       {"nodes", Json::array({{{"mesh", 0}}})},
                       {"scenes", Json::array({{{"nodes", Json::array({0})}}})},
                       {"scene", 0}};
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const uint64_t total = 12 + 8 + text.size() + 8 + bytes_.size();
    if (total > std::numeric_limits<uint32_t>::max())
      throw Error("{} splats make a .glb of {} bytes, but its header allows 4 GiB; lower --max-splats",
                  splats_, total);
    std::vector<std::byte> out;
    out.reserve(total);
    const auto append = [&](const void* from, size_t size) {
      const auto* const bytes = static_cast<const std::byte*>(from);
      out.insert(out.end(), bytes, bytes + size);
    };
    const auto append_number = [&](uint64_t number) {
      const auto word = static_cast<uint32_t>(number);
      append(&word, sizeof word);
    };
    append("glTF", 4);
    append_number(2);
    append_number(total);
    append_number(text.size());
    append("JSON", 4);
    append(text.data(), text.size());
    append_number(bytes_.size());
    append("BIN\0", 4);
    append(bytes_.data(), bytes_.size());
    return out;
  }

 private:
  const size_t splats_;
  std::vector<std::byte> bytes_;  // whole numbers of four
  Json views_ = Json::array(), accessors_ = Json::array(), attributes_ = Json::object();
};

/// Binary glTF with the extension KHR_gaussian_splatting. Scales are lengths and opacities 0..1, other than
/// in .ply. glTF's y axis is up: positions and axes are turned so that our z is. Throws Error if the file
/// would have 4 GiB or more, which its header cannot state.
std::vector<std::byte> glbOf(std::span<const GaussianSplat> splats) {
  using Three = std::array<float, 3>;
  if (splats.empty()) throw Error("no splat is visible: a .glb needs one or more; choose another function");
  Glb glb(splats.size());
  glm::vec3 lower = upright(splats.front().position), upper = lower;
  glb.add<float, 3>("POSITION", splats, [&](const GaussianSplat& splat) {
    const glm::vec3 p = upright(splat.position);
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
    return Three{p.x, p.y, p.z};
  });
  glb.setBounds(lower, upper);
  glb.add<float, 4>("KHR_gaussian_splatting:ROTATION", splats, [](const GaussianSplat& splat) {
    const glm::quat q = glm::normalize(kUpright * splat.rotation);
    return std::array<float, 4>{q.x, q.y, q.z, q.w};
  });
  glb.add<float, 3>("KHR_gaussian_splatting:SCALE", splats, [](const GaussianSplat& splat) {
    return Three{splat.deviation.x, splat.deviation.y, splat.deviation.z};
  });
  glb.add<float, 1>("KHR_gaussian_splatting:OPACITY", splats,
                    [](const GaussianSplat& splat) { return std::array<float, 1>{splat.opacity}; });
  glb.add<float, 3>("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", splats, [](const GaussianSplat& splat) {
    const glm::vec3 c = coefficientOf(splat.colour);
    return Three{c.x, c.y, c.z};
  });
  glb.add<uint8_t, 4>("COLOR_0", splats, [](const GaussianSplat& splat) {
    const auto byte = [](float value) {
      return static_cast<uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255 + 0.5f);
    };
    return std::array<uint8_t, 4>{byte(splat.colour.r), byte(splat.colour.g), byte(splat.colour.b),
                                  byte(splat.opacity)};
  });
  return glb.file();
}

}  // namespace

void checkGaussianName(const std::filesystem::path& path) {
  if (path.extension() != ".ply" && path.extension() != ".spz" && path.extension() != ".glb")
    throw UsageError("{}: expected a name that ends in .ply, .spz, .glb or .vdb", path.string());
}

SpzFrame spzFrameOf(std::span<const GaussianSplat> splats) {
  if (splats.empty()) return {};
  glm::dvec3 lower(splats.front().position), upper = lower;
  for (const GaussianSplat& splat : splats) {
    lower = glm::min(lower, glm::dvec3(splat.position));
    upper = glm::max(upper, glm::dvec3(splat.position));
  }
  const glm::dvec3 size = upper - lower;
  const double widest = std::max({size.x, size.y, size.z});
  return {0.5 * (lower + upper), widest > 0 ? kSpzWidth / widest : 1};
}

void writeGaussians(std::span<const GaussianSplat> splats, const std::filesystem::path& path) {
  checkGaussianName(path);
  const std::vector<std::byte> bytes = path.extension() == ".ply"   ? plyOf(splats)
                                       : path.extension() == ".glb" ? glbOf(splats)
                                                                    : gzip(spzBytes(splats));
  writeFileDurably(path, bytes);
}

}  // namespace curvisplat
