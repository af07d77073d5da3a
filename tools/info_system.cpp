#include "tools/info_system.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "render/backend.h"

namespace curvisplat {

void printSystem(bool json) {
  const SystemReport report = examineBackends();
  const unsigned cores = std::thread::hardware_concurrency();
  if (json) {
    nlohmann::ordered_json out = {{"cores", cores}, {"auto", report.automatic}};
    out["backends"] = nlohmann::ordered_json::array();
    for (const BackendReport& backend : report.backends)
      out["backends"].push_back({{"name", backend.word}, {"works", backend.works}, {"found", backend.found}});
    fmt::print("{}\n", out.dump(2));
    return;
  }
  fmt::print("cores      {}\n", cores);
  for (const BackendReport& backend : report.backends)
    fmt::print("{:<10} {}{}\n", backend.word, backend.works ? "" : "not here: ", backend.found);
  fmt::print("auto       {}\n", report.automatic);
}

}  // namespace curvisplat
