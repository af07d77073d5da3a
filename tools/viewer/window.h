// A window with an OpenGL context and Dear ImGui in it.
//
// All members are for the main thread, but for wake().
#pragma once

#include <deque>
#include <glm/vec2.hpp>
#include <memory>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/gl/gl_functions.h"

struct GLFWwindow;

namespace curvisplat {

/// What a window would get on this machine.
struct WindowReport {
  bool opens = false;
  std::string display;  // "X11 :0"; "none: ..."
  std::string glfw;     // its version, and what it was built for
  std::string found;    // as Window::contextName(); or why there is none
};
/// Opens a window that is not shown. The main thread, while there is no Window.
WindowReport examineWindow();

class Window {
 public:
  /// Opens it. Throws Error: no display, no OpenGL 3.3, and what GLFW says of it.
  Window(const std::string& title, ImageSize size);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  bool isOpen() const;
  void close();
  /// Waits for input, wake() or the time to pass.
  void wait(double seconds);
  /// Ends a wait(). Any thread, while the window lives.
  static void wake();

  /// Begins and ends a frame of Dear ImGui; the end shows it.
  void beginFrame();
  void endFrame(const glm::vec3& background);

  /// Of what is drawn, in pixels; {0, 0} while it is minimised.
  ImageSize pixels() const { return pixels_; }
  /// Pixels to a unit of Dear ImGui's and of the mouse.
  double pixelScale() const;

  struct Key {
    int code = 0;  // GLFW_KEY_...
    bool shift = false, control = false;
  };
  /// Keys pressed since the last call, but for those that a text field takes. None while clicks before them
  /// are still to be shown to Dear ImGui.
  std::vector<Key> takeKeys();
  /// Whether this frame of Dear ImGui has a click that may have come before keys.
  bool showsClick() const { return shows_click_; }
  /// Whether a key, a button or the wheel was used since the last call.
  bool takeInput();
  bool isDown(int key) const;

  /// Movement of the mouse with a button down that went down over the picture. Every event counts with the
  /// buttons of its own time, so that nothing is lost where frames are slow.
  struct Drag {
    int button = 0;  // GLFW_MOUSE_BUTTON_...
    bool shift = false;
    glm::dvec2 movement{0.0};  // pixels
  };
  std::vector<Drag> takeDrags();
  /// Notches of the wheel over the picture, away from the user.
  double takeWheel();
  /// Whether a drag is under way.
  bool isDragging() const { return dragged_button_ >= 0; }
  /// The picture is right of this: units of Dear ImGui.
  void setPictureLeft(double left) { picture_left_ = left; }

  void setClipboard(const std::string& text);
  const GlFunctions& gl() const { return *gl_; }
  /// "4.5 (Core Profile) Mesa 22.3.6, llvmpipe ..."
  const std::string& contextName() const { return context_name_; }

 private:
  static void onKey(GLFWwindow* window, int key, int scancode, int action, int mods);
  static void onButton(GLFWwindow* window, int button, int action, int mods);
  static void onMove(GLFWwindow* window, double x, double y);
  static void onWheel(GLFWwindow* window, double x, double y);
  static void onSize(GLFWwindow* window, int width, int height);
  static void onPixels(GLFWwindow* window, int width, int height);
  bool overPicture() const;
  void showInput();

  friend WindowReport examineWindow();
  struct Library;  // GLFW, from initialisation to termination
  std::unique_ptr<Library> library_;
  GLFWwindow* window_ = nullptr;
  std::unique_ptr<GlFunctions> gl_;
  std::string context_name_;
  // As GLFW told last: to ask it is to wait for the display, which may still have a frame to show.
  ImageSize pixels_{0, 0};
  int width_ = 0;  // in units of the mouse

  std::vector<Key> keys_;
  std::vector<int> fresh_keys_;          // pressed since the last frame of Dear ImGui
  std::vector<int> shown_keys_;          // that it was told are down in its last frame
  std::deque<glm::dvec2> mouse_events_;  // where buttons went down or up, for its frames to come
  bool shows_click_ = false;
  bool input_ = true;

  double picture_left_ = 0;
  glm::dvec2 mouse_{0.0};
  int dragged_button_ = -1;
  bool dragged_with_shift_ = false;
  std::vector<Drag> drags_;
  double wheel_ = 0;
};

}  // namespace curvisplat
