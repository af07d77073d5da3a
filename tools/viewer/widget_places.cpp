#include "tools/viewer/widget_places.h"

#include <fmt/format.h>
#include <imgui.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <utility>

namespace curvisplat {
namespace {

struct Places {
  const char* const file = std::getenv("CURVISPLAT_WIDGETS");
  std::string now, written;
};

Places& places() {
  static Places places;
  return places;
}

}  // namespace

void nameWidget(const std::string& name) {
  // A list that has just opened does not know its size yet, and so not its place.
  if (!places().file || ImGui::IsWindowAppearing()) return;
  const ImVec2 at = ImGui::GetItemRectMin(), size = ImGui::GetItemRectSize();
  nameArea(name, static_cast<double>(at.x), static_cast<double>(at.y), static_cast<double>(size.x),
           static_cast<double>(size.y));
}

void nameArea(const std::string& name, double x, double y, double width, double height) {
  if (places().file)
    places().now += fmt::format("{:.0f} {:.0f} {:.0f} {:.0f} {}\n", x, y, width, height, name);
}

void writeWidgetPlaces() {
  const char* const file = places().file;
  const std::string now = std::exchange(places().now, {});
  if (!file || now == places().written) return;
  const std::string part = std::string(file) + ".part";
  std::ofstream(part) << now;
  std::error_code ignored;
  std::filesystem::rename(part, file, ignored);
  places().written = now;
}

}  // namespace curvisplat
