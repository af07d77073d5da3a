#include "tests/support/cube_files.h"

#include "preprocess/plot3d_writer.h"
#include "stream/file.h"
#include "stream/progress.h"

namespace curvisplat {

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

std::vector<std::string> cubeWords(const std::filesystem::path& prefix, const std::vector<std::string>& more,
                                   const std::filesystem::path& output) {
  const std::string name = prefix.string();
  std::vector<std::string> words{"convert", name + ".xyz", name + ".fun", "-o"};
  words.push_back(output.empty() ? name + ".splats" : output.string());
  for (const char* word : {"--iblank", "yes", "--blocks", "single", "--records", "none", "--precision",
                           "single", "--byte-order", "little"})
    words.push_back(word);
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace curvisplat
