#include "render/gl/gl_functions.h"

#include <string>

#include "render/project/painter_failure.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

std::string_view errorName(GLenum error) {
  switch (error) {
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_CONTEXT_LOST:
      return "the driver gave the context up";
    default:
      return "an unknown error";
  }
}

}  // namespace

GlFunctions::GlFunctions(const Lookup& lookup) {
#define CURVISPLAT_GL_FETCH(name, type)              \
  name = reinterpret_cast<type>(lookup("gl" #name)); \
  if (!name) throw Error("the OpenGL library has no function gl" #name "; OpenGL 3.3 or newer is needed");
  CURVISPLAT_GL_FUNCTIONS(CURVISPLAT_GL_FETCH)
#undef CURVISPLAT_GL_FETCH
#define CURVISPLAT_GL_FETCH(name, type) name = reinterpret_cast<type>(lookup("gl" #name));
  CURVISPLAT_GL_4_3_FUNCTIONS(CURVISPLAT_GL_FETCH)
#undef CURVISPLAT_GL_FETCH
  if (isAtLeast(4, 5))
    GetGraphicsResetStatus =
        reinterpret_cast<PFNGLGETGRAPHICSRESETSTATUSPROC>(lookup("glGetGraphicsResetStatus"));
}

bool GlFunctions::isAtLeast(int wanted_major, int wanted_minor) const {
  GLint major = 0, minor = 0;
  GetIntegerv(GL_MAJOR_VERSION, &major);
  GetIntegerv(GL_MINOR_VERSION, &minor);
  return major > wanted_major || (major == wanted_major && minor >= wanted_minor);
}

std::string GlFunctions::whyNoCompute() const {
  if (!isAtLeast(4, 3)) return "compute shaders need OpenGL 4.3";
#define CURVISPLAT_GL_HAS(name, type) \
  if (!name) return "this OpenGL has no gl" #name;
  CURVISPLAT_GL_4_3_FUNCTIONS(CURVISPLAT_GL_HAS)
#undef CURVISPLAT_GL_HAS
  return {};
}

void GlFunctions::check(std::string_view doing) const {
  const GLenum error = GetError();
  if (error == GL_OUT_OF_MEMORY)
    throw CardMemoryFailure(
        "OpenGL has no memory left for {}; give --backend cpu, or end what else uses the graphics card",
        doing);
  if (error != GL_NO_ERROR)
    throw PainterFailure("OpenGL failed while {}: {} (0x{:04x})", doing, errorName(error), error);
}

void GlFunctions::checkReset(std::string_view doing) const {
  if (GetGraphicsResetStatus && GetGraphicsResetStatus() != GL_NO_ERROR)
    throw PainterFailure("the graphics card was reset while {}", doing);
}

namespace {

/// The first line of what a driver says, which may be pages.
template <typename GetLog>
std::string firstLine(const GetLog& get_log, GLuint name) {
  std::string said(4096, '\0');
  GLsizei length = 0;
  get_log(name, static_cast<GLsizei>(said.size()), &length, said.data());
  said.resize(static_cast<size_t>(length));
  return said.substr(0, said.find('\n'));
}

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
    const std::string said = firstLine(gl_.GetShaderInfoLog, name_);
    gl_.DeleteShader(name_);
    const char* const word = kind == GL_VERTEX_SHADER     ? "vertex"
                             : kind == GL_FRAGMENT_SHADER ? "fragment"
                                                          : "compute";
    throw PainterFailure("OpenGL cannot compile the {} shader: {}", word, said);
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
  link();
}

GlProgram::GlProgram(const GlFunctions& gl, std::string_view compute_source) : gl_(&gl) {
  const Shader compute(gl, GL_COMPUTE_SHADER, compute_source);
  name_ = gl.CreateProgram();
  gl.AttachShader(name_, compute.name());
  link();
}

void GlProgram::link() {
  gl_->LinkProgram(name_);
  GLint linked = 0;
  gl_->GetProgramiv(name_, GL_LINK_STATUS, &linked);
  if (linked) return;
  const std::string said = firstLine(gl_->GetProgramInfoLog, name_);
  gl_->DeleteProgram(name_);
  throw PainterFailure("OpenGL cannot link the shaders: {}", said);
}

GlProgram::~GlProgram() {
  if (name_) gl_->DeleteProgram(name_);
}

void GlTimers::finish() {
  for (const Running& running : running_) {
    GLuint64 nanoseconds = 0;
    gl_.GetQueryObjectui64v(running.query.name(), GL_QUERY_RESULT, &nanoseconds);
    seconds_[running.kind] += 1e-9 * static_cast<double>(nanoseconds);
  }
  running_.clear();
}

void GlTimers::reset() {
  running_.clear();
  seconds_.assign(seconds_.size(), 0);
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
