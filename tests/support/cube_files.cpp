#include "tests/support/cube_files.h"

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"

namespace curvisplat {
namespace {

std::vector<std::string> inputWords(const std::filesystem::path& prefix) {
  const std::string name = prefix.string();
  return {"convert",   name + ".xyz", name + ".fun", "--iblank", "yes",          "--blocks", "single",
          "--records", "none",        "--precision", "single",   "--byte-order", "little"};
}

}  // namespace

void writeCube(const std::filesystem::path& prefix, uint64_t side, const CubeNode& node,
               const std::string& name) {
  GridBlock block = gridBlock(side, side, side);
  block.has_blanking = true;
  const FunctionGridSource source({block}, 1, [&](const GridNode& number) {
    NodeValues values{{number.i, number.j, number.k}, {0}};
    node(number, values);
    return values;
  });
  Progress progress;
  writePlot3d(source, prefix, progress);
  writeFileAtomically(prefix.string() + ".nam", name + "\n");
}

std::vector<std::string> cubeArguments(const std::filesystem::path& prefix,
                                       const std::vector<std::string>& more,
                                       const std::filesystem::path& output) {
  const std::string name = prefix.string();
  std::vector<std::string> words = inputWords(prefix);
  words.insert(words.end(), {"-o", output.empty() ? name + ".splats" : output.string()});
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::vector<std::string> cubeAdditionWords(const std::filesystem::path& prefix, const std::string& scalar,
                                           const std::filesystem::path& cache) {
  std::vector<std::string> words = inputWords(prefix);
  words.insert(words.end(), {"--add-scalar", scalar, "--to", cache.string()});
  return words;
}

}  // namespace curvisplat
