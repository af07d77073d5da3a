// The common part of the painters by OpenGL: the tables and the layers that their shaders read, as textures,
// and what becomes of a picture's windows of depth at the end.
//
// On the context's thread.
#pragma once

#include <glm/vec4.hpp>

#include <span>
#include <vector>

#include "render/gl/gl_functions.h"
#include "render/gl/splat_shader.h"
#include "render/image/image.h"
#include "render/project/painter.h"

namespace curvisplat {

/// A table that shaders read by index, exactly: no filtering, no size limit worth a thought.
struct TableTexture {
  GlObject buffer, texture;

  explicit TableTexture(const GlFunctions& gl) : buffer(makeBuffer(gl)), texture(makeTexture(gl)) {}

  void fill(const GlFunctions& gl, GLint unit, GLenum format, std::span<const float> values);
};

class SplatTables {
 public:
  explicit SplatTables(const GlFunctions& gl);

  /// Loads the tables of a frame. `table` and what `shading` borrows are borrowed until the frame ends. `threads`: that share
  /// the work of this frame; 0: one per core.
  void load(ImageSize size, const ClassificationTable& table, const PixelShading& shading, unsigned threads);
  /// The kind of program that draws the frame's splats.
  SplatShaderKind kind() const;
  /// The card's memory of the layers' depths and their bounds, and that of loadLayerColours().
  uint64_t layerBytes() const { return layers_ ? depth_bytes_ : 0; }
  uint64_t layerColourBytes() const {
    return layers_ ? sizeof(glm::vec4) * size_.pixels() * most_layers_ : 0;
  }
  int windows() const { return layers_ ? layers_->windows() : 1; }
  /// Sets the frame's uniforms of a program of that kind, which is then in use.
  void use(const GlProgram& program) const;

  /// Loads the colours of the pixels' layers into the texture, an array of as many pictures as a pixel has layers at most, bound
  /// to the unit. Returns how many.
  int loadLayerColours(const GlObject& texture, GLint unit) const;
  /// The frame's picture. `drawn` [windows() pictures, one after the other]: colours, and transmittances or, by
  /// `opacities`, one minus those.
  Image composite(std::span<const float> drawn, bool opacities, const glm::vec4& background) const;

 private:
  void loadLayers();
  template <typename Work>
  void forRows(const Work& work) const;

  const GlFunctions& gl_;
  TableTexture footprint_, classes_, colours_, layer_bounds_;
  GlObject layers_texture_;
  ImageSize size_{0, 0};
  const ClassificationTable* table_ = nullptr;
  const PixelLayers* layers_ = nullptr;  // null: none
  PixelShading shading_;
  unsigned threads_ = 0;
  size_t most_layers_ = 0;  // of a pixel
  uint64_t depth_bytes_ = 0;
};

}  // namespace curvisplat
