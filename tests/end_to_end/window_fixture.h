// A window on a small cache of two scalars, f and volume, on a display of its own: what the window's tests
// share (WindowTest); and the same with an empty folder of caches of grids that are opened without `convert`
// (KeptCaches).
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"
#include "tests/support/virtual_display.h"

namespace curvisplat {

class WindowTest : public ProgramSuite<WindowTest> {
 protected:
  using Place = std::pair<int, int>;
  static constexpr ImageSize kScreen{1000, 700}, kWindow{740, 600};

  static void prepare() {
    old_folder_ = std::filesystem::current_path();
    std::filesystem::current_path(folder_->path());  // where pictures are saved
    setenv("XDG_CONFIG_HOME", file("config").c_str(), 1);
    setenv("CURVISPLAT_WIDGETS", file("widgets").c_str(), 1);
    run({"generate", "half-annulus", "--size", "28x14x12", "-o", "a"});
    run({"convert", "a.xyz", "a.fun", "-o", "a.splats", "--scalar", "f", "--scalar", "volume"});
  }
  static void TearDownTestSuite() {
    std::filesystem::current_path(old_folder_);
    unsetenv("MESA_SHADER_CACHE_DIR");  // of KeptCaches
    ProgramSuite::TearDownTestSuite();
  }
  void SetUp() override {
    if (const std::string missing = VirtualDisplay::missing(); !missing.empty())
      GTEST_SKIP() << missing << " is not installed";
    display_.emplace(kScreen);
    std::filesystem::remove_all("config");
    for (const char* stem : {"a", "copy"})
      for (int n = 1; n < 40; ++n) std::filesystem::remove(picture(n, stem));
  }

  static std::string picture(int number, const std::string& stem = "a") {
    return fmt::format("{}_{:04}.png", stem, number);
  }

  void open(const Words& options = {}, ImageSize size = kWindow) {
    std::filesystem::remove("widgets");
    window_ = std::make_unique<RunningProgram>(
        Words{"view", cache_ + ".splats", "--size", fmt::format("{}x{}", size.width, size.height)} + options);
    rest_ = {size.width / 2, size.height / 2};
    moveTo(rest_);
    // The panels are dark grey, the screen behind the window is black.
    ASSERT_TRUE(eventually([&] { return !isBlack(10, size.height - 10); }));
  }

  bool isBlack(int x, int y) const { return display_->brightness(x, y) < 0.03f; }

  void act(const Words& words) { display_->act(words); }
  void press(const std::string& key) { act({"key", key}); }
  void moveTo(Place place) { act({"mousemove", std::to_string(place.first), std::to_string(place.second)}); }
  /// A place in a widget of the panels, which is waited for. `across` and `down`: shares of its size.
  static Place placeOf(const std::string& widget, double across = 0.5, double down = 0.5) {
    std::optional<Place> place;
    EXPECT_TRUE(eventually([&] { return (place = placeNow(widget, across, down)).has_value(); })) << widget;
    return place.value_or(Place{});
  }
  /// The name of the widget that begins so, once it is there.
  static std::string widget(const std::string& begin) {
    std::string name;
    EXPECT_TRUE(eventually([&] {
      std::ifstream file("widgets");
      for (std::string line; std::getline(file, line);) {
        const size_t at = line.find(" " + begin);
        if (at == std::string::npos) continue;
        name = line.substr(at + 1);
        return true;
      }
      return false;
    })) << begin;
    return name;
  }
  /// Returns how far the viewer is from the focal point of a command.
  static double distanceOf(const Words& command) {
    std::array<double, 3> ends[2];
    for (const int end : {0, 1}) {
      char comma;
      std::istringstream text(valueOf(command, end == 0 ? "--position" : "--focal-point"));
      text >> ends[end][0] >> comma >> ends[end][1] >> comma >> ends[end][2];
    }
    return std::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1], ends[1][2] - ends[0][2]);
  }
  /// The numbers of an option's value, with commas between them.
  static std::array<double, 6> numbersOf(const std::string& text) {
    std::array<double, 6> numbers{};
    std::istringstream stream(text);
    for (double& number : numbers) {
      stream >> number;
      stream.ignore();
    }
    return numbers;
  }
  static bool gone(const std::string& begin) {
    return eventually([&] { return !hasWidget(begin); });
  }
  /// The next click, or a drag in the panels, is for another frame of the window's: save() lies between.
  void click(Place place) {
    moveTo(place);
    act({"click", "1"});
  }
  void click(const std::string& widget) { click(placeOf(widget)); }
  /// Chooses an item of a menu. The first click may come before the window hears.
  void choose(const std::string& menu, const std::string& item) {
    EXPECT_TRUE(eventually([&] {
      click("menu " + menu);
      return eventually([&] { return hasWidget("item " + item); }, 5);
    })) << menu;
    click("item " + item);
  }
  /// Types a name into the file dialog, which is waited for, and accepts it.
  void answer(const std::string& name) {
    placeOf("file name");
    press("ctrl+a");
    act({"type", name});
    press("Return");
    EXPECT_TRUE(eventually([] { return !hasWidget("file name"); })) << name;
  }
  /// Shows a tab of the panels: Colour, Objects, View, or Time.
  void tab(const std::string& name) { click("tab " + name); }
  void addPoint() { click(placeOf("curve", 0.28, 0.2)); }
  void chooseScalar(const std::string& name) {
    click("scalar");
    click("scalar " + name);  // in the list, once it is open
  }
  void resize(ImageSize size) {
    act({"search", "--onlyvisible", "--name", "curvisplat", "windowsize", std::to_string(size.width),
         std::to_string(size.height)});
    EXPECT_TRUE(eventually([&] { return isBlack(10, size.height + 10) && !isBlack(10, size.height - 10); }));
  }
  void drag(int button, Place from, Place to) {
    const std::string number = std::to_string(button);
    moveTo(from);
    act({"mousedown", number});
    for (int step = 1; step <= 4; ++step)
      moveTo({from.first + step * (to.first - from.first) / 4,
              from.second + step * (to.second - from.second) / 4});
    act({"mouseup", number});
    moveTo(rest_);
  }
  /// A drag from the picture's middle, by shares of its width and height. Returns it in pixels.
  Place dragPicture(int button, double across, double down) {
    const Place from = placeOf("picture"), to = placeOf("picture", 0.5 + across, 0.5 + down);
    drag(button, from, to);
    return {to.first - from.first, to.second - from.second};
  }
  /// The final picture, as saved by Ctrl+S: all that was done before is in it, and places of widgets are those of this
  /// picture.
  Image save() {
    int number = 1;  // the window, too, takes the first that is free
    while (std::filesystem::exists(picture(number, cache_))) ++number;
    const std::string name = picture(number, cache_);
    EXPECT_TRUE(eventually([&] {
      if (!std::filesystem::exists(name)) press("ctrl+s");  // a key may come before the window hears
      return eventually([&] { return std::filesystem::exists(name); }, 5);
    }));
    // The picture is written in the middle of a frame, at whose end the window says where its widgets are.
    const std::string message = fmt::format("message saved {}", std::filesystem::absolute(name).string());
    EXPECT_TRUE(eventually([&] { return hasWidget(message); })) << message;
    return readImage(name);
  }
  /// The same, and the command that draws it is among those that close() returns. Ctrl+C in the frame in which a text
  /// field closes is the field's.
  Image saveAndCopy() {
    EXPECT_TRUE(eventually([&] {
      press("ctrl+c");
      return eventually([] { return hasWidget("message copied the command for"); }, 10);
    }));
    return save();
  }
  bool hasEnded() const {
    siginfo_t info{};
    const auto process = static_cast<id_t>(window_->process());
    return ::waitid(P_PID, process, &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid != 0;
  }
  /// Closes the window: the words of the commands that were copied, without the program's name.
  std::vector<Words> close() {
    // A key that comes in the frame in which a dialog closes is the dialog's.
    const bool has_ended = eventually([&] {
      if (!hasEnded()) press("ctrl+q");
      return eventually([&] { return hasEnded(); }, 10);
    });
    EXPECT_TRUE(has_ended);
    if (!has_ended) window_->signal(SIGKILL);
    const ProgramResult result = window_->wait();
    EXPECT_EQ(result.status, 0) << result.err;
    std::vector<Words> commands;
    for (const std::string& line : linesOf(result.out)) commands.push_back(wordsOf(line));
    return commands;
  }

  static double difference(const Image& a, const Image& b) {
    return a.size.width == b.size.width && a.size.height == b.size.height ? compareImages(a, b).psnr_db : 0;
  }
  /// The part of the screen where the window shows the picture.
  Image shown(ImageSize size) const {
    if (hasWidget("message ")) {
      display_->act({"key", "Escape"});
      EXPECT_TRUE(eventually([&] { return !hasWidget("message "); }));
    }
    const Image screen = display_->screenshot();
    const auto [left, top] = placeOf("picture", 0, 0);
    Image part(size);
    for (int y = 0; y < size.height && top + y < screen.size.height; ++y)
      for (int x = 0; x < size.width && left + x < screen.size.width; ++x)
        std::copy_n(screen.pixel(left + x, top + y), 4, part.pixel(x, y));
    return part;
  }
  /// The picture's size in the window.
  static ImageSize pictureSize() {
    const auto [left, top] = placeOf("picture", 0, 0);
    const auto [right, bottom] = placeOf("picture", 1, 1);
    return {right - left, bottom - top};
  }
  /// Whether a widget or a message whose name begins so is in the window.
  static bool hasWidget(const std::string& begin) {
    return std::ranges::any_of(widgets(), [&](const Widget& one) { return one.name.starts_with(begin); });
  }
  struct Widget {
    int x = 0, y = 0, width = 0, height = 0;
    std::string name;
  };
  /// All that the window says of itself, once a frame; fewer while it writes.
  static std::vector<Widget> widgets() {
    std::vector<Widget> found;
    std::ifstream file("widgets");
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      Widget one;
      words >> one.x >> one.y >> one.width >> one.height;
      if (std::getline(words >> std::ws, one.name)) found.push_back(std::move(one));
    }
    return found;
  }
  /// The command's picture is `picture`.
  static void expectDraws(const Words& command, const Image& picture) {
    run(command);
    EXPECT_GE(difference(readImage("picture.png"), picture), 50) << testing::PrintToString(command);
  }
  /// The word after `option` in a command: "--option value" or "--option=value"; empty if it is not there.
  static std::string valueOf(const Words& command, const std::string& option) {
    for (size_t n = 0; n < command.size(); ++n) {
      if (command[n] == option) return n + 1 < command.size() ? command[n + 1] : "";
      if (command[n].starts_with(option + "=")) return command[n].substr(option.size() + 1);
    }
    return {};
  }

  static Words linesOf(const std::string& text) {
    Words lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
  }
  /// The words of a shell command without its first.
  static Words wordsOf(const std::string& command) {
    const ProgramResult result =
        RunningProgram({"-c", "set -- " + command + "; shift; printf '%s\\n' \"$@\""}, "sh").wait();
    return linesOf(result.out);
  }

  static std::optional<Place> placeNow(const std::string& widget, double across, double down) {
    for (const auto& [x, y, width, height, name] : widgets())
      if (name == widget)
        return Place{x + static_cast<int>(across * width), y + static_cast<int>(down * height)};
    return std::nullopt;
  }

  std::string cache_ = "a";  // its name without .splats
  std::optional<VirtualDisplay> display_;
  std::unique_ptr<RunningProgram> window_;
  Place rest_{};  // where the mouse stays: the window's middle, which is in the picture if there is one

 private:
  static inline std::filesystem::path old_folder_;
};

/// Caches of grids that were opened without `convert`, in a folder of the test's own.
class KeptCaches : public WindowTest {
 protected:
  void SetUp() override {
    setenv("XDG_CACHE_HOME", file("kept").c_str(), 1);
    setenv("MESA_SHADER_CACHE_DIR", file("shaders").c_str(),
           1);  // else Mesa would compile them for each test
    unsetenv("CURVISPLAT_CACHE_SIZE");
    std::filesystem::remove_all("kept");
  }
  static std::vector<std::filesystem::path> kept() {
    std::vector<std::filesystem::path> caches;
    if (!std::filesystem::exists("kept/curvisplat")) return caches;
    for (const auto& entry : std::filesystem::recursive_directory_iterator("kept/curvisplat"))
      if (entry.path().filename() == "manifest.json") caches.push_back(entry.path().parent_path());
    return caches;
  }
  static Words render(const std::string& grid, const std::string& function) {
    return {"render", grid, function, "-o", "grid.png", "--size", "100x80"};
  }
};

}  // namespace curvisplat
