#include "tests/reference/overset_grid.h"

#include <cmath>
#include <utility>

namespace curvisplat {
namespace {

glm::dmat3 turned(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  const glm::dmat3 about_z(c, s, 0, -s, c, 0, 0, 0, 1), about_x(1, 0, 0, 0, c, s, 0, -s, c);
  return about_x * about_z;
}

}  // namespace

FunctionGridSource oversetGrid(std::shared_ptr<const Scene> scene, const GridBlock& block,
                               const std::vector<OversetBox>& boxes, Centring centring) {
  std::vector<GridBlock> blocks{block};
  for (const OversetBox& box : boxes) blocks.push_back(gridBlock(box.nodes, box.nodes, box.nodes));
  const auto at = [=](const GridNode& node, double shift) {
    const auto along = [&](uint64_t n, uint64_t nodes) {
      return (static_cast<double>(n) + shift) / static_cast<double>(nodes - 1);
    };
    const GridBlock& of = blocks[node.block];
    const glm::dvec3 u(along(node.i, of.ni), along(node.j, of.nj), along(node.k, of.nk));
    if (node.block == 0) return scene->position(u);
    const OversetBox& box = boxes[node.block - 1];
    return box.middle + turned(box.turn) * (box.size * (u - 0.5));
  };
  const double middle = centring == Centring::kCell ? 0.5 : 0;
  return {blocks, 1,
          [=](const GridNode& node) {
            return NodeValues{at(node, 0), {static_cast<float>(scene->scalar(at(node, middle)))}, false};
          },
          centring};
}

std::vector<OversetBox> boxesInHalfAnnulus(size_t count, uint64_t nodes) {
  const std::vector<OversetBox> all{{{-0.6, 0.0, 0.5}, {0.4, 0.4, 0.4}, nodes, 0},
                                    {{-0.5, 0.25, 0.4}, {0.3, 0.35, 0.3}, nodes, 0.5},
                                    {{-0.5, -0.4, 0.5}, {0.3, 0.3, 0.4}, nodes, 0.3},
                                    {{-0.2, 0.65, 0.5}, {0.25, 0.3, 0.35}, nodes, 0.2},
                                    {{-0.6, 0.05, 0.5}, {0.15, 0.15, 0.2}, nodes, 0.7}};
  return {all.begin(), all.begin() + static_cast<ptrdiff_t>(count)};
}

}  // namespace curvisplat
