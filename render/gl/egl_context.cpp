#include "render/gl/gl_context.h"

#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

struct Egl {
  PFNEGLGETPROCADDRESSPROC get_proc_address;
  PFNEGLQUERYSTRINGPROC query_string;
  PFNEGLINITIALIZEPROC initialize;
  PFNEGLBINDAPIPROC bind_api;
  PFNEGLCHOOSECONFIGPROC choose_config;
  PFNEGLCREATECONTEXTPROC create_context;
  PFNEGLDESTROYCONTEXTPROC destroy_context;
  PFNEGLMAKECURRENTPROC make_current;
  PFNEGLGETERRORPROC get_error;
  PFNEGLGETPLATFORMDISPLAYEXTPROC get_platform_display;
  PFNEGLQUERYDEVICESEXTPROC query_devices;             // null: the library knows no devices
  PFNEGLQUERYDEVICESTRINGEXTPROC query_device_string;  // null: as above
};

/// Whether the list `extensions`, separated by blanks, has `name`.
bool has(const char* extensions, std::string_view name) {
  std::string_view list = extensions ? extensions : "";
  while (!list.empty()) {
    const std::string_view word = list.substr(0, list.find(' '));
    if (word == name) return true;
    list.remove_prefix(std::min(list.size(), word.size() + 1));
  }
  return false;
}

/// The library is never closed: drivers leave threads and exit handlers behind.
Egl loadEgl() {
  void* const library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
  if (!library) throw Error("EGL cannot be loaded ({}); install libegl1", dlerror());
  const auto fetch = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(dlsym(library, name));
    if (!function) throw Error("the EGL library has no function {}; EGL 1.4 or newer is needed", name);
  };
  Egl egl{};
  fetch(egl.get_proc_address, "eglGetProcAddress");
  fetch(egl.query_string, "eglQueryString");
  fetch(egl.initialize, "eglInitialize");
  fetch(egl.bind_api, "eglBindAPI");
  fetch(egl.choose_config, "eglChooseConfig");
  fetch(egl.create_context, "eglCreateContext");
  fetch(egl.destroy_context, "eglDestroyContext");
  fetch(egl.make_current, "eglMakeCurrent");
  fetch(egl.get_error, "eglGetError");
  const auto extension = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(egl.get_proc_address(name));
  };
  const char* const client = egl.query_string(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (has(client, "EGL_EXT_platform_base")) extension(egl.get_platform_display, "eglGetPlatformDisplayEXT");
  if (has(client, "EGL_EXT_platform_device") && has(client, "EGL_EXT_device_enumeration")) {
    extension(egl.query_devices, "eglQueryDevicesEXT");
    extension(egl.query_device_string, "eglQueryDeviceStringEXT");
  }
  if (!egl.get_platform_display)
    throw Error("the EGL library has no EGL_EXT_platform_base, which drawing without a window needs");
  return egl;
}

/// Somewhere to ask for a context.
struct Platform {
  std::string name;
  EGLenum platform;
  void* native;
};

bool listsDevices(const Egl& egl) {
  return egl.query_devices && egl.query_device_string;
}

std::vector<EGLDeviceEXT> devicesOf(const Egl& egl) {
  std::vector<EGLDeviceEXT> devices(64);
  EGLint count = 0;
  if (!listsDevices(egl) || !egl.query_devices(static_cast<EGLint>(devices.size()), devices.data(), &count))
    count = 0;
  devices.resize(static_cast<size_t>(count));
  return devices;
}

bool isSoftware(const Egl& egl, EGLDeviceEXT device) {
  return has(egl.query_device_string(device, EGL_EXTENSIONS), "EGL_MESA_device_software");
}

std::vector<Platform> platformsOf(const Egl& egl) {
  std::vector<Platform> cards, software;
  const std::vector<EGLDeviceEXT> devices = devicesOf(egl);
  for (size_t n = 0; n < devices.size(); ++n) {
    auto& list = isSoftware(egl, devices[n]) ? software : cards;
    list.push_back({fmt::format("device {}", n), EGL_PLATFORM_DEVICE_EXT, devices[n]});
  }
  std::vector<Platform> platforms = std::move(cards);
  if (has(egl.query_string(EGL_NO_DISPLAY, EGL_EXTENSIONS), "EGL_MESA_platform_surfaceless"))
    platforms.push_back({"surfaceless", EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY});
  platforms.insert(platforms.end(), software.begin(), software.end());
  return platforms;
}

/// The context, current, without a surface: all drawing goes to a framebuffer object.
class CurrentEglContext {
 public:
  CurrentEglContext() : egl_(loadEgl()) {
    std::string said;
    for (const Platform& platform : platformsOf(egl_)) {
      const std::string failure = tryPlatform(platform);
      if (failure.empty()) return;
      said += fmt::format("{}{}: {}", said.empty() ? "" : "; ", platform.name, failure);
    }
    throw Error("EGL cannot make an OpenGL 3.3 core context ({})",
                said.empty() ? "it found no device" : said);
  }
  /// The display stays initialised: it is the process's, and other contexts may use it.
  ~CurrentEglContext() {
    egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    egl_.destroy_context(display_, context_);
  }
  CurrentEglContext(const CurrentEglContext&) = delete;
  CurrentEglContext& operator=(const CurrentEglContext&) = delete;

  void* lookUp(const char* name) const { return reinterpret_cast<void*>(egl_.get_proc_address(name)); }
  /// "EGL device 0"
  const std::string& name() const { return name_; }

 private:
  /// Empty, or why it gives no context.
  std::string tryPlatform(const Platform& platform) {
    const auto failed = [&](const char* what) {
      return fmt::format("{} (0x{:04x})", what, egl_.get_error());
    };
    const EGLDisplay display = egl_.get_platform_display(platform.platform, platform.native, nullptr);
    if (display == EGL_NO_DISPLAY) return failed("no display");
    if (!egl_.initialize(display, nullptr, nullptr)) return failed("cannot be initialised");
    const char* const extensions = egl_.query_string(display, EGL_EXTENSIONS);
    if (!has(extensions, "EGL_KHR_surfaceless_context")) return "needs a surface to draw on";
    if (!egl_.bind_api(EGL_OPENGL_API)) return failed("has no OpenGL");

    static constexpr EGLint kConfig[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                                         EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = EGL_NO_CONFIG_KHR;
    EGLint configs = 0;
    if (!has(extensions, "EGL_KHR_no_config_context") &&
        (!egl_.choose_config(display, kConfig, &config, 1, &configs) || configs == 0))
      return failed("has no configuration for OpenGL");
    // Compute shaders come with 4.3.
    EGLContext context = EGL_NO_CONTEXT;
    for (const EGLint major : {4, 3})
      for (const bool tells_of_resets : {true, false})
        if (context == EGL_NO_CONTEXT) context = contextOf(display, config, major, tells_of_resets);
    if (context == EGL_NO_CONTEXT) return failed("no context");
    if (!egl_.make_current(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
      std::string failure = failed("its context cannot be made current");
      egl_.destroy_context(display, context);
      return failure;
    }
    display_ = display;
    context_ = context;
    name_ = "EGL " + platform.name;
    return {};
  }

  /// A core context of this version, dot 3, or EGL_NO_CONTEXT. Not all drivers can tell of a card that was reset.
  EGLContext contextOf(EGLDisplay display, EGLConfig config, EGLint major, bool tells_of_resets) const {
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                 major,
                                 EGL_CONTEXT_MINOR_VERSION,
                                 3,
                                 EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                 EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                 tells_of_resets ? EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY : EGL_NONE,
                                 EGL_LOSE_CONTEXT_ON_RESET,
                                 EGL_NONE};
    return egl_.create_context(display, config, EGL_NO_CONTEXT, attributes);
  }

  Egl egl_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
  std::string name_;
};

// The first base makes the context current before the second one asks it for functions.
class EglContext final : private CurrentEglContext, public GlContext {
 public:
  EglContext() : GlContext(CurrentEglContext::name(), [this](const char* name) { return lookUp(name); }) {}
};

}  // namespace

std::unique_ptr<GlContext> makeEglContext() {
  return std::make_unique<EglContext>();
}

bool eglMayHaveCard() {
  const Egl egl = loadEgl();
  if (!listsDevices(egl)) return true;
  const std::vector<EGLDeviceEXT> devices = devicesOf(egl);
  return std::any_of(devices.begin(), devices.end(),
                     [&](EGLDeviceEXT device) { return !isSoftware(egl, device); });
}

}  // namespace curvisplat
