#include "tools/viewer/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <utility>

#include "stream/error.h"

namespace curvisplat {
namespace {

std::string last_words;  // of GLFW; the main thread's

void onError(int, const char* words) {
  last_words = words ? words : "";
}

}  // namespace

struct Window::Library {
  Library() {
    glfwSetErrorCallback(onError);
    if (!glfwInit())
      throw Error(
          "no window can be opened: {}; on a machine without a display, draw pictures with curvisplat "
          "render",
          last_words);
  }
  ~Library() { glfwTerminate(); }
};

Window::Window(const std::string& title, ImageSize size) : library_(std::make_unique<Library>()) {
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  window_ = glfwCreateWindow(size.width, size.height, title.c_str(), nullptr, nullptr);
  if (!window_)
    throw Error(
        "no window can be opened: {}; OpenGL 3.3 is needed (from a graphics card's driver, or from Mesa: "
        "libgl1-mesa-dri)",
        last_words);
  glfwMakeContextCurrent(window_);
  glfwSwapInterval(1);
  gl_ = std::make_unique<GlFunctions>(
      [](const char* name) { return reinterpret_cast<void*>(glfwGetProcAddress(name)); });
  context_name_ = fmt::format("{}, {}", reinterpret_cast<const char*>(gl_->GetString(GL_VERSION)),
                              reinterpret_cast<const char*>(gl_->GetString(GL_RENDERER)));
  glfwSetWindowUserPointer(window_, this);
  // Dear ImGui's callbacks go before these, and call them.
  glfwSetKeyCallback(window_, onKey);
  glfwSetMouseButtonCallback(window_, onButton);
  glfwSetCursorPosCallback(window_, onMove);
  glfwSetScrollCallback(window_, onWheel);

  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;
  float scale_x = 1, scale_y = 1;
  glfwGetWindowContentScale(window_, &scale_x, &scale_y);
  ImGui::GetStyle().ScaleAllSizes(scale_x);
  ImGui::GetIO().FontGlobalScale = scale_x;
  ImGui_ImplGlfw_InitForOpenGL(window_, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

Window::~Window() {
  ImGui_ImplOpenGL3_Shutdown();
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
  glfwDestroyWindow(window_);
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

void Window::beginFrame() {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
}

void Window::endFrame(const glm::vec3& background) {
  ImGui::Render();
  const ImageSize size = pixels();
  gl_->Viewport(0, 0, size.width, size.height);
  gl_->ClearColor(background.x, background.y, background.z, 1);
  gl_->Clear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(window_);
}

ImageSize Window::pixels() const {
  ImageSize size;
  glfwGetFramebufferSize(window_, &size.width, &size.height);
  return size;
}

double Window::pixelScale() const {
  int width = 0, height = 0;
  glfwGetWindowSize(window_, &width, &height);
  return width > 0 ? static_cast<double>(pixels().width) / width : 1;
}

void Window::onKey(GLFWwindow* window, int key, int, int action, int mods) {
  if (action != GLFW_PRESS) return;
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  self->keys_.push_back({key, (mods & GLFW_MOD_SHIFT) != 0, (mods & GLFW_MOD_CONTROL) != 0});
}

std::vector<Window::Key> Window::takeKeys() {
  std::vector<Key> keys = std::exchange(keys_, {});
  if (ImGui::GetIO().WantTextInput) keys.clear();
  return keys;
}

bool Window::overPicture() const {
  return mouse_.x >= picture_left_;
}

void Window::onButton(GLFWwindow* window, int button, int action, int mods) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  if (action == GLFW_PRESS && !self->isDragging()) {
    glfwGetCursorPos(window, &self->mouse_.x, &self->mouse_.y);
    if (!self->overPicture()) return;
    self->dragged_button_ = button;
    self->dragged_with_shift_ = (mods & GLFW_MOD_SHIFT) != 0;
  } else if (action == GLFW_RELEASE && button == self->dragged_button_) {
    self->dragged_button_ = -1;
  }
}

void Window::onMove(GLFWwindow* window, double x, double y) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  const glm::dvec2 movement = self->pixelScale() * (glm::dvec2(x, y) - self->mouse_);
  self->mouse_ = {x, y};
  if (self->isDragging())
    self->drags_.push_back({self->dragged_button_, self->dragged_with_shift_, movement});
}

void Window::onWheel(GLFWwindow* window, double, double y) {
  auto* const self = static_cast<Window*>(glfwGetWindowUserPointer(window));
  if (self->overPicture()) self->wheel_ += y;
}

std::vector<Window::Drag> Window::takeDrags() {
  return std::exchange(drags_, {});
}

double Window::takeWheel() {
  return std::exchange(wheel_, 0.0);
}

bool Window::isDown(int key) const {
  return !ImGui::GetIO().WantTextInput && glfwGetKey(window_, key) == GLFW_PRESS;
}

void Window::setClipboard(const std::string& text) {
  glfwSetClipboardString(window_, text.c_str());
}

}  // namespace curvisplat
