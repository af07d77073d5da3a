#include "tools/viewer/fonts.h"

#include <imgui.h>

#include <array>
#include <filesystem>
#include <string>
#include <system_error>

namespace curvisplat {
namespace {

// Where distributions put it; the first is where the build found it.
constexpr std::array kFiles{CURVISPLAT_FONT, "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
                            "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
                            "/usr/share/fonts/dejavu/DejaVuSans.ttf", "/usr/share/fonts/TTF/DejaVuSans.ttf"};
// Latin, Greek, super- and subscripts, arrows, mathematical and geometric signs.
constexpr ImWchar kLetters[] = {0x20,   0x17f,  0x370,  0x3ff,  0x2010, 0x2027, 0x2030, 0x205e, 0x2070,
                                0x209f, 0x2190, 0x21ff, 0x2200, 0x22ff, 0x25a0, 0x25ff, 0};
constexpr float kBuiltInPixels = 13;

}  // namespace

bool loadFont(float pixels, float pixels_per_unit) {
  ImGuiIO& io = ImGui::GetIO();
  io.Fonts->Clear();
  for (const char* file : kFiles) {
    std::error_code ignored;
    if (!*file || !std::filesystem::exists(file, ignored)) continue;
    if (!io.Fonts->AddFontFromFileTTF(file, pixels, nullptr, kLetters)) continue;
    io.FontGlobalScale = 1 / pixels_per_unit;
    return true;
  }
  io.Fonts->AddFontDefault();
  io.FontGlobalScale = pixels / kBuiltInPixels / pixels_per_unit;
  return false;
}

}  // namespace curvisplat
