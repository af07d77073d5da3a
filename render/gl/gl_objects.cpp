#include "render/gl/gl_objects.h"

#include <string>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

class Shader {
 public:
  Shader(const GlFunctions& gl, GLenum kind, std::string_view source)
      : gl_(gl), name_(gl.CreateShader(kind)) {
    const char* text = source.data();
    const auto length = static_cast<GLint>(source.size());
    gl_.ShaderSource(name_, 1, &text, &length);
    gl_.CompileShader(name_);
    GLint compiled = 0;
    gl_.GetShaderiv(name_, GL_COMPILE_STATUS, &compiled);
    if (compiled) return;
    std::string said(4096, '\0');
    GLsizei said_length = 0;
    gl_.GetShaderInfoLog(name_, static_cast<GLsizei>(said.size()), &said_length, said.data());
    said.resize(static_cast<size_t>(said_length));
    gl_.DeleteShader(name_);
    throw Error("OpenGL cannot compile the {} shader: {}", kind == GL_VERTEX_SHADER ? "vertex" : "fragment",
                said);
  }
  ~Shader() { gl_.DeleteShader(name_); }
  Shader(const Shader&) = delete;
  Shader& operator=(const Shader&) = delete;
  GLuint name() const { return name_; }

 private:
  const GlFunctions& gl_;
  GLuint name_;
};

}  // namespace

GlProgram::GlProgram(const GlFunctions& gl, std::string_view vertex_source, std::string_view fragment_source)
    : gl_(&gl) {
  const Shader vertex(gl, GL_VERTEX_SHADER, vertex_source), fragment(gl, GL_FRAGMENT_SHADER, fragment_source);
  name_ = gl.CreateProgram();
  gl.AttachShader(name_, vertex.name());
  gl.AttachShader(name_, fragment.name());
  gl.LinkProgram(name_);
  GLint linked = 0;
  gl.GetProgramiv(name_, GL_LINK_STATUS, &linked);
  if (linked) return;
  std::string said(4096, '\0');
  GLsizei length = 0;
  gl.GetProgramInfoLog(name_, static_cast<GLsizei>(said.size()), &length, said.data());
  said.resize(static_cast<size_t>(length));
  gl.DeleteProgram(name_);
  throw Error("OpenGL cannot link the shaders: {}", said);
}

GlProgram::~GlProgram() {
  if (name_) gl_->DeleteProgram(name_);
}

void GlFence::wait() const {
  constexpr GLuint64 kNanoseconds = 1'000'000'000;
  GLenum result;
  do {
    result = gl_->ClientWaitSync(sync_, GL_SYNC_FLUSH_COMMANDS_BIT, kNanoseconds);
  } while (result == GL_TIMEOUT_EXPIRED);
  if (result == GL_WAIT_FAILED) gl_->check("waiting for a fence");
}

}  // namespace curvisplat
