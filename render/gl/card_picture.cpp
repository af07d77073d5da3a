#include "render/gl/card_picture.h"

#include <utility>

#include "render/gl/splat_tables.h"
#include "render/gl/tile_picture.h"

namespace curvisplat {
namespace {

constexpr GLint kLayerColoursUnit = 5;  // beyond those of SplatTables
constexpr int kCompositeGroupSide = 8;

// Composites as PixelResult does: windows of depth and the layers between them, front to back, then the background.
constexpr const char* kComposite = R"(#version 430 core
layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba32f, binding = 0) readonly uniform image2DArray windows;  // colour and transmittance
layout(rgba8, binding = 1) writeonly uniform image2D picture;
uniform sampler2DArray layers;  // premultiplied; zeros where a pixel has fewer
uniform int layer_count;
uniform vec4 background;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(picture)))) return;
  vec4 seen = vec4(0.0, 0.0, 0.0, 1.0);  // transmittance last
  for (int n = 0; n < max(imageSize(windows).z, layer_count); ++n) {
    if (n < imageSize(windows).z) {
      vec4 adds = imageLoad(windows, ivec3(pixel, n));
      seen = vec4(seen.rgb + seen.w * adds.rgb, seen.w * adds.w);
    }
    if (n < layer_count) {
      vec4 adds = texelFetch(layers, ivec3(pixel, n), 0);
      seen = vec4(seen.rgb + seen.w * adds.rgb, seen.w * (1.0 - adds.w));
    }
  }
  vec4 colour = vec4(seen.rgb + seen.w * background.rgb, 1.0 - seen.w * (1.0 - background.w));
  // Drivers may round otherwise.
  imageStore(picture, pixel, floor(clamp(colour, 0.0, 1.0) * 255.0 + 0.5) / 255.0);
}
)";

GLuint groupsAlong(int pixels) {
  return static_cast<GLuint>((pixels + kCompositeGroupSide - 1) / kCompositeGroupSide);
}

/// A texture for a picture, with a name that its owner deletes.
GLuint makePictureTexture(const GlFunctions& gl, ImageSize size) {
  GLuint texture = 0;
  gl.GenTextures(1, &texture);
  gl.ActiveTexture(GL_TEXTURE0 + kLayerColoursUnit);
  gl.BindTexture(GL_TEXTURE_2D, texture);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA8, size.width, size.height);
  gl.BindTexture(GL_TEXTURE_2D, 0);
  return texture;
}

}  // namespace

void SharedBin::put(GLuint texture, GLsync fence) {
  const MutexLock lock(mutex_);
  dead_.push_back({texture, fence});
}

void SharedBin::empty(const GlFunctions& gl) {
  std::vector<Dead> dead;
  {
    const MutexLock lock(mutex_);
    dead.swap(dead_);
  }
  for (const Dead& one : dead) {
    gl.DeleteTextures(1, &one.texture);
    if (one.fence) gl.DeleteSync(one.fence);
  }
}

void CardPicture::waitFor(const GlFunctions& gl) const {
  gl.WaitSync(drawn_, 0, GL_TIMEOUT_IGNORED);
}

std::shared_ptr<CardPicture> CardPictures::make(const TilePicture& painted, const SplatTables& tables,
                                                const glm::vec4& background) {
  bin_->empty(gl_);
  if (!compositing_) compositing_.emplace(gl_, kComposite);
  const ImageSize size = painted.size();
  // The texture is the bin's already where there is no memory for what follows.
  auto made = std::make_shared<CardPicture>(bin_, makePictureTexture(gl_, size), size);
  const GlObject layers = makeTexture(gl_);
  const int layer_count = tables.loadLayerColours(layers, kLayerColoursUnit);
  gl_.check("the picture that is shown");
  gl_.UseProgram(compositing_->name());
  gl_.Uniform1i(compositing_->uniform("layers"), kLayerColoursUnit);
  gl_.Uniform1i(compositing_->uniform("layer_count"), layer_count);
  gl_.Uniform4f(compositing_->uniform("background"), background.x, background.y, background.z, background.w);
  gl_.BindImageTexture(0, painted.texture(), 0, GL_TRUE, 0, GL_READ_ONLY, GL_RGBA32F);
  gl_.BindImageTexture(1, made->texture(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
  gl_.DispatchCompute(groupsAlong(size.width), groupsAlong(size.height), 1);
  gl_.MemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
  gl_.BindImageTexture(1, 0, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
  made->setDrawn(gl_.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0));
  gl_.Flush();  // else the fence might never be reached
  gl_.check("making the picture that is shown");
  return made;
}

}  // namespace curvisplat
