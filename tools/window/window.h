// A window with an OpenGL context and Dear ImGui, and a texture that shows a picture in it.
//
// Everything except Window::wake() is for the main thread. A frame is shown only if it looks different from
// the one before; a checksum of its drawing commands tells.
#pragma once

#include <glm/vec2.hpp>

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "render/camera/camera.h"
#include "render/gl/card_picture.h"
#include "render/gl/gl_context.h"
#include "render/gl/gl_functions.h"
#include "render/image/image.h"

struct GLFWwindow;

namespace curvisplat {

class SharedContext;

/// A rectangle in Dear ImGui units, from the upper left corner.
struct Rectangle {
  double x = 0, y = 0, width = 0, height = 0;
  bool contains(const glm::dvec2& point) const {
    return point.x >= x && point.y >= y && point.x < x + width && point.y < y + height;
  }
};

/// The window system of this machine, for `info --system`.
struct WindowReport {
  bool opens = false;
  std::string display;  // "X11 :0"; "none: ..."
  std::string glfw;     // GLFW's version string
  std::string found;    // as Window::contextName(), or why no window opens
};
/// Opens a hidden window. Call on the main thread while no Window exists.
WindowReport examineWindow();

class Window {
 public:
  /// Throws Error with GLFW's message if there is no display or no OpenGL 3.3.
  Window(const std::string& title, ImageSize size);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  bool isOpen() const;
  void close();
  /// Waits for input, wake() or at most `seconds`.
  void wait(double seconds);
  /// Ends a wait(). Any thread, during the window's lifetime.
  static void wake();

  /// Begins and ends a Dear ImGui frame; endFrame() shows it if it looks different from the one that is
  /// shown.
  void beginFrame();
  /// Closes what an exception has left open of this frame's windows, menus and lists.
  void closeWidgets();
  /// `next_is_near`: another one follows in a moment, with a new picture. Then this one is left out, for 0.1
  /// s at most.
  void endFrame(const glm::vec3& background, bool next_is_near);
  /// The contents of a texture have changed: shows the next frame in any case.
  void redraw() { shown_.reset(); }

  /// Size of the contents in pixels; {0, 0} while the window is minimised.
  ImageSize pixels() const { return pixels_; }
  /// Pixels per unit of Dear ImGui and of the mouse position.
  double pixelScale() const;

  struct Key {
    int code = 0;  // GLFW_KEY_... or kQuestionMark
    bool shift = false, control = false;
  };
  static constexpr int kQuestionMark = -'?';  // which is on another key in each country
  /// Keys that Dear ImGui has been shown since the last call, so that all earlier clicks and letters have
  /// had their effect. While text is typed, only F1 and those with Control that do not edit.
  std::vector<Key> takeKeys();
  /// Holds keys and clicks back until after Dear ImGui's next frame, for a text field that gets the focus
  /// only then.
  void holdInput() { holds_input_ = true; }
  /// Whether a key, a button, the mouse or the wheel was used since the last call.
  bool takeInput();
  /// Whether a key is held that was pressed without Control.
  bool isDown(int key) const;

  /// Movement of the mouse while a button is down that was pressed over the picture. Recorded per event with
  /// the buttons at that time, so that slow frames lose nothing.
  struct Drag {
    int button = 0;  // GLFW_MOUSE_BUTTON_...
    bool shift = false;
    glm::dvec2 movement{0.0};  // pixels
  };
  std::vector<Drag> takeDrags();
  /// Wheel notches over the picture since the last call; positive away from the user.
  double takeWheel();
  /// The mouse in pixels from the picture's upper left corner.
  glm::dvec2 mouseInPicture() const { return pixelScale() * (mouse_ - glm::dvec2(picture_.x, picture_.y)); }
  /// Whether a drag is in progress.
  bool isDragging() const { return dragged_button_ >= 0; }
  /// Sets where the picture is, in Dear ImGui units.
  void setPicture(const Rectangle& place) { picture_ = place; }
  /// Keeps clicks and drags that begin in this rectangle from the picture under it: call in every frame that
  /// it is there.
  void cover(const Rectangle& place) { covers_.push_back(place); }
  /// Keeps those in the current Dear ImGui window from the picture.
  void coverCurrent();
  /// Clicks of the left button on the picture without a movement, since the last call; Dear ImGui units.
  std::vector<glm::dvec2> takeClicks() { return std::exchange(clicks_, {}); }
  /// The mouse, if it is over the picture and no button is down.
  std::optional<glm::dvec2> pointed() const;
  /// Paths of files dropped on the window since the last call.
  std::vector<std::string> takeDropped() { return std::exchange(dropped_, {}); }

  /// Height of a line of text, without the space between lines, in Dear ImGui units.
  float textHeight() const { return text_height_; }
  /// Size of the same font, as Cairo counts it: text is higher than its letters are large.
  double fontSize() const { return static_cast<double>(text_height_) / kTextHeight; }
  /// Height of a menu bar: a line with the space that a widget has around it.
  double lineHeight() const { return line_height_; }
  void setTitle(const std::string& title);
  /// Scales text and widgets by 0.5 to 4 times what the display asks for. Call it between frames.
  void setTextScale(double scale);
  void setLightTheme(bool light);

  void setClipboard(const std::string& text);
  const GlFunctions& gl() const { return *gl_; }
  /// Lends a second context to a painter, whose pictures are then shown without a copy. `wants_context`:
  /// makes it now, on the main thread. If that fails, GlSharing::makeContext() throws the reason.
  GlSharing& sharing(bool wants_context);
  /// Whether the processor draws the window.
  bool isSoftware() const;
  /// "4.5 (Core Profile) Mesa 22.3.6, llvmpipe ..."
  const std::string& contextName() const { return context_name_; }

 private:
  static constexpr double kTextHeight = 1.164;  // of DejaVu Sans, ascent and descent, in its size

  static void onKey(GLFWwindow* window, int key, int scancode, int action, int mods);
  static void onButton(GLFWwindow* window, int button, int action, int mods);
  static void onMove(GLFWwindow* window, double x, double y);
  static void onWheel(GLFWwindow* window, double x, double y);
  static void onSize(GLFWwindow* window, int width, int height);
  static void onPixels(GLFWwindow* window, int width, int height);
  static void onRefresh(GLFWwindow* window);
  static void onLetter(GLFWwindow* window, unsigned letter);
  static void onDrop(GLFWwindow* window, int count, const char** paths);
  bool overPicture() const;
  void showInput();
  void showButton();
  void showTyped();
  void applyLook();

  friend WindowReport examineWindow();
  struct Library;  // initialises and terminates GLFW
  std::unique_ptr<Library> library_;
  GLFWwindow* window_ = nullptr;
  std::unique_ptr<GlFunctions> gl_;
  std::unique_ptr<SharedContext> shared_;
  std::string context_name_;
  // The size as of GLFW's last callback: querying would wait for the display, which may still be showing a
  // frame.
  ImageSize pixels_{0, 0};
  int width_ = 0;  // in units of the mouse

  std::vector<Key> keys_;
  std::set<int> with_control_;    // that are down, and were pressed so
  bool repeats_command_ = false;  // the key whose letter comes next
  /// A key that was pressed, a letter that it wrote, or a button of the mouse.
  struct Event {
    int key = -1;
    unsigned letter = 0;
    int button = -1;
    bool presses = false;        // the button; else it was released
    int modifiers = 0;           // GLFW_MOD_..., of a button
    glm::dvec2 at{0.0};          // the mouse then
    std::optional<Key> command;  // that the key may be

    static Event ofKey(int key, std::optional<Key> command = {}) {
      return {key, 0, -1, false, 0, {}, command};
    }
    static Event ofLetter(unsigned letter) { return {-1, letter, -1, false, 0, {}, {}}; }
    static Event ofButton(int button, bool presses, int modifiers, const glm::dvec2& at) {
      return {-1, 0, button, presses, modifiers, at, {}};
    }
  };
  std::deque<Event> events_;             // what Dear ImGui has yet to see, in order
  std::vector<int> shown_keys_;          // reported as down in its last frame
  std::array<bool, 5> shown_buttons_{};  // as Dear ImGui knows them
  glm::vec2 shown_mouse_{0.0f};          // where it was in Dear ImGui's last frame
  bool holds_input_ = false;
  bool input_ = true;
  std::optional<double> left_out_since_s_;  // by GLFW's clock
  std::optional<uint64_t> shown_;           // appearanceOf() the frame that is shown; none: draw it again

  Rectangle picture_;
  std::vector<Rectangle> covers_, last_covers_;  // of the frame that is being made, and of the last one
  std::vector<glm::dvec2> clicks_;
  std::vector<std::string> dropped_;
  float text_height_ = 0;
  double line_height_ = 0;
  double text_scale_ = 1, content_scale_ = 1;
  bool light_ = false;
  glm::dvec2 mouse_{0.0}, pressed_at_{0.0};
  int dragged_button_ = -1;
  bool press_closes_ = false;  // a list or a menu, which is all that this press is for
  bool dragged_with_shift_ = false;
  std::vector<Drag> drags_;
  double wheel_ = 0;
};

/// An OpenGL texture, 8 bits per channel, that shows a picture in the window: its own, or that of a picture that stays on
/// the card. Use it on the context's thread; destroy or release() it before the context. Interpolates linearly when stretched.
class PictureTexture {
 public:
  explicit PictureTexture(const GlFunctions& gl);
  ~PictureTexture() { release(); }
  /// Deletes the texture. Then only the destructor may be called, on any thread.
  void release();
  PictureTexture(const PictureTexture&) = delete;
  PictureTexture& operator=(const PictureTexture&) = delete;

  /// Uploads a picture: red, green, blue, alpha per pixel, not premultiplied; rows from the top.
  void set(std::span<const uint8_t> rgba, ImageSize size);
  /// Shows the texture of a picture that was drawn in a context of Window::sharing().
  void show(std::shared_ptr<const CardPicture> picture);

  /// Both are of one context.
  void swap(PictureTexture& other) {
    std::swap(texture_, other.texture_);
    std::swap(size_, other.size_);
    on_card_.swap(other.on_card_);
  }
  bool isEmpty() const { return size_.width == 0; }
  ImageSize size() const { return size_; }
  /// Texture identifier for Dear ImGui.
  void* id() const {
    return reinterpret_cast<void*>(static_cast<uintptr_t>(on_card_ ? on_card_->texture() : texture_));
  }

 private:
  const GlFunctions& gl_;
  GLuint texture_ = 0;
  ImageSize size_{0, 0};
  std::shared_ptr<const CardPicture> on_card_;  // null: the texture is shown
};

}  // namespace curvisplat
