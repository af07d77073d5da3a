#include "render/gl/card_bricks.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <optional>

#include "render/gl/tile_list_shaders.h"
#include "render/project/gradient_opacity.h"
#include "render/project/shadow_grid.h"
#include "render/project/splat_pieces.h"
#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

constexpr uint64_t kWordBytes = sizeof(uint32_t);

size_t storedArrays(bool coloured) {
  return kStoredArrays + (coloured ? kStoredColourArrays : 0);
}

size_t splatsOf(const StoredPart& part) {
  size_t sum = 0;
  for (const SplatRange& range : part.ranges) sum += range.size();
  return sum;
}

glm::vec4 fourOf(const glm::vec3& v) {
  return {v.x, v.y, v.z, 0};
}

ShaderPart shaderPart(const StoredPart& part, const ProjectionSettings& settings,
                      const DepthKeys::Linear& keys, uint64_t begin) {
  const ScreenView& view = settings.view;
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
    if (part.layered)
      out.layer_offset =
          static_cast<float>(view.viewFromData(part.cell_min).z - settings.layers->depthOrigin());
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
  if (part.layered) out.kinds = 1u << 8;
  if (const ShadowGrid* const shadows = settings.shadows.get()) {
    const glm::vec3 node((part.cell_min - shadows->lattice().lower) / shadows->lattice().edge);
    out.node_x = node.x;
    out.node_y = node.y;
    out.node_z = node.z;
  }
  return out;
}

/// The planes that may cut splats of the part, as LocalClipPlanes has them.
std::vector<glm::vec4> planesOf(const StoredPart& part, std::span<const ClipPlane> planes) {
  std::vector<glm::vec4> local;
  for (size_t n = 0; n < planes.size(); ++n) {
    if (!(part.clips >> n & 1)) continue;
    const glm::dvec3 normal = glm::normalize(planes[n].normal);
    local.emplace_back(glm::vec3(normal),
                       static_cast<float>(glm::dot(normal, part.cell_min - planes[n].point)));
  }
  return local;
}

}  // namespace

CardBricks::CardBricks(const GlFunctions& gl)
    : gl_(gl), words_(gl), parts_(gl), groups_(gl), fates_(gl), frames_(gl), planes_(gl), shading_(gl) {}

void CardBricks::open(uint64_t content) {
  if (content == content_) return;
  content_ = content;
  known_.clear();
  bricks_.clear();
  by_place_.clear();
}

bool CardBricks::has(uint32_t brick) const {
  return bricks_.contains(brick);
}

/// The words of the part's brick, as far as is known.
uint64_t CardBricks::wordsOf(const StoredPart& part) const {
  const auto found = known_.find(part.brick);
  return storedArrays(part.coloured) * part.splats + (found == known_.end() ? 0 : found->second.words());
}

/// elementsOf() without looking for the pieces of its ranges: those of the whole brick, as far as is known.
uint64_t CardBricks::mostElements(const StoredPart& part) const {
  const auto found = known_.find(part.brick);
  return part.elementsASplat() * splatsOf(part) +
         (found == known_.end() ? 0 : part.elementsAPiece() * found->second.first.back());
}

size_t CardBricks::makeRoom(std::span<const StoredPart> parts, uint64_t bytes) {
  ++frame_;
  const uint64_t largest = CardBuffer::largest(gl_);
  uint64_t stored = 0, drawn = 0;
  size_t count = 0;
  for (; count < parts.size(); ++count) {
    const uint64_t with_stored = stored + kWordBytes * wordsOf(parts[count]),
                   with_drawn = drawn + sizeof(ScreenSplat) * mostElements(parts[count]);
    // The painter needs a part of the buffer of splats for those that are drawn beside the stored ones.
    if (with_stored > largest || 2 * with_drawn > largest || with_stored + with_drawn > bytes) break;
    stored = with_stored;
    drawn = with_drawn;
  }
  for (const StoredPart& part : parts.first(count))
    if (const auto found = bricks_.find(part.brick); found != bricks_.end()) found->second.used = frame_;
  const bool is_within = words_.bytes() + drawn <= bytes && stored <= words_.bytes();
  if (is_within && !is_scattered_) return count;
  is_scattered_ = false;
  bricks_.clear();
  by_place_.clear();
  if (!is_within) words_.release();
  if (count == 0) return 0;
  // More than is known of now, for the pieces, and for other bricks.
  const uint64_t wanted = std::min({largest, bytes - drawn, 4 * stored});
  try {
    if (words_.bytes() < stored) words_.reserve(std::max(wanted, stored));
  } catch (const Error& error) {
    throw Error("{}; give less --card-memory than {} MiB, or 0", error.what(), stored >> 20);
  }
  return count;
}

/// A free place, for which bricks may go that are not needed, those first that were used least recently.
std::optional<uint64_t> CardBricks::placeFor(uint64_t words) {
  for (;;) {
    if (const auto begin = freePlace(words)) return begin;
    const auto oldest = std::min_element(bricks_.begin(), bricks_.end(), [](const auto& a, const auto& b) {
      return a.second.used < b.second.used;
    });
    if (oldest == bricks_.end() || oldest->second.used == frame_) return {};
    by_place_.erase(oldest->second.begin);
    bricks_.erase(oldest);
  }
}

/// The place behind all bricks, or the first between them that is large enough.
std::optional<uint64_t> CardBricks::freePlace(uint64_t words) const {
  const uint64_t capacity = words_.bytes() / kWordBytes;
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

void CardBricks::put(uint32_t brick, const GeometryArrays<const float>& geometry, const BrickValues& values,
                     const BrickPieces& pieces) {
  const size_t count = geometry.size();
  Known& known = known_[brick];
  known = {};
  for (const BrickPieces::Splat& splat : pieces.splats) {
    known.splats.push_back(splat.number);
    known.first.push_back(splat.first);
  }
  known.first.push_back(static_cast<uint32_t>(pieces.pieces.size()));
  const uint64_t words = storedArrays(values.colours.has_value()) * count + known.words();
  const std::optional<uint64_t> begin = placeFor(words);
  if (!begin) {
    is_scattered_ = true;
    return;
  }
  uint64_t at = *begin * kWordBytes;
  const auto add = [&]<typename T>(std::span<const T> some) {
    words_.write(at, some);
    at += some.size_bytes();
  };
  for (const float* array :
       {geometry.x, geometry.y, geometry.z, geometry.axis0, geometry.axis1, geometry.axis2, geometry.shear10,
        geometry.shear20, geometry.shear21, geometry.weight})
    add(std::span(array, count));
  if (pieces.has_too_many)
    add(std::span<const uint32_t>(std::vector<uint32_t>(count, kNoBorder)));
  else
    add(std::span(geometry.border_code, count));
  add(std::span(geometry.growth_code, count));
  const auto addValues = [&](const VariableArrays<const float>& of) {
    for (const float* array : {of.mean, of.slope0, of.slope1, of.slope2, of.variance})
      add(std::span(array, count));
  };
  addValues(values.scalar);
  if (values.colours) addValues(*values.colours);
  add(std::span(pieces.splats));
  add(std::span(pieces.pieces));
  bricks_[brick] = {*begin, words, frame_};
  by_place_[*begin] = brick;
}

CardBricks::PieceRange CardBricks::piecesIn(const Known& known, const SplatRange& range) const {
  const auto at = [&](uint32_t number) {
    return static_cast<size_t>(std::lower_bound(known.splats.begin(), known.splats.end(), number) -
                               known.splats.begin());
  };
  return {at(range.begin), at(range.end)};
}

size_t CardBricks::elementsOf(const StoredPart& part) const {
  const Known& known = known_.at(part.brick);
  size_t pieces = 0;
  for (const SplatRange& range : part.ranges) {
    const PieceRange in_range = piecesIn(known, range);
    pieces += known.first[in_range.end] - known.first[in_range.begin];
  }
  return part.elementsASplat() * splatsOf(part) + part.elementsAPiece() * pieces;
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
  setRow("scale", fourOf(glm::vec3(view.scale)));
  if (!settings.light) return;
  const Light& light = *settings.light;
  const auto g0_squared = static_cast<float>(std::max(settings.light_g0 * settings.light_g0, 1e-30));
  setRow("light", {light.ambient, light.diffuse, light.specular, g0_squared});
  gl_.Uniform1i(program.uniform("light_at_viewer"), !light.towards);
  if (light.towards) setRow("light_towards", fourOf(glm::vec3(glm::normalize(*light.towards))));
  setRow("viewer", fourOf(glm::vec3(-view.forward)));
}

/// Sends what factors of opacity and light depend on; shadows only if they have changed, since they are large.
void CardBricks::sendShading(const GlProgram& program, const ProjectionSettings& settings) {
  std::vector<float> points;
  if (const GradientOpacity* const gradient = settings.gradient.get())
    for (size_t n = 0; n < gradient->magnitudes().size(); ++n)
      points.insert(points.end(), {gradient->magnitudes()[n], gradient->factors()[n]});
  const std::span<const float> arriving =
      settings.shadows ? settings.shadows->arriving() : std::span<const float>();
  const uint64_t before = shading_.bytes(), begin = points.size() * sizeof(float);
  shading_.reserve(std::max<uint64_t>(begin + arriving.size_bytes(), sizeof(float)));
  shading_.write(0, std::span<const float>(points));
  if (shading_.bytes() != before || settings.shadows != shadows_ || begin != shadows_begin_)
    shading_.write(begin, arriving);
  shadows_ = settings.shadows;
  shadows_begin_ = begin;
  gl_.Uniform1ui(program.uniform("steepness_points"), static_cast<GLuint>(points.size() / 2));
  const ShadowLattice lattice = shadows_ ? shadows_->lattice() : ShadowLattice{};
  gl_.Uniform3i(program.uniform("lattice_nodes"), shadows_ ? lattice.nodes[0] : 0, lattice.nodes[1],
                lattice.nodes[2]);
  const glm::vec3 per_edge(1.0 / lattice.edge);
  gl_.Uniform4f(program.uniform("nodes_per_unit"), per_edge.x, per_edge.y, per_edge.z, 0);
}

void CardBricks::project(const ProjectionSettings& settings, const DepthKeys& keys,
                         std::span<const StoredPart> parts, const SplatTables& tables, float largest_scalar,
                         const CardBuffer& splats) {
  std::vector<ShaderPart> shader_parts;
  std::vector<ShaderGroup> groups, groups_of_pieces;
  std::vector<glm::vec4> planes;
  uint32_t slot = 0;
  for (const StoredPart& part : parts) {
    const Known& known = known_.at(part.brick);
    const auto number = static_cast<uint32_t>(shader_parts.size());
    shader_parts.push_back(
        shaderPart(part, settings, keys.linear(part.cell_min), bricks_.at(part.brick).begin));
    shader_parts.back().splats_in_pieces = static_cast<uint32_t>(known.splats.size());
    const std::vector<glm::vec4> of_part = planesOf(part, settings.clip_planes);
    shader_parts.back().first_plane = static_cast<uint32_t>(planes.size());
    shader_parts.back().kinds |= static_cast<uint32_t>(of_part.size());
    planes.insert(planes.end(), of_part.begin(), of_part.end());
    for (const SplatRange& range : part.ranges) {
      for (uint32_t first = range.begin; first < range.end; first += kProjectThreads) {
        groups.push_back({number, first, std::min(kProjectThreads, range.end - first), slot});
        slot += static_cast<uint32_t>(part.elementsASplat()) * groups.back().count;
      }
      const PieceRange pieces = piecesIn(known, range);
      for (size_t first = pieces.begin; first < pieces.end; first += kProjectThreads) {
        const size_t end = std::min(first + kProjectThreads, pieces.end);
        groups_of_pieces.push_back(
            {number, static_cast<uint32_t>(first), static_cast<uint32_t>(end - first), slot});
        slot += static_cast<uint32_t>(part.elementsAPiece()) * (known.first[end] - known.first[first]);
      }
    }
  }
  const auto groups_of_splats = static_cast<uint32_t>(groups.size());
  groups.insert(groups.end(), groups_of_pieces.begin(), groups_of_pieces.end());
  parts_.reserve(shader_parts.size() * sizeof(ShaderPart));
  parts_.write(0, std::span<const ShaderPart>(shader_parts));
  groups_.reserve(groups.size() * sizeof(ShaderGroup));
  groups_.write(0, std::span<const ShaderGroup>(groups));
  planes_.reserve(std::max<size_t>(planes.size(), 1) * sizeof(glm::vec4));
  planes_.write(0, std::span<const glm::vec4>(planes));
  fates_.reserve(kFates * sizeof(uint32_t));
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
  gl_.Uniform1ui(projecting.uniform("groups_of_splats"), groups_of_splats);
  const bool coloured = !parts.empty() && parts.front().coloured;  // all are, or none
  gl_.Uniform1ui(projecting.uniform("colour_records"), coloured ? 1 : 0);
  gl_.Uniform1ui(projecting.uniform("stored_arrays"), static_cast<GLuint>(storedArrays(coloured)));
  gl_.Uniform1f(projecting.uniform("reach"),
                1.001f * static_cast<float>(largestReach(settings.view.low_pass_px2)));
  gl_.Uniform1f(projecting.uniform("largest_scalar"), largest_scalar);
  sendShading(projecting, settings);
  const CardBuffer* const buffers[] = {&splats, &words_,  &parts_,  &groups_,
                                       &fates_, &frames_, &planes_, &shading_};
  for (GLuint binding = 0; binding < std::size(buffers); ++binding) buffers[binding]->bind(binding);
  gl_.DispatchCompute(std::min(count, kMaxGroups), (count + kMaxGroups - 1) / kMaxGroups, 1);
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  gl_.check("projecting bricks");
}

ProjectionCounts CardBricks::counts() const {
  std::array<uint32_t, kFates> fates{};
  fates_.bind();
  gl_.GetBufferSubData(GL_SHADER_STORAGE_BUFFER, 0, sizeof(fates), fates.data());
  ProjectionCounts counts;
  counts.off_screen = fates[0];
  counts.transparent = fates[1];
  counts.drawn = fates[2];
  counts.clipped = fates[4];
  counts.hidden = fates[5];
  counts.read = counts.off_screen + counts.transparent + counts.drawn + counts.clipped + counts.hidden;
  return counts;
}

}  // namespace curvisplat
