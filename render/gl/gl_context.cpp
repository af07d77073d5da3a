// Contexts, those of OSMesa, and the thread. EGL's contexts are in egl_context.cpp, since its headers define
// macros.
#include "render/gl/gl_context.h"

#include <GL/osmesa.h>
#include <dlfcn.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

std::string text(const GlFunctions& gl, GLenum name) {
  const auto* value = gl.GetString(name);
  return value ? reinterpret_cast<const char*>(value) : "unknown";
}

/// "4.5 (Core Profile) Mesa 22.3.6" -> "Mesa 22.3.6" and "4.5".
std::string describe(const std::string& library, const GlFunctions& gl) {
  std::istringstream words(text(gl, GL_VERSION));
  std::string version, word, driver;
  words >> version;
  while (words >> word) driver = word;
  return fmt::format("{} {}, {}, OpenGL {}", library, driver, text(gl, GL_RENDERER), version);
}

}  // namespace

bool isSoftwareRenderer(const std::string& renderer) {
  for (const char* name : {"llvmpipe", "softpipe", "SWR", "SwiftShader", "Software"})
    if (renderer.find(name) != std::string::npos) return true;
  return false;
}

GlContext::GlContext(const std::string& library, const GlFunctions::Lookup& lookup,
                     std::shared_ptr<SharedBin> shared)
    : functions_(lookup),
      name_(describe(library, functions_)),
      renderer_(text(functions_, GL_RENDERER)),
      software_(isSoftwareRenderer(renderer_)),
      shared_(std::move(shared)) {}

namespace {

struct OsMesa {
  decltype(&OSMesaCreateContextAttribs) create_context;
  decltype(&OSMesaDestroyContext) destroy_context;
  decltype(&OSMesaMakeCurrent) make_current;
  decltype(&OSMesaGetProcAddress) get_proc_address;
};

template <typename Function>
void fetch(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(library, name));
  if (!function) throw Error("the OSMesa library has no function {}; Mesa 11.2 or newer is needed", name);
}

/// The library is never closed: Mesa leaves threads and exit handlers behind.
OsMesa loadOsMesa() {
  std::string said;
  for (const char* name : {"libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"}) {
    void* library = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (!library) {
      said += fmt::format("{}{}", said.empty() ? "" : "; ", dlerror());
      continue;
    }
    OsMesa mesa{};
    fetch(library, "OSMesaCreateContextAttribs", mesa.create_context);
    fetch(library, "OSMesaDestroyContext", mesa.destroy_context);
    fetch(library, "OSMesaMakeCurrent", mesa.make_current);
    fetch(library, "OSMesaGetProcAddress", mesa.get_proc_address);
    return mesa;
  }
  throw Error("no OpenGL to draw with: OSMesa cannot be loaded ({}); install libosmesa6", said);
}

/// The context and the pixels that OSMesa wants to be given, though all drawing goes to a framebuffer
/// object.
class CurrentOsMesaContext {
 public:
  CurrentOsMesaContext() : mesa_(loadOsMesa()) {
    static constexpr int kAttributes[] = {OSMESA_FORMAT,
                                          OSMESA_RGBA,
                                          OSMESA_PROFILE,
                                          OSMESA_CORE_PROFILE,
                                          OSMESA_CONTEXT_MAJOR_VERSION,
                                          3,
                                          OSMESA_CONTEXT_MINOR_VERSION,
                                          3,
                                          0};
    context_ = mesa_.create_context(kAttributes, nullptr);
    if (!context_) throw Error("OSMesa cannot make an OpenGL 3.3 core context; Mesa 11.2 or newer is needed");
    if (!mesa_.make_current(context_, pixels_.data(), GL_UNSIGNED_BYTE, kSide, kSide)) {
      mesa_.destroy_context(context_);
      throw Error("OSMesa cannot make its context current on this thread");
    }
  }
  ~CurrentOsMesaContext() {
    mesa_.make_current(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    mesa_.destroy_context(context_);
  }
  CurrentOsMesaContext(const CurrentOsMesaContext&) = delete;
  CurrentOsMesaContext& operator=(const CurrentOsMesaContext&) = delete;

  void* lookUp(const char* name) const { return reinterpret_cast<void*>(mesa_.get_proc_address(name)); }

 private:
  static constexpr int kSide = 4;
  OsMesa mesa_;
  std::array<unsigned char, 4 * kSide * kSide> pixels_{};
  OSMesaContext context_ = nullptr;
};

// The first base makes the context current before the second one asks it for functions.
class OsMesaContext final : private CurrentOsMesaContext, public GlContext {
 public:
  OsMesaContext() : GlContext("OSMesa", [this](const char* name) { return lookUp(name); }) {}
};

}  // namespace

std::unique_ptr<GlContext> makeOsMesaContext() {
  return std::make_unique<OsMesaContext>();
}

namespace {

/// The folder that Mesa makes its own in, unless MESA_SHADER_CACHE_DIR names it.
std::filesystem::path folderOfMesasCache() {
  for (const char* const name : {"MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR", "XDG_CACHE_HOME"})
    if (const char* const folder = std::getenv(name); folder && *folder) return folder;
  const char* const home = std::getenv("HOME");
  return home ? std::filesystem::path(home) / ".cache" : std::filesystem::path();
}

/// True if that cannot be tried.
bool hasRoomForMesasCache() {
  constexpr uint64_t kBytes = uint64_t{4} << 20;  // its index takes 1.3 MB
  std::filesystem::path folder = folderOfMesasCache();
  std::error_code error;
  while (folder.has_relative_path() && !std::filesystem::exists(folder, error)) folder = folder.parent_path();
  return os::hasRoom(folder, kBytes);
}

}  // namespace

void keepMesaOffAFullDisk() {
  [[maybe_unused]] static const bool looked = [] {
    if (hasRoomForMesasCache()) return true;
    for (const char* const name : {"MESA_SHADER_CACHE_DISABLE", "MESA_GLSL_CACHE_DISABLE"})
      ::setenv(name, "true", 1);
    return true;
  }();
}

std::unique_ptr<GlContext> makeOffscreenContext(GlLibrary library) {
  return library == GlLibrary::kEgl ? makeEglContext() : makeOsMesaContext();
}

GlThread::GlThread(MakeContext make) : make_(std::move(make)) {
  keepMesaOffAFullDisk();
  const Job first = [this](const GlContext& context) {
    context_name_ = context.name();
    renderer_ = context.renderer();
    software_ = context.isSoftware();
  };
  job_ = &first;  // loop() makes the context before it runs a job
  thread_ = std::thread([this] { loop(); });
  MutexLock lock(mutex_);
  while (job_) changed_.wait(lock);
  if (!error_) return;
  lock.unlock();
  thread_.join();
  std::rethrow_exception(error_);
}

GlThread::~GlThread() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void GlThread::run(const Job& job) {
  MutexLock lock(mutex_);
  job_ = &job;
  changed_.notify_all();
  while (job_) changed_.wait(lock);
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void GlThread::loop() {
  nameThisThread("gl");
  std::unique_ptr<GlContext> context;
  MutexLock lock(mutex_);
  while (true) {
    while (!job_ && !stopping_) changed_.wait(lock);
    if (!job_) return;
    const Job& job = *job_;
    lock.unlock();
    std::exception_ptr error;
    try {
      if (!context) context = make_();
      job(*context);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    error_ = error;
    job_ = nullptr;
    changed_.notify_all();
    if (!context) return;
  }
}

}  // namespace curvisplat
