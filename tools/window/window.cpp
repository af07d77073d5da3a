#include "tools/window/window.h"

#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>
#include <imgui_internal.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "render/gl/gl_context.h"
#include "stream/base/error.h"
#include "tools/window/keyboard_focus.h"
#include "tools/window/theme.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

constexpr double kLongestWaitSeconds = 0.1;  // for a picture that is near
constexpr double kClickReach = 4;            // a button that moves further than this drags

thread_local std::string last_glfw_error;  // of this thread's calls

void onError(int, const char* description) {
  last_glfw_error = description ? description : "";
}

}  // namespace

struct Window::Library {
  Library() {
    keepMesaOffAFullDisk();
    glfwSetErrorCallback(onError);
    if (!glfwInit())
      throw Error(
          "cannot open a window: {}; on a machine without a display, draw pictures with curvisplat render",
          last_glfw_error);
  }
  ~Library() { glfwTerminate(); }
};

namespace {

/// Makes a window with a core context of OpenGL `major`.3 or newer, which shares textures with that of `shared`, if there is
/// one. Null, and last_glfw_error says why, if there is none.
GLFWwindow* makeWindow(const char* title, ImageSize size, bool visible, int major,
                       GLFWwindow* shared = nullptr) {
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, major);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  glfwWindowHint(GLFW_VISIBLE, visible ? GLFW_TRUE : GLFW_FALSE);
  return glfwCreateWindow(size.width, size.height, title, nullptr, shared);
}

/// Opens a window with OpenGL 3.3 or newer and makes its context current. Throws Error.
GLFWwindow* openWindow(const char* title, ImageSize size, bool visible) {
  GLFWwindow* const window = makeWindow(title, size, visible, 3);
  if (!window)
    throw Error(
        "cannot open a window: {}; it needs OpenGL 3.3 (from a graphics driver or Mesa's libgl1-mesa-dri)",
        last_glfw_error);
  glfwMakeContextCurrent(window);
  return window;
}

GlFunctions glOfCurrentContext() {
  return GlFunctions([](const char* name) { return reinterpret_cast<void*>(glfwGetProcAddress(name)); });
}

std::string glText(const GlFunctions& gl, GLenum name) {
  return reinterpret_cast<const char*>(gl.GetString(name));
}

std::string nameOf(const GlFunctions& gl) {
  return fmt::format("{}, {}", glText(gl, GL_VERSION), glText(gl, GL_RENDERER));
}

std::string displayName() {
  const auto valueOf = [](const char* name) {
    const char* const value = std::getenv(name);
    return std::string(value ? value : "");
  };
  if (const std::string x11 = valueOf("DISPLAY"); !x11.empty()) return "X11 " + x11;
  if (const std::string wayland = valueOf("WAYLAND_DISPLAY"); !wayland.empty()) return "Wayland " + wayland;
  return "none (neither DISPLAY nor WAYLAND_DISPLAY is set)";
}

}  // namespace

/// The context of a hidden window, which shares textures with the window's. GLFW makes and removes both on the main thread; a
/// painter's thread borrows the context.
class SharedContext final : public GlSharing {
 public:
  explicit SharedContext(std::string renderer) : renderer_(std::move(renderer)) {}
  ~SharedContext() override {
    if (hidden_) glfwDestroyWindow(hidden_);
  }
  SharedContext(const SharedContext&) = delete;
  SharedContext& operator=(const SharedContext&) = delete;

  /// Makes the hidden window, once. On the main thread, before makeContext().
  void prepare(GLFWwindow* window) {
    if (std::exchange(is_prepared_, true)) return;
    hidden_ = makeWindow("", {1, 1}, false, 4, window);
    if (!hidden_) why_none_ = last_glfw_error;
  }
  const std::string& renderer() const override { return renderer_; }
  std::unique_ptr<GlContext> makeContext() override {
    if (!hidden_) throw Error("no second context for the window: {}", why_none_);
    if (is_lent_.exchange(true)) throw Error("the window's second context is in use");
    auto lent = std::make_unique<Lent>(*this);
    if (!lent->isCurrent()) throw Error("the window's second context cannot be used: {}", last_glfw_error);
    return std::make_unique<Context>(std::move(lent), bin_);
  }

 private:
  /// The context while it is current on a painter's thread.
  struct Lent {
    explicit Lent(SharedContext& of) : owner(of) { glfwMakeContextCurrent(owner.hidden_); }
    bool isCurrent() const { return glfwGetCurrentContext() == owner.hidden_; }
    ~Lent() {
      glfwMakeContextCurrent(nullptr);
      owner.is_lent_ = false;
    }
    Lent(const Lent&) = delete;
    Lent& operator=(const Lent&) = delete;
    SharedContext& owner;
  };
  struct HasLent {
    std::unique_ptr<Lent> lent;
  };
  // The first base gives the context back after the second one has ended.
  class Context final : private HasLent, public GlContext {
   public:
    Context(std::unique_ptr<Lent> lent, std::shared_ptr<SharedBin> bin)
        : HasLent{std::move(lent)},
          GlContext(
              "the window's",
              [](const char* name) { return reinterpret_cast<void*>(glfwGetProcAddress(name)); },
              std::move(bin)) {}
  };

  const std::string renderer_;
  bool is_prepared_ = false;
  GLFWwindow* hidden_ = nullptr;
  std::string why_none_;
  std::atomic<bool> is_lent_ = false;
  const std::shared_ptr<SharedBin> bin_ = std::make_shared<SharedBin>();
};

WindowReport examineWindow() {
  WindowReport report;
  report.display = displayName();
  report.glfw = glfwGetVersionString();
  try {
    const Window::Library library;
    GLFWwindow* const window = openWindow("curvisplat", {64, 64}, false);
    report.found = nameOf(glOfCurrentContext());
    report.opens = true;
    glfwDestroyWindow(window);
  } catch (const Error& error) {
    report.found = error.what();
  }
  return report;
}

Window::Window(const std::string& title, ImageSize size) : library_(std::make_unique<Library>()) {
  window_ = openWindow(title.c_str(), size, true);
  glfwSwapInterval(1);
  gl_ = std::make_unique<GlFunctions>(glOfCurrentContext());
  context_name_ = nameOf(*gl_);
  shared_ = std::make_unique<SharedContext>(glText(*gl_, GL_RENDERER));
  glfwSetWindowUserPointer(window_, this);
  // Dear ImGui installs its callbacks later and calls these from them.
  glfwSetKeyCallback(window_, onKey);
  glfwSetMouseButtonCallback(window_, onButton);
  glfwSetCursorPosCallback(window_, onMove);
  glfwSetScrollCallback(window_, onWheel);
  glfwSetWindowSizeCallback(window_, onSize);
  glfwSetFramebufferSizeCallback(window_, onPixels);
  glfwSetWindowRefreshCallback(window_, onRefresh);
  glfwSetCharCallback(window_, onLetter);
  glfwSetDropCallback(window_, onDrop);
  int height = 0;
  glfwGetWindowSize(window_, &width_, &height);
  glfwGetFramebufferSize(window_, &pixels_.width, &pixels_.height);
  glfwGetCursorPos(window_, &mouse_.x, &mouse_.y);

  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;
  ImGui::GetIO().MouseDoubleClickTime = 0.5f;  // seconds, as desktops have it
  float scale_x = 1, scale_y = 1;
  glfwGetWindowContentScale(window_, &scale_x, &scale_y);
  content_scale_ = static_cast<double>(scale_x);
  ImGui_ImplGlfw_InitForOpenGL(window_, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
  applyLook();
}

/// Applies theme and scale. If the window system counts the mouse in larger units than pixels, the content's
/// scale is in them already.
void Window::applyLook() {
  constexpr double kTextPixels = 14;  // at scale 1
  const double units = std::max(0.5, content_scale_ / pixelScale() * text_scale_);
  text_height_ = static_cast<float>(std::lround(kTextPixels * units));
  ImGuiStyle style;
  setTheme(style, light_);
  style.WindowRounding = style.FrameRounding = style.PopupRounding = style.GrabRounding = 3;
  style.WindowBorderSize = 0;
  if (light_) style.FrameBorderSize = 1;
  style.ScaleAllSizes(static_cast<float>(units));
  ImGui::GetStyle() = style;
  line_height_ = static_cast<double>(text_height_ + 2 * style.FramePadding.y);
  loadFont(static_cast<float>(text_height_ * pixelScale()), static_cast<float>(pixelScale()));
  ImGui_ImplOpenGL3_DestroyFontsTexture();
  ImGui_ImplOpenGL3_CreateFontsTexture();
  redraw();
}

void Window::setTitle(const std::string& title) {
  glfwSetWindowTitle(window_, title.c_str());
}

void Window::setTextScale(double scale) {
  text_scale_ = std::clamp(scale, 0.5, 4.0);
  applyLook();
}

void Window::setLightTheme(bool light) {
  light_ = light;
  applyLook();
}

Window::~Window() {
  ImGui_ImplOpenGL3_Shutdown();
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
  shared_.reset();
  glfwDestroyWindow(window_);
}

GlSharing& Window::sharing(bool wants_context) {
  if (wants_context) shared_->prepare(window_);
  return *shared_;
}

bool Window::isSoftware() const {
  return isSoftwareRenderer(shared_->renderer());
}

bool Window::isOpen() const {
  return !glfwWindowShouldClose(window_);
}

void Window::close() {
  glfwSetWindowShouldClose(window_, GLFW_TRUE);
}

void Window::wait(double seconds) {
  if (seconds > 0)
    glfwWaitEventsTimeout(seconds);
  else
    glfwPollEvents();
}

void Window::wake() {
  glfwPostEmptyEvent();
}

/// Dear ImGui samples keys and mouse once per frame: gives it what happened between two frames in its order,
/// a button event in a frame of its own and at the position where it happened.
void Window::showInput() {
  ImGuiIO& io = ImGui::GetIO();
  for (const int key : shown_keys_) io.KeysDown[key] = glfwGetKey(window_, key) == GLFW_PRESS;
  shown_keys_.clear();
  io.InputQueueCharacters.clear();  // they are in events_
  for (const Event& event : events_)
    if (event.key >= 0) io.KeysDown[event.key] = false;
  const bool clicks = !events_.empty() && events_.front().button >= 0;
  const int modifiers = clicks && !holds_input_ ? events_.front().modifiers : 0;
  if (!std::exchange(holds_input_, false)) clicks ? showButton() : showTyped();
  // A click has Control and Shift as they were when it happened: a slow frame may come after their release.
  io.KeyCtrl = (modifiers & GLFW_MOD_CONTROL) != 0 || io.KeysDown[GLFW_KEY_LEFT_CONTROL] ||
               io.KeysDown[GLFW_KEY_RIGHT_CONTROL];
  io.KeyShift = (modifiers & GLFW_MOD_SHIFT) != 0 || io.KeysDown[GLFW_KEY_LEFT_SHIFT] ||
                io.KeysDown[GLFW_KEY_RIGHT_SHIFT];
  std::copy(shown_buttons_.begin(), shown_buttons_.end(), io.MouseDown);
  shown_mouse_ = {io.MousePos.x, io.MousePos.y};
}

/// Ends a drag where the button was released: a slow frame may not have shown the mouse there before.
void Window::showButton() {
  const Event event = events_.front();
  ImGui::GetIO().MousePos = {static_cast<float>(event.at.x), static_cast<float>(event.at.y)};
  if (!event.presses && glm::vec2(event.at) != shown_mouse_) return;  // the release is for the next frame
  events_.pop_front();
  shown_buttons_[static_cast<size_t>(event.button)] = event.presses;
}

/// Dear ImGui takes all keys of a frame before its letters, and no letters with Control. So letters after
/// Control, other keys after letters, a click after either, and all after a key with Control wait for the
/// next frame. What follows Tab waits for one more, in which the next field gets the focus.
void Window::showTyped() {
  ImGuiIO& io = ImGui::GetIO();
  const auto isControl = [](int key) {
    return key == GLFW_KEY_LEFT_CONTROL || key == GLFW_KEY_RIGHT_CONTROL;
  };
  bool letters = false, control = false;
  while (!events_.empty() && events_.front().button < 0) {
    const Event next = events_.front();
    const bool writes = events_.size() > 1 && events_[1].letter != 0;  // the key of a letter
    if (next.letter != 0 || writes ? control : letters) break;
    events_.pop_front();
    if (next.letter != 0) {
      io.AddInputCharacter(next.letter);
      if (next.letter == '?') keys_.push_back({kQuestionMark});
      letters = true;
      continue;
    }
    io.KeysDown[next.key] = true;
    shown_keys_.push_back(next.key);
    control |= isControl(next.key);
    holds_input_ = next.key == GLFW_KEY_TAB;
    if (holds_input_) break;
    if (!next.command) continue;
    keys_.push_back(*next.command);
    if (next.command->control && !isControl(next.key)) break;  // it may open a dialog, for which the rest is
  }
}

void Window::beginFrame() {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  showInput();
  ImGui::NewFrame();
  keyboardFocus().beginFrame(shown_keys_);
}

void Window::coverCurrent() {
  const ImVec2 at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
  cover({at.x, at.y, size.x, size.y});
}

std::optional<glm::dvec2> Window::pointed() const {
  if (isDragging() || !overPicture()) return std::nullopt;
  return mouse_;
}

void Window::closeWidgets() {
  ImGui::ErrorCheckEndFrameRecover(nullptr);
}

void Window::endFrame(const glm::vec3& background, bool next_is_near) {
  ImGui::Render();
  last_covers_ = std::exchange(covers_, {});
  // By OpenGL in software, drawing takes as long as a picture of moving data does.
  const uint64_t appearance = appearanceOf(*ImGui::GetDrawData());
  if (shown_ == appearance) return;
  if (shown_ && next_is_near) {
    if (!left_out_since_s_) left_out_since_s_ = glfwGetTime();
    if (glfwGetTime() - *left_out_since_s_ < kLongestWaitSeconds) return;
  }
  left_out_since_s_.reset();
  shown_ = appearance;
  const ImageSize size = pixels();
  gl_->Viewport(0, 0, size.width, size.height);
  gl_->ClearColor(background.x, background.y, background.z, 1);
  gl_->Clear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(window_);
}

double Window::pixelScale() const {
  return width_ > 0 ? static_cast<double>(pixels_.width) / width_ : 1;
}

void Window::onSize(GLFWwindow* window, int width, int) {
  static_cast<Window*>(glfwGetWindowUserPointer(window))->width_ = width;
}

void Window::onPixels(GLFWwindow* window, int width, int height) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->pixels_ = {width, height};
  self->redraw();
}

void Window::onRefresh(GLFWwindow* window) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->input_ = true;
  self->redraw();
}

void Window::onKey(GLFWwindow* window, int key, int, int action, int mods) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->input_ = true;
  if (action == GLFW_RELEASE) self->with_control_.erase(key);
  self->repeats_command_ = action == GLFW_REPEAT && self->with_control_.contains(key);
  if (action != GLFW_PRESS) return;
  if (mods & GLFW_MOD_CONTROL) self->with_control_.insert(key);
  if (key < 0) return;  // some keys have no GLFW code
  // Control and Shift as they were when the key was pressed: a slow frame may come after their release.
  const bool shift = (mods & GLFW_MOD_SHIFT) != 0, control = (mods & GLFW_MOD_CONTROL) != 0;
  if (control) self->events_.push_back(Event::ofKey(GLFW_KEY_LEFT_CONTROL));
  if (shift) self->events_.push_back(Event::ofKey(GLFW_KEY_LEFT_SHIFT));
  self->events_.push_back(Event::ofKey(key, Key{key, shift, control}));
}

std::vector<Window::Key> Window::takeKeys() {
  std::vector<Key> keys = std::exchange(keys_, {});
  const auto edits = [](const Key& key) {
    if (key.code == GLFW_KEY_F1) return false;
    if (!key.control) return true;
    return std::string_view("ACVXYZ").find(static_cast<char>(key.code)) != std::string_view::npos;
  };
  if (ImGui::GetIO().WantTextInput) std::erase_if(keys, edits);
  if (ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup))  // arrows choose in a list
    std::erase_if(keys, [](const Key& key) { return key.code >= GLFW_KEY_RIGHT && key.code <= GLFW_KEY_UP; });
  if (keyboardFocus().isShown())
    std::erase_if(keys, [](const Key& key) { return key.code == GLFW_KEY_SPACE; });
  return keys;
}

void Window::onLetter(GLFWwindow* window, unsigned letter) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->input_ = true;
  // A key that is held longer than Control would write into the dialog that it has opened.
  if (letter != 0 && !self->repeats_command_) self->events_.push_back(Event::ofLetter(letter));
}

void Window::onDrop(GLFWwindow* window, int count, const char** paths) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->input_ = true;
  self->dropped_.insert(self->dropped_.end(), paths, paths + count);
}

bool Window::takeInput() {
  return std::exchange(input_, false) || !events_.empty();
}

bool Window::overPicture() const {
  return picture_.contains(mouse_) &&
         std::none_of(last_covers_.begin(), last_covers_.end(),
                      [this](const Rectangle& cover) { return cover.contains(mouse_); });
}

void Window::onButton(GLFWwindow* window, int button, int action, int mods) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->input_ = true;
  if (button < static_cast<int>(self->shown_buttons_.size()))
    self->events_.push_back(Event::ofButton(button, action == GLFW_PRESS, mods, self->mouse_));
  if (action == GLFW_PRESS && !self->isDragging()) {
    // mouse_ is still the position of this event.
    if (!self->overPicture()) return;
    self->dragged_button_ = button;
    self->dragged_with_shift_ = (mods & GLFW_MOD_SHIFT) != 0;
    self->pressed_at_ = self->mouse_;
    self->press_closes_ = ImGui::IsPopupOpen(nullptr, ImGuiPopupFlags_AnyPopup);
  } else if (action == GLFW_RELEASE && button == self->dragged_button_) {
    self->dragged_button_ = -1;
    const bool stayed = glm::length(self->mouse_ - self->pressed_at_) < kClickReach;
    if (stayed && button == GLFW_MOUSE_BUTTON_LEFT && !self->dragged_with_shift_ && !self->press_closes_)
      self->clicks_.push_back(self->mouse_);
  }
}

void Window::onMove(GLFWwindow* window, double x, double y) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  const glm::dvec2 movement = self->pixelScale() * (glm::dvec2(x, y) - self->mouse_);
  self->mouse_ = {x, y};
  self->input_ = true;  // menus follow the mouse in the frames after its last movement
  if (self->isDragging())
    self->drags_.push_back({self->dragged_button_, self->dragged_with_shift_, movement});
}

void Window::onWheel(GLFWwindow* window, double, double y) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->input_ = true;
  if (self->overPicture()) self->wheel_ += y;
}

std::vector<Window::Drag> Window::takeDrags() {
  return std::exchange(drags_, {});
}

double Window::takeWheel() {
  return std::exchange(wheel_, 0.0);
}

bool Window::isDown(int key) const {
  return !ImGui::GetIO().WantTextInput && !with_control_.contains(key) &&
         glfwGetKey(window_, key) == GLFW_PRESS;
}

void Window::setClipboard(const std::string& text) {
  glfwSetClipboardString(window_, text.c_str());
}

PictureTexture::PictureTexture(const GlFunctions& gl) : gl_(gl) {
  gl_.GenTextures(1, &texture_);
  gl_.BindTexture(GL_TEXTURE_2D, texture_);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

void PictureTexture::release() {
  if (texture_ != 0) gl_.DeleteTextures(1, &texture_);
  texture_ = 0;
  on_card_.reset();
  size_ = {0, 0};
}

void PictureTexture::set(std::span<const uint8_t> rgba, ImageSize size) {
  CURVISPLAT_CHECK_OP(rgba.size(), ==, 4 * size.pixels());
  gl_.BindTexture(GL_TEXTURE_2D, texture_);
  gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, size.width, size.height, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                 rgba.data());
  gl_.check("showing a picture");
  size_ = size;
  on_card_.reset();
}

void PictureTexture::show(std::shared_ptr<const CardPicture> picture) {
  picture->waitFor(gl_);
  gl_.check("waiting for a picture");
  size_ = picture->size();
  on_card_ = std::move(picture);
}

}  // namespace curvisplat
