// The projection of the bricks that stay on the card.
#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <utility>

#include "render/gl/card_bricks.h"
#include "render/gl/tile_list_shaders.h"
#include "render/project/gradient_opacity.h"
#include "render/project/shadow_grid.h"
#include "render/project/splat_pieces.h"
#include "stream/base/error.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

constexpr GLuint kGeometryBinding = 1, kValuesBinding = 6;

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

/// The groups of a pair of pages: of splats, and of splats in pieces.
struct CardBricks::Groups {
  std::vector<ShaderGroup> splats, in_pieces;
};

/// This is what a slab is projected from.
struct CardBricks::Sent {
  std::vector<ShaderPart> parts;
  std::vector<glm::vec4> planes;
  std::map<std::pair<size_t, size_t>, Groups> groups;  // [page of geometry, page of values]
  uint32_t slot = 0;
};

void CardBricks::addPart(const StoredPart& part, const ProjectionSettings& settings, const DepthKeys& keys,
                         bool is_counted, Sent& sent) const {
  const Known& known = known_.at(part.brick);
  const CardPlaces::Place &geometry = *places_.find(geometryOf(part.brick)),
                          &values = *places_.find(valuesOf(part.brick));
  const auto number = static_cast<uint32_t>(sent.parts.size());
  ShaderPart& shader_part =
      sent.parts.emplace_back(shaderPart(part, settings, keys.linear(part.cell_min), geometry.begin));
  shader_part.values_base = static_cast<uint32_t>(values.begin);
  shader_part.splats_in_pieces = known.splats.back();
  const std::vector<glm::vec4> of_part = planesOf(part, settings.clip_planes);
  shader_part.first_plane = static_cast<uint32_t>(sent.planes.size());
  shader_part.kinds |= static_cast<uint32_t>(of_part.size()) | (is_counted ? 1u << 9 : 0);
  sent.planes.insert(sent.planes.end(), of_part.begin(), of_part.end());
  const auto a_splat = static_cast<uint32_t>(part.elementsASplat()),
             a_piece = static_cast<uint32_t>(part.elementsAPiece());
  Groups& groups = sent.groups[{geometry.page, values.page}];
  for (const SplatRange& range : part.ranges) {
    for (uint32_t first = range.begin; first < range.end; first += kProjectThreads) {
      groups.splats.push_back({number, first, std::min(kProjectThreads, range.end - first), sent.slot});
      sent.slot += a_splat * groups.splats.back().count;
    }
    const size_t from = octantAt(known, range.begin), to = octantAt(known, range.end);
    const uint32_t of_first = sent.slot - a_piece * known.pieces[from], end = known.splats[to];
    for (uint32_t first = known.splats[from]; first < end; first += kProjectThreads)
      groups.in_pieces.push_back({number, first, std::min(kProjectThreads, end - first), of_first});
    sent.slot += a_piece * (known.pieces[to] - known.pieces[from]);
  }
}

void CardBricks::send(Sent& sent) {
  constexpr uint32_t kVectors = sizeof(ShaderPart) / sizeof(glm::vec4);
  const auto planes_begin = static_cast<uint32_t>(kVectors * sent.parts.size());
  for (ShaderPart& part : sent.parts) part.first_plane += planes_begin;
  std::vector<ShaderGroup> groups;
  for (const auto& [pages, some] : sent.groups) {
    groups.insert(groups.end(), some.splats.begin(), some.splats.end());
    groups.insert(groups.end(), some.in_pieces.begin(), some.in_pieces.end());
  }
  parts_.reserve((planes_begin + sent.planes.size()) * sizeof(glm::vec4));
  parts_.write(0, std::span<const ShaderPart>(sent.parts));
  parts_.write(planes_begin * sizeof(glm::vec4), std::span<const glm::vec4>(sent.planes));
  groups_.reserve(groups.size() * sizeof(ShaderGroup));
  groups_.write(0, std::span<const ShaderGroup>(groups));
  if (frames_.bytes() > 0) return;
  const std::span<const GrowthFrame> frames = growthFrames();
  frames_.reserve(frames.size_bytes());
  frames_.write(0, frames);
}

/// A shader has one page of geometry at a time, and one of values.
void CardBricks::dispatch(const GlProgram& program, const Sent& sent) const {
  uint32_t first = 0;
  for (const auto& [pages, some] : sent.groups) {
    const auto splats = static_cast<uint32_t>(some.splats.size()),
               count = splats + static_cast<uint32_t>(some.in_pieces.size());
    gl_.Uniform1ui(program.uniform("first_group"), first);
    gl_.Uniform1ui(program.uniform("group_count"), count);
    gl_.Uniform1ui(program.uniform("groups_of_splats"), splats);
    pages_[pages.first].bind(kGeometryBinding);
    pages_[pages.second].bind(kValuesBinding);
    gl_.DispatchCompute(std::min(count, kMaxGroups), (count + kMaxGroups - 1) / kMaxGroups, 1);
    first += count;
  }
  gl_.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

void CardBricks::project(const ProjectionSettings& settings, const DepthKeys& keys, const CardSlab& slab,
                         const SplatTables& tables, float largest_scalar, const CardBuffer& splats) {
  Sent sent;
  for (const uint32_t number : slab.parts) {
    addPart(frame_parts_[number], settings, keys, counted_[number] == 0, sent);
    counted_[number] = 1;
  }
  CURVISPLAT_CHECK_OP(sent.slot, ==, slab.elements);
  if (sent.parts.empty()) return;
  send(sent);
  const GlProgram& projecting = program(settings.view.projection == Projection::kPerspective);
  tables.use(projecting);
  setView(projecting, settings, keys.linear(glm::dvec3(0.0)));
  // All parts of a picture are coloured, or none.
  gl_.Uniform1ui(projecting.uniform("colour_records"), frame_parts_.front().coloured ? 1 : 0);
  gl_.Uniform1f(projecting.uniform("reach"),
                1.001f * static_cast<float>(largestReach(settings.view.low_pass_px2)));
  gl_.Uniform1f(projecting.uniform("largest_scalar"), largest_scalar);
  sendShading(projecting, settings);
  splats.bind(0);
  parts_.bind(2);
  groups_.bind(3);
  fates_.bind(4);
  frames_.bind(5);
  shading_.bind(7);
  dispatch(projecting, sent);
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
