#include "render/gl/card_bricks.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <optional>

#include "render/gl/project_shader.h"
#include "render/gl/tile_list_shaders.h"
#include "render/project/splat_pieces.h"
#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

constexpr uint64_t kWordBytes = sizeof(uint32_t);

uint64_t wordsOf(size_t splats) {
  return kStoredArrays * splats;
}

size_t drawnSplats(const StoredPart& part) {
  size_t sum = 0;
  for (const SplatRange& range : part.ranges) sum += range.size();
  return sum;
}

glm::vec4 fourOf(const glm::vec3& v) {
  return {v.x, v.y, v.z, 0};
}

ShaderPart shaderPart(const StoredPart& part, const ScreenView& view, const DepthKeys::Linear& keys,
                      uint64_t begin) {
  ShaderPart out{};
  out.base = static_cast<uint32_t>(begin);
  out.splats = static_cast<uint32_t>(part.splats);
  out.key = keys.base;
  out.inverse_base = keys.inverse_base;
  out.first = part.keys.first;
  out.last = part.keys.last;
  if (view.projection == Projection::kOrthographic) {
    const OrthographicMap map(view, part.cell_min);
    out.x = map.x;
    out.y = map.y;
  } else {
    const PerspectiveMap map(view, part.cell_min, 1);
    out.origin_x = map.origin.x;
    out.origin_y = map.origin.y;
    out.origin_z = map.origin.z;
    out.from_base = map.from_base;
    out.order_base = map.order_base;
    const glm::vec3 eye(view.eye - view.scale * part.cell_min);
    out.eye_x = eye.x;
    out.eye_y = eye.y;
    out.eye_z = eye.z;
  }
  return out;
}

}  // namespace

CardBricks::CardBricks(const GlFunctions& gl)
    : gl_(gl), words_(gl), parts_(gl), groups_(gl), fates_(gl), frames_(gl) {}

void CardBricks::open(uint64_t content) {
  if (content == content_) return;
  content_ = content;
  bricks_.clear();
  by_place_.clear();
}

bool CardBricks::has(uint32_t brick) const {
  const auto found = bricks_.find(brick);
  return found != bricks_.end() && found->second.filled;
}

size_t CardBricks::makeRoom(std::span<const StoredPart> parts, uint64_t bytes) {
  ++frame_;
  const uint64_t largest = CardBuffer::largest(gl_);
  uint64_t stored = 0, drawn = 0;
  size_t count = 0;
  for (; count < parts.size(); ++count) {
    const uint64_t with_stored = stored + kWordBytes * wordsOf(parts[count].splats),
                   with_drawn = drawn + sizeof(ScreenSplat) * drawnSplats(parts[count]);
    // The painter needs a part of the buffer of splats for those that are drawn beside the stored ones.
    if (with_stored > largest || 2 * with_drawn > largest || with_stored + with_drawn > bytes) break;
    stored = with_stored;
    drawn = with_drawn;
  }
  parts = parts.first(count);
  const bool is_within = words_.bytes() + drawn <= bytes;
  if (is_within && place(parts, words_.bytes() / kWordBytes)) return count;
  bricks_.clear();
  by_place_.clear();
  if (!is_within) words_.release();
  if (count == 0) return 0;
  const uint64_t wanted = std::min({largest, bytes - drawn, 2 * stored});
  try {
    if (words_.bytes() < stored) words_.reserve(std::max(wanted, stored));
  } catch (const Error& error) {
    throw Error("{}; give less --card-memory than {} MiB, or 0", error.what(), stored >> 20);
  }
  CURVISPLAT_CHECK(place(parts, words_.bytes() / kWordBytes));
  return count;
}

/// Gives each part's brick a place, in which bricks may lie that are not needed. False if there is none.
bool CardBricks::place(std::span<const StoredPart> parts, uint64_t capacity) {
  for (const StoredPart& part : parts)
    if (const auto found = bricks_.find(part.brick); found != bricks_.end()) found->second.used = frame_;
  const auto removeOldest = [&] {
    const auto oldest = std::min_element(bricks_.begin(), bricks_.end(), [](const auto& a, const auto& b) {
      return a.second.used < b.second.used;
    });
    if (oldest == bricks_.end() || oldest->second.used == frame_) return false;
    by_place_.erase(oldest->second.begin);
    bricks_.erase(oldest);
    return true;
  };
  for (const StoredPart& part : parts) {
    if (bricks_.contains(part.brick)) continue;
    const uint64_t words = wordsOf(part.splats);
    std::optional<uint64_t> begin;
    while (!(begin = freePlace(words, capacity)))
      if (!removeOldest()) return false;
    bricks_[part.brick] = {*begin, words, frame_, false, false};
    by_place_[*begin] = part.brick;
  }
  return true;
}

/// The place behind all bricks, or the first between them that is large enough.
std::optional<uint64_t> CardBricks::freePlace(uint64_t words, uint64_t capacity) const {
  uint64_t begin = 0;
  if (!by_place_.empty()) begin = by_place_.rbegin()->first + bricks_.at(by_place_.rbegin()->second).words;
  if (begin + words <= capacity) return begin;
  begin = 0;
  for (const auto& [at, brick] : by_place_) {
    if (at - begin >= words) return begin;
    begin = at + bricks_.at(brick).words;
  }
  return std::nullopt;
}

void CardBricks::put(uint32_t brick, const GeometryArrays<const float>& geometry,
                     const VariableArrays<const float>& values) {
  Stored& stored = bricks_.at(brick);
  const size_t count = geometry.size();
  CURVISPLAT_CHECK_OP(wordsOf(count), ==, stored.words);
  uint64_t at = stored.begin * kWordBytes;
  const auto add = [&](const auto* values_) {
    words_.write(at, std::span(values_, count));
    at += kWordBytes * count;
  };
  for (const float* array :
       {geometry.x, geometry.y, geometry.z, geometry.axis0, geometry.axis1, geometry.axis2, geometry.shear10,
        geometry.shear20, geometry.shear21, geometry.weight})
    add(array);
  add(geometry.border_code);
  add(geometry.growth_code);
  for (const float* array : {values.mean, values.slope0, values.slope1, values.slope2, values.variance})
    add(array);
  stored.has_pieces = std::any_of(geometry.border_code, geometry.border_code + count,
                                  [](uint32_t code) { return code != kNoBorder; });
  stored.filled = true;
}

void CardBricks::compile() {
  for (const bool perspective : {false, true}) program(perspective);
}

const GlProgram& CardBricks::program(bool perspective) {
  std::optional<GlProgram>& program = programs_[perspective];
  if (!program) program.emplace(gl_, projectShader(perspective));
  return *program;
}

void CardBricks::setView(const GlProgram& program, const ProjectionSettings& settings,
                         const DepthKeys::Linear& keys) const {
  const ScreenView& view = settings.view;
  const auto set = [&](const char* name, float value) { gl_.Uniform1f(program.uniform(name), value); };
  const auto setRow = [&](const char* name, const glm::vec4& row) {
    gl_.Uniform4f(program.uniform(name), row.x, row.y, row.z, row.w);
  };
  const bool perspective = view.projection == Projection::kPerspective;
  const double pixels = perspective ? 1 : view.focal_px,
               area = perspective ? 1 : view.focal_px * view.focal_px;
  setRow("right", fourOf(glm::vec3(pixels * view.right * view.scale)));
  setRow("down", fourOf(glm::vec3(pixels * view.down * view.scale)));
  setRow("forward", fourOf(glm::vec3(view.forward * view.scale)));
  set("focal", static_cast<float>(view.focal_px));
  set("volume", static_cast<float>(area * view.scale.x * view.scale.y * view.scale.z));
  set("low_pass_px2", static_cast<float>(view.low_pass_px2));
  set("slope_low_pass_px2", static_cast<float>(view.slope_low_pass_px2));
  set("key_steps", keys.steps);
  set("key_steps_a_pixel", keys.steps_a_pixel);
  const auto width = static_cast<float>(view.size.width), height = static_cast<float>(view.size.height);
  gl_.Uniform2f(program.uniform("picture"), width, height);
  gl_.Uniform2f(program.uniform("middle"), 0.5f * width, 0.5f * height);
  gl_.Uniform1i(program.uniform("per_pixel"), settings.per_pixel);
  if (!settings.light) return;
  const Light& light = *settings.light;
  const auto g0_squared = static_cast<float>(std::max(settings.light_g0 * settings.light_g0, 1e-30));
  setRow("light", {light.ambient, light.diffuse, light.specular, g0_squared});
  gl_.Uniform1i(program.uniform("light_at_viewer"), !light.towards);
  if (light.towards) setRow("light_towards", fourOf(glm::vec3(glm::normalize(*light.towards))));
  setRow("viewer", fourOf(glm::vec3(-view.forward)));
  setRow("scale", fourOf(glm::vec3(view.scale)));
}

void CardBricks::project(const ProjectionSettings& settings, const DepthKeys& keys,
                         std::span<const StoredPart> parts, const SplatTables& tables, float largest_scalar,
                         const CardBuffer& splats) {
  std::vector<ShaderPart> shader_parts;
  std::vector<ShaderGroup> groups;
  uint32_t slot = 0;
  for (const StoredPart& part : parts) {
    const auto number = static_cast<uint32_t>(shader_parts.size());
    shader_parts.push_back(
        shaderPart(part, settings.view, keys.linear(part.cell_min), bricks_.at(part.brick).begin));
    for (const SplatRange& range : part.ranges)
      for (uint32_t first = range.begin; first < range.end; first += kProjectThreads) {
        groups.push_back({number, first, std::min(kProjectThreads, range.end - first), slot});
        slot += groups.back().count;
      }
  }
  parts_.reserve(shader_parts.size() * sizeof(ShaderPart));
  parts_.write(0, std::span<const ShaderPart>(shader_parts));
  groups_.reserve(groups.size() * sizeof(ShaderGroup));
  groups_.write(0, std::span<const ShaderGroup>(groups));
  fates_.reserve(4 * sizeof(uint32_t));
  fates_.clear();
  if (frames_.bytes() == 0) {
    const std::span<const GrowthFrame> frames = growthFrames();
    frames_.reserve(frames.size_bytes());
    frames_.write(0, frames);
  }
  const GlProgram& projecting = program(settings.view.projection == Projection::kPerspective);
  tables.use(projecting);
  setView(projecting, settings, keys.linear(glm::dvec3(0.0)));
  const auto count = static_cast<uint32_t>(groups.size());
  gl_.Uniform1ui(projecting.uniform("group_count"), count);
  gl_.Uniform1f(projecting.uniform("largest_scalar"), largest_scalar);
  const CardBuffer* const buffers[] = {&splats, &words_, &parts_, &groups_, &fates_, &frames_};
  for (GLuint binding = 0; binding < std::size(buffers); ++binding) buffers[binding]->bind(binding);
  gl_.DispatchCompute(std::min(count, kMaxGroups), (count + kMaxGroups - 1) / kMaxGroups, 1);
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  gl_.check("projecting bricks");
}

ProjectionCounts CardBricks::counts() const {
  std::array<uint32_t, 4> fates{};
  fates_.bind();
  gl_.GetBufferSubData(GL_SHADER_STORAGE_BUFFER, 0, sizeof(fates), fates.data());
  ProjectionCounts counts;
  counts.off_screen = fates[0];
  counts.transparent = fates[1];
  counts.drawn = counts.pieces = fates[2];
  counts.read = counts.off_screen + counts.transparent + counts.drawn;
  return counts;
}

}  // namespace curvisplat
