#include "tools/commands/info_system.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "render/frame/backend.h"
#include "tools/viewer/window.h"

namespace curvisplat {

void printSystem(bool json) {
  const SystemReport report = examineBackends();
  const WindowReport window = examineWindow();
  const unsigned cores = std::thread::hardware_concurrency();
  if (json) {
    nlohmann::ordered_json out = {{"cores", cores}, {"auto", report.automatic}};
    out["backends"] = nlohmann::ordered_json::array();
    for (const BackendReport& backend : report.backends)
      out["backends"].push_back({{"name", backend.word}, {"works", backend.works}, {"found", backend.found}});
    out["window"] = {
        {"opens", window.opens}, {"display", window.display}, {"glfw", window.glfw}, {"found", window.found}};
    fmt::print("{}\n", out.dump(2));
    return;
  }
  fmt::print("cores      {}\n", cores);
  for (const BackendReport& backend : report.backends)
    fmt::print("{:<10} {}{}\n", backend.word, backend.works ? "" : "not available: ", backend.found);
  fmt::print("auto       {}\n", report.automatic);
  fmt::print("display    {}\n", window.display);
  fmt::print("GLFW       {}\n", window.glfw);
  fmt::print("window     {}{}\n", window.opens ? "OpenGL " : "not available: ", window.found);
}

}  // namespace curvisplat
