// Sliders of the window, in frames of Dear ImGui without a window: mouse and keys are given frame by frame.
#include <gtest/gtest.h>
#include <imgui.h>

#include <string>

#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

class SliderTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = ImGui::CreateContext();
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr;
    io.DisplaySize = {400, 100};
    io.DeltaTime = 0.01f;
    io.KeyMap[ImGuiKey_Enter] = 1;
    io.KeyMap[ImGuiKey_Escape] = 2;
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    io.Fonts->GetTexDataAsAlpha8(&pixels, &width, &height);
    frame();
  }
  void TearDown() override { ImGui::DestroyContext(context_); }

  /// Draws a frame with a slider from 0 to 1, and then puts the mouse over it, at 0.8.
  void frame() {
    ImGui::NewFrame();
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize({400, 100});
    ImGui::Begin("window");
    ImGui::SetNextItemWidth(300);
    changed_ = slider("##slider", value_, 0, 1, "%.3g", 0);
    const ImVec2 begin = ImGui::GetItemRectMin(), end = ImGui::GetItemRectMax();
    ImGui::GetIO().MousePos = {begin.x + 0.8f * (end.x - begin.x), 0.5f * (begin.y + end.y)};
    ImGui::End();
    ImGui::EndFrame();
  }
  void click() {
    for (const bool down : {true, false}) {
      ImGui::GetIO().MouseDown[0] = down;
      frame();
    }
  }
  void press(int key) {
    for (const bool down : {true, false}) {
      ImGui::GetIO().KeysDown[key] = down;
      frame();
    }
  }

  ImGuiContext* context_ = nullptr;
  double value_ = 0.1;
  bool changed_ = false;
};

TEST_F(SliderTest, ADoubleClickOpensItForTyping) {
  frame();
  click();
  EXPECT_NEAR(value_, 0.8, 0.05);
  click();
  EXPECT_EQ(value_, 0.1);  // as before the first click
  EXPECT_TRUE(ImGui::GetIO().WantTextInput);
  ImGui::GetIO().AddInputCharactersUTF8("0.25");
  frame();
  press(1);
  EXPECT_EQ(value_, 0.25);
  // Two clicks that lie apart move it.
  ImGui::GetIO().DeltaTime = 1;
  frame();
  click();
  click();
  EXPECT_NEAR(value_, 0.8, 0.05);
  EXPECT_FALSE(ImGui::GetIO().WantTextInput);
}

TEST_F(SliderTest, EscapeLeavesWhatWasThereBefore) {
  frame();
  click();
  click();
  ImGui::GetIO().AddInputCharactersUTF8("0.25");
  frame();
  press(2);
  EXPECT_EQ(value_, 0.1);
}

}  // namespace
}  // namespace curvisplat
