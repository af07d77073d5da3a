#include "render/gl/splat_tables.h"

#include <tbb/blocked_range.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "render/project/footprint.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr int kFootprintSteps = 1024;
constexpr GLint kFootprintUnit = 0, kClassesUnit = 1, kLayersUnit = 2, kColoursUnit = 3, kLayerBoundsUnit = 4;

float mostExtinction(const ClassificationTable& table) {
  float most = std::max(table.below().w, table.above().w);
  const auto cumulative = table.cumulative();
  for (size_t n = 0; n + 1 < cumulative.size(); ++n)
    most = std::max(most, cumulative[n + 1].w - cumulative[n].w);
  return most;
}

/// Value and step to the next value, so that linear interpolation needs one fetch.
std::vector<float> footprintTexels() {
  const auto table = footprintTable(kFootprintSteps);
  std::vector<float> texels;
  for (size_t step = 0; step + 1 < table.size(); ++step) {
    texels.push_back(static_cast<float>(table[step]));
    texels.push_back(static_cast<float>(table[step + 1] - table[step]));
  }
  return texels;
}

std::span<const float> floatsOf(std::span<const glm::vec4> values) {
  return {&values.data()->x, 4 * values.size()};
}

}  // namespace

void TableTexture::fill(const GlFunctions& gl, GLint unit, GLenum format, std::span<const float> values) {
  gl.BindBuffer(GL_TEXTURE_BUFFER, buffer.name());
  gl.BufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(values.size_bytes()), values.data(),
                GL_STATIC_DRAW);
  gl.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  gl.BindTexture(GL_TEXTURE_BUFFER, texture.name());
  gl.TexBuffer(GL_TEXTURE_BUFFER, format, buffer.name());
}

SplatTables::SplatTables(const GlFunctions& gl)
    : gl_(gl),
      footprint_(gl),
      classes_(gl),
      colours_(gl),
      layer_bounds_(gl),
      layers_texture_(makeTexture(gl)) {
  footprint_.fill(gl, kFootprintUnit, GL_RG32F, footprintTexels());
}

void SplatTables::load(ImageSize size, const ClassificationTable& table, const PixelShading& shading,
                       unsigned threads) {
  size_ = size;
  threads_ = threads;
  table_ = &table;
  shading_ = shading;
  layers_ = shading.layers && !shading.layers->empty() ? shading.layers : nullptr;
  if (layers_) loadLayers();
  classes_.fill(gl_, kClassesUnit, GL_RGBA32F, floatsOf(table.cumulative()));
  if (shading.colours) colours_.fill(gl_, kColoursUnit, GL_RGBA32F, floatsOf(shading.colours->cumulative()));
}

/// Calls work(y) for the picture's rows, on several threads.
template <typename Work>
void SplatTables::forRows(const Work& work) const {
  constexpr int kSome = 16;  // rows
  tbb::task_arena arena(
      std::min(static_cast<int>(threadsOrCores(threads_)), tbb::info::default_concurrency()));
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<int>(0, size_.height, kSome), [&](const auto& rows) {
      for (int y = rows.begin(); y < rows.end(); ++y) work(y);
    });
  });
}

/// The depths of the pixels' layers, as the shader reads them.
void SplatTables::loadLayers() {
  static_assert(PixelLayers::kMaxLayers == 4);
  const auto width = static_cast<size_t>(size_.width);
  std::vector<glm::vec4> depths(size_.pixels(), glm::vec4(PixelLayers::kNowhere));
  std::vector<size_t> most(static_cast<size_t>(size_.height));
  forRows([&](int y) {
    glm::vec4* to = &depths[static_cast<size_t>(y) * width];
    size_t& most_of_row = most[static_cast<size_t>(y)];
    for (int x = 0; x < size_.width; ++x, ++to) {
      const std::span<const PixelLayer> layers = layers_->at(x, y);
      for (size_t n = 0; n < layers.size(); ++n) (*to)[static_cast<int>(n)] = layers[n].depth;
      most_of_row = std::max(most_of_row, layers.size());
    }
  });
  most_layers_ = *std::max_element(most.begin(), most.end());
  gl_.ActiveTexture(GL_TEXTURE0 + kLayersUnit);
  gl_.BindTexture(GL_TEXTURE_2D, layers_texture_.name());
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, size_.width, size_.height, 0, GL_RGBA, GL_FLOAT,
                 depths.data());
  const std::vector<PixelLayers::Bounds> bounds = layers_->allBounds();
  static_assert(sizeof(PixelLayers::Bounds) == 2 * sizeof(float));
  layer_bounds_.fill(gl_, kLayerBoundsUnit, GL_RG32F, {&bounds.data()->nearest, 2 * bounds.size()});
  depth_bytes_ = depths.size() * sizeof(glm::vec4) + bounds.size() * sizeof(PixelLayers::Bounds);
  gl_.check("loading the depths of surfaces");
}

int SplatTables::loadLayerColours(const GlObject& texture, GLint unit) const {
  if (!layers_) return 0;
  gl_.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, texture.name());
  gl_.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA32F, size_.width, size_.height,
                   static_cast<GLsizei>(most_layers_));
  std::vector<glm::vec4> colours(size_.pixels());
  for (size_t n = 0; n < most_layers_; ++n) {
    forRows([&](int y) {
      glm::vec4* to = &colours[static_cast<size_t>(y) * static_cast<size_t>(size_.width)];
      for (int x = 0; x < size_.width; ++x) {
        const std::span<const PixelLayer> layers = layers_->at(x, y);
        *to++ = n < layers.size() ? layers[n].colour : glm::vec4(0.0f);
      }
    });
    gl_.TexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, static_cast<GLint>(n), size_.width, size_.height, 1,
                      GL_RGBA, GL_FLOAT, colours.data());
  }
  return static_cast<int>(most_layers_);
}

SplatShaderKind SplatTables::kind() const {
  return {.per_pixel = shading_.per_pixel,
          .log_scale = table_->logScale(),
          .layered = layers_ != nullptr,
          .coloured = shading_.colours != nullptr,
          .colour_log_scale = shading_.colours && shading_.colours->logScale(),
          .windows = windows()};
}

void SplatTables::use(const GlProgram& program) const {
  gl_.UseProgram(program.name());
  gl_.Uniform1i(program.uniform("lit"), shading_.lit ? 1 : 0);
  gl_.Uniform1i(program.uniform("footprint"), kFootprintUnit);
  gl_.Uniform1i(program.uniform("classes"), kClassesUnit);
  gl_.Uniform1i(program.uniform("layers"), kLayersUnit);
  gl_.Uniform1f(program.uniform("support"), static_cast<float>(kKernelSupport));
  gl_.Uniform1f(program.uniform("deviation"), static_cast<float>(kKernelSigma));
  gl_.Uniform1f(program.uniform("footprint_steps"),
                static_cast<float>(kFootprintSteps / (kKernelSupport * kKernelSupport)));
  gl_.Uniform1i(program.uniform("cells"), ClassificationTable::kCells);
  gl_.Uniform1f(program.uniform("low_pass"), shading_.low_pass_px2);
  gl_.Uniform1i(program.uniform("log_scale"), table_->logScale() ? 1 : 0);
  gl_.Uniform1f(program.uniform("most_extinction"), mostExtinction(*table_));
  gl_.Uniform1f(program.uniform("least_logarithmic"), ClassificationTable::kMinLogarithmic);
  const auto set = [&](const char* cells, const char* low, const char* high, const ClassificationTable& of) {
    const glm::vec4 below = of.below(), above = of.above();
    gl_.Uniform2f(program.uniform(cells), of.scale(), of.bias());
    gl_.Uniform4f(program.uniform(low), below.x, below.y, below.z, below.w);
    gl_.Uniform4f(program.uniform(high), above.x, above.y, above.z, above.w);
  };
  set("cells_from_scalar", "below", "above", *table_);
  // A buffer's texture is never left at the unit of another kind, of a sampler that is not used either.
  gl_.Uniform1i(program.uniform("colours"), kColoursUnit);
  gl_.Uniform1i(program.uniform("layer_bounds"), kLayerBoundsUnit);
  if (!shading_.colours) return;
  gl_.Uniform1i(program.uniform("colour_log_scale"), shading_.colours->logScale() ? 1 : 0);
  set("cells_from_colour", "colours_below", "colours_above", *shading_.colours);
}

Image SplatTables::composite(std::span<const float> drawn, bool opacities,
                             const glm::vec4& background) const {
  Image image(size_);
  const auto add = [&](PixelResult& result, const float* c) {
    result.add({c[0], c[1], c[2]}, opacities ? 1 - c[3] : c[3]);
  };
  const auto finish = [&](int x, int y) {
    const size_t pixel = static_cast<size_t>(y) * static_cast<size_t>(size_.width) + static_cast<size_t>(x);
    const float* from = &drawn[4 * pixel];
    PixelResult result;
    add(result, from);
    if (layers_)
      for (const PixelLayer& layer : layers_->at(x, y)) {
        result.add(glm::vec3(layer.colour), 1 - layer.colour.w);
        if (layer.colour.w >= 1) break;
        from += 4 * size_.pixels();
        add(result, from);
      }
    float* const to = &image.rgba[4 * pixel];
    for (int c = 0; c < 3; ++c) to[c] = result.colour[c] + result.through * background[c];
    to[3] = 1 - result.through * (1 - background[3]);
  };
  forRows([&](int y) {
    for (int x = 0; x < size_.width; ++x) finish(x, y);
  });
  return image;
}

}  // namespace curvisplat
