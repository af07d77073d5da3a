// A window with an OpenGL context and Dear ImGui in it.
//
// All members are for the main thread, but for wake().
#pragma once

#include <glm/vec2.hpp>
#include <memory>
#include <string>
#include <vector>

#include "render/camera.h"
#include "render/gl_functions.h"

struct GLFWwindow;

namespace curvisplat {

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
  ImageSize pixels() const;
  /// Pixels to a unit of Dear ImGui's and of the mouse.
  double pixelScale() const;

  struct Key {
    int code = 0;  // GLFW_KEY_...
    bool shift = false, control = false;
  };
  /// Keys pressed since the last call, but for those that a text field takes.
  std::vector<Key> takeKeys();
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
  bool overPicture() const;

  struct Library;  // GLFW, from initialisation to termination
  std::unique_ptr<Library> library_;
  GLFWwindow* window_ = nullptr;
  std::unique_ptr<GlFunctions> gl_;
  std::string context_name_;
  std::vector<Key> keys_;

  double picture_left_ = 0;
  glm::dvec2 mouse_{0.0};
  int dragged_button_ = -1;
  bool dragged_with_shift_ = false;
  std::vector<Drag> drags_;
  double wheel_ = 0;
};

}  // namespace curvisplat
