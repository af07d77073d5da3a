#include "render/export/gaussian_glb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kFloats = 5126, kBytes = 5121, kPoints = 0, kVertices = 34962;
constexpr float kColourBasis = 0.28209479177387814f;  // the constant spherical harmonic

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

  /// Of the attribute that was added last.
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

}  // namespace

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
    const glm::vec3 c = (splat.colour - 0.5f) / kColourBasis;
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

}  // namespace curvisplat
