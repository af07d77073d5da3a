#include "preprocess/splats/node_splats.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include "preprocess/shape/covered_part.h"
#include "preprocess/shape/shape.h"
#include "preprocess/splats/block_window.h"
#include "preprocess/splats/dual_cell.h"
#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/inner_nodes.h"
#include "preprocess/splats/window_lines.h"
#include "stream/base/error.h"
#include "stream/model/corrections.h"
#include "stream/model/fits.h"

namespace curvisplat {
namespace {

/// Makes the splats of the nodes of a box of a window.
class NodeWindow {
 public:
  NodeWindow(const BlockWindow& in, const NodeBox& box, const SplatRules& rules, NodeScratch& scratch,
             NodeSplats& out)
      : in_(in),
        rules_(rules),
        lines_(in, box, rules.fit(), rules.widths, scratch),
        lattice_(lines_.lattice()),
        faces_(lattice_, corrections_.middles),
        ni_(in.block.ni),
        i0_(in.i0),
        i1_(in.endOfPart(in.block.ni)),
        row_stride_(static_cast<ptrdiff_t>(in.window.rowNodes(ni_))),
        plane_stride_(row_stride_ * static_cast<ptrdiff_t>(in.window.j1 - in.window.j0)),
        scratch_(scratch),
        out_(out) {
    for (const auto& scalar : in.nodes->scalars) scalars_.push_back(scalar.data());
  }

  void addRow(uint64_t j, uint64_t k);
  size_t count() const { return count_; }

 private:
  uint64_t octantsOfBlanks(ptrdiff_t at, const Neighbours& neighbours) const;
  uint32_t cellsAt(ptrdiff_t at, uint64_t i) const {
    return cellsAround(lattice_, at, {1, row_stride_, plane_stride_}, {i, row_j_, row_k_},
                       {ni_, in_.block.nj, in_.block.nk});
  }
  bool takePiece(uint64_t i, ptrdiff_t at, const Neighbours& neighbours,
                 const std::array<double, 3>& inwards);
  double weightOf(ptrdiff_t at, uint64_t i, double of_neighbours) const;
  void addInnerNodes(uint64_t i0, uint64_t i1, ptrdiff_t row, const Neighbours& neighbours);
  void takeInnerNode(const InnerSplats& splats, const InnerGrowthCodes& growth, size_t n, uint64_t i,
                     ptrdiff_t at);
  void addNode(uint64_t i, ptrdiff_t at, const Neighbours& neighbours, bool on_face, const Layers& layers);
  void cutBehindOne(const NodeBehind& behind, NodeSplat& node) const;
  void cutBehindSeveral(const CutBehindFaces& cut);
  /// Leaves of the last splat what neither other blocks nor blanked cells cover. Returns false if that is nothing.
  template <typename Rotate>
  bool keepPart(ptrdiff_t at, const Rotate& rotate) {
    const uint64_t covered = octants_of_blanks_ | (in_.covered ? in_.covered[at] : 0);
    if (covered == 0) return true;
    const glm::dmat3 axes(rotate({1, 0, 0}), rotate({0, 1, 0}), rotate({0, 0, 1}));
    NodeSplat& node = out_.splats[count_];
    const auto code =
        keepUncovered({covered, axes, node.border_code, 2}, node.splat,
                      std::span(out_.values).subspan(count_ * scalars_.size(), scalars_.size()));
    if (code) node.becomePart(*code);
    return code.has_value();
  }
  bool fitsLayers() const {
    return rules_.steep && corrections_.layers && corrections_.faces && corrections_.growth &&
           corrections_.lines;
  }
  /// A length for the shape of a node without any extent: far below the grid's, and above zero.
  double smallestAxis(ptrdiff_t at, const Neighbours& neighbours) const;

  const BlockWindow& in_;
  const SplatRules rules_;
  const SplatCorrections corrections_ = correctionsToMake().splats;
  const WindowLines lines_;
  const NodeLattice& lattice_;
  const FacesBehind faces_;
  std::vector<const float*> scalars_;
  uint64_t ni_, i0_, i1_;  // of a row; its part
  ptrdiff_t row_stride_, plane_stride_;
  uint64_t first_node_of_row_ = 0, row_j_ = 0, row_k_ = 0;
  uint64_t octants_of_blanks_ = 0;  // of the next node: points (covered_part.h) in cells that are not there
  NodeScratch& scratch_;
  NodeSplats& out_;
  size_t count_ = 0;
};

void NodeWindow::addRow(uint64_t j, uint64_t k) {
  const GridBlock& block = in_.block;
  const ptrdiff_t row = lines_.elementOfRow(j, k);
  first_node_of_row_ = in_.first_node + (k * block.nj + j) * ni_;
  row_j_ = j;
  row_k_ = k;
  const bool on_face = isFace(j, block.nj) || isFace(k, block.nk);
  const auto layers_at = [&, layer_j = layerOf(j, block.nj), layer_k = layerOf(k, block.nk)](uint64_t i) {
    return Layers{layerOf(i, ni_), layer_j, layer_k};
  };
  const bool has_layer = layers_at(0)[1] != 0 || layers_at(0)[2] != 0;

  Neighbours inner;
  inner.before = {-1, j > 0 ? -row_stride_ : 0, k > 0 ? -plane_stride_ : 0};
  inner.after = {1, j + 1 < block.nj ? row_stride_ : 0, k + 1 < block.nk ? plane_stride_ : 0};
  const auto at_i = [&](uint64_t i) {
    Neighbours neighbours = inner;
    if (i == 0) neighbours.before[0] = 0;
    if (i + 1 == ni_) neighbours.after[0] = 0;
    return neighbours;
  };

  if (corrections_.stretch) lines_.stretchRow(j, k);
  // Those that are neither at a face nor behind one.
  const uint64_t inner_begin = std::max<uint64_t>(2, i0_), inner_end = ni_ < 4 ? 0 : std::min(i1_, ni_ - 2);
  const bool at_once = !on_face && !has_layer && !in_.covered && corrections_.all() && rules_.dual_cells &&
                       rules_.widths && inner_end >= inner_begin + kInnerNodesAtOnce;
  if (!lines_.anyBlankAround(j, k)) {
    if (i0_ == 0) addNode(0, row, at_i(0), true, layers_at(0));
    for (uint64_t i = std::max<uint64_t>(1, i0_); i < std::min(i1_, ni_ - 1); ++i) {
      if (at_once && i == inner_begin) {
        addInnerNodes(inner_begin, inner_end, row, inner);
        i = inner_end - 1;
      } else {
        addNode(i, row + static_cast<ptrdiff_t>(i), inner, on_face, layers_at(i));
      }
    }
    if (ni_ > 1 && i1_ == ni_)
      addNode(ni_ - 1, row + static_cast<ptrdiff_t>(ni_ - 1), at_i(ni_ - 1), true, layers_at(ni_ - 1));
    return;
  }
  const auto one_by_one = [&](uint64_t begin, uint64_t end) {
    for (uint64_t i = begin; i < end; ++i) {
      const ptrdiff_t at = row + static_cast<ptrdiff_t>(i);
      if (lattice_.blank[at]) continue;
      Neighbours neighbours = at_i(i);
      for (int axis = 0; axis < 3; ++axis) {
        if (lattice_.blank[at + neighbours.before[axis]]) neighbours.before[axis] = 0;
        if (lattice_.blank[at + neighbours.after[axis]]) neighbours.after[axis] = 0;
      }
      if (rules_.octants) octants_of_blanks_ = octantsOfBlanks(at, neighbours);
      addNode(i, at, neighbours, on_face || isFace(i, ni_), layers_at(i));
    }
    octants_of_blanks_ = 0;
  };
  if (!at_once) {
    one_by_one(i0_, i1_);
    return;
  }
  one_by_one(i0_, inner_begin);
  lines_.forEachRunBetweenBlanks(j, k, inner_begin, inner_end,
                                 [&](uint64_t begin, uint64_t end, bool is_clear) {
                                   if (is_clear && end - begin >= kInnerNodesAtOnce)
                                     addInnerNodes(begin, end, row, inner);
                                   else
                                     one_by_one(begin, end);
                                 });
  one_by_one(inner_end, i1_);
}

/// The points of the node's cell that lie in cells with a blanked node; none if all do. Along an axis with one
/// neighbour only, both halves of the cell are towards that one.
uint64_t NodeWindow::octantsOfBlanks(ptrdiff_t at, const Neighbours& neighbours) const {
  uint64_t points = 0;
  for (size_t octant = 0; octant < kCellOctantCount; ++octant) {
    std::array<ptrdiff_t, 3> step{};
    for (size_t axis = 0; axis < 3; ++axis) {
      const ptrdiff_t before = neighbours.before[axis], after = neighbours.after[axis];
      const bool is_below = (octant >> axis & 1) != 0;
      step[axis] = (is_below && before != 0) || after == 0 ? before : after;
    }
    const ptrdiff_t ij = step[0] + step[1];
    if (lattice_.blank[at + ij] || lattice_.blank[at + step[0] + step[2]] ||
        lattice_.blank[at + step[1] + step[2]] || lattice_.blank[at + ij + step[2]])
      points |= octantPoints(octant);
  }
  return points == kAllCovered ? 0 : points;
}

/// The weight of a node's splat, of which keepPart() takes what reaches into blanked cells. A node without any cell keeps
/// the piece that its neighbours give it.
double NodeWindow::weightOf(ptrdiff_t at, uint64_t i, double of_neighbours) const {
  const std::array<ptrdiff_t, 3> strides{1, row_stride_, plane_stride_};
  const uint32_t there = rules_.dual_cells ? cellsAt(at, i) : 0;
  if (there == 0) return of_neighbours;
  const int kept = static_cast<int>(kCellPoints) - std::popcount(octants_of_blanks_);
  return dualVolume(lattice_, at, strides, there) * static_cast<double>(kCellPoints) / kept;
}

/// Finds the piece of the last node, whose cell has collapsed. False if its piece has no volume either.
bool NodeWindow::takePiece(uint64_t i, ptrdiff_t at, const Neighbours& neighbours,
                           const std::array<double, 3>& inwards) {
  if (!rules_.dual_cells || (in_.covered && in_.covered[at] != 0)) return false;
  // Lengths of the columns: thin cells have not collapsed.
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double length = glm::distance(lattice_.position(at + neighbours.after[axis]),
                                        lattice_.position(at + neighbours.before[axis]));
    shortest = std::min(shortest, length);
    longest = std::max(longest, length);
  }
  if (shortest > kCollapsed * longest) return false;
  const CollapsedNode collapsed{lattice_,       at,      {1, row_stride_, plane_stride_}, neighbours,
                                cellsAt(at, i), inwards, smallestAxis(at, neighbours)};
  const auto piece = splatOfPiece(collapsed, scalars_,
                                  std::span(out_.values).subspan(count_ * scalars_.size(), scalars_.size()));
  if (!piece) return false;
  NodeSplat& node = out_.splats[count_];
  node.splat = piece->splat;
  node.border_code = piece->border_code;
  node.growth_code = kNoGrowth;
  node.regular = false;
  node.lines = {};
  return true;
}

/// The nodes from i0 to i1 of a row without blanks around it. `row`: the element of its first node.
void NodeWindow::addInnerNodes(uint64_t i0, uint64_t i1, ptrdiff_t row, const Neighbours& neighbours) {
  const uint64_t in_part = i0 - i0_, count = i1 - i0;
  const ptrdiff_t at = row + static_cast<ptrdiff_t>(i0);
  InnerRow nodes;
  nodes.positions = {lattice_.x, lattice_.y, lattice_.z};
  nodes.at = at;
  nodes.scalars = scalars_;
  nodes.bend = kBend;
  for (size_t axis = 0; axis < 3; ++axis) {
    nodes.strides[axis] = neighbours.after[axis];
    nodes.stretch[axis] = scratch_.stretch[axis].data() + in_part;
    nodes.drift[axis] = scratch_.drift[axis].data() + in_part;
  }
  const size_t first = count_, scalars = scalars_.size();
  InnerSplats splats;
  InnerGrowthCodes growth{};
  std::vector<SplatScalar> of_last;
  for (uint64_t done = 0; done < count;) {
    // The last ones come with some of those before, which stay as they are.
    const uint64_t begin = std::min(done, count - kInnerNodesAtOnce);
    SplatScalar* values = out_.values.data() + (first + begin) * scalars;
    if (begin < done) of_last.resize(kInnerNodesAtOnce * scalars);
    computeInnerNodes(nodes, begin, splats, begin < done ? of_last.data() : values);
    if (rules_.growth_codes) {
      const auto of = [&](size_t axis) { return scratch_.growth[axis].data() + in_part + begin; };
      findInnerGrowth(splats, {of(0), of(1), of(2)}, growth);
    }
    for (size_t n = done - begin; n < kInnerNodesAtOnce; ++n) {
      if (begin < done) std::copy_n(of_last.data() + n * scalars, scalars, values + n * scalars);
      count_ = first + begin + n;
      const uint64_t i = i0 + begin + n;
      if (splats.is_plain[n])
        takeInnerNode(splats, growth, n, i, at + static_cast<ptrdiff_t>(begin + n));
      else
        addNode(i, at + static_cast<ptrdiff_t>(begin + n), neighbours, false, {});
    }
    done = begin + kInnerNodesAtOnce;
  }
  count_ = first + count;
}

/// Number `n` of `splats` as the splat of node `i` of the row.
void NodeWindow::takeInnerNode(const InnerSplats& splats, const InnerGrowthCodes& growth, size_t n,
                               uint64_t i, ptrdiff_t at) {
  const auto of = [n](const InnerSplats::Row(&rows)[3]) {
    return glm::dvec3(rows[0][n], rows[1][n], rows[2][n]);
  };
  NodeSplat& node = out_.splats[count_];
  node.node = first_node_of_row_ + i;
  node.splat.position = of(splats.position);
  for (size_t axis = 0; axis < 3; ++axis) {
    node.splat.axis[axis] = splats.axis[axis][n];
    node.splat.shear[axis] = splats.shear[axis][n];
  }
  node.splat.weight = splats.weight[n];
  node.regular = true;
  node.border_code = kNoBorder;
  if (growth.of[n] != kGrowsAlongSeveral) {
    node.growth_code = static_cast<uint32_t>(growth.of[n]);
  } else {
    const uint64_t in_part = i - i0_;
    const auto rotate = [&](const glm::dvec3& axis) {
      return of(splats.rotated[axis.x != 0 ? 0 : axis.y != 0 ? 1 : 2]);
    };
    node.growth_code = growthCode(
        {scratch_.growth[0][in_part], scratch_.growth[1][in_part], scratch_.growth[2][in_part]}, rotate);
  }
  node.on_block_face = node.behind_face = false;
  node.layers = 0;
  node.node_position = lattice_.position(at);
  node.spacing = 0;
  (splats.determinant[n] < 0 ? out_.left_handed : out_.right_handed) += 1;
}

/// Columns: the images of the directions inwards from the faces that a cell ends at, or is behind.
template <typename Rotate>
glm::dmat3 alongFaces(const std::array<double, 3>& inwards, const Layers& layers, const Rotate& rotate) {
  glm::dmat3 along;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 inward(0.0);
    inward[axis] = inwards[axis] != 0 ? inwards[axis] : layers[axis];
    along[axis] = rotate(inward);
  }
  return along;
}

/// Makes a half cell that is narrower or wider than its face shorter or longer, for it to be as dense at its border as the
/// cell is: by its volume, over the one that its columns have at the face.
void fitToVolume(double volume, double of_columns, const std::array<double, 3>& inwards, glm::dvec3& middle,
                 glm::dvec3& stretch) {
  // Beyond, the cell has collapsed at its other end, such as in a triangle between three blocks.
  constexpr double kMax = 1.25;
  const auto halves =
      std::count_if(inwards.begin(), inwards.end(), [](double inward) { return inward != 0; });
  if (halves == 0 || !(volume > 0) || !(of_columns > 0) || volume == of_columns) return;
  if (volume > kMax * of_columns || of_columns > kMax * volume) return;
  const double factor = std::pow(volume / of_columns, 1 / static_cast<double>(halves));
  for (int axis = 0; axis < 3; ++axis) {
    if (inwards[static_cast<size_t>(axis)] == 0) continue;
    middle[axis] *= factor;
    stretch[axis] *= factor;
  }
}

inline void NodeWindow::addNode(uint64_t i, ptrdiff_t at, const Neighbours& neighbours, bool on_face,
                                const Layers& layers) {
  const uint64_t in_part = i - i0_;
  glm::dvec3 stretch(scratch_.stretch[0][in_part], scratch_.stretch[1][in_part],
                     scratch_.stretch[2][in_part]);
  NodeSplat& node = out_.splats[count_];
  node.node = first_node_of_row_ + i;
  node.node_position = lattice_.position(at);
  node.on_block_face = on_face;
  node.behind_face = false;
  node.layers = 0;
  node.lines = {};
  node.fit = rules_.fit();
  node.fits_layers = false;
  if ((on_face || layers != Layers{}) && corrections_.lines && corrections_.stretch)
    node.lines = lines_.atJoints({i, row_j_, row_k_});

  glm::dmat3 jacobian;  // columns along i, j, k
  for (int axis = 0; axis < 3; ++axis)
    jacobian[axis] = 0.5 * (lattice_.position(at + neighbours.after[axis]) -
                            lattice_.position(at + neighbours.before[axis]));

  // Where the middle of the cell is from the node along its columns, in cells. The cell reaches half way to
  // either neighbour, at distances a and b across its faces: its middle is (b - a) / 4 away, of a length of
  // (a + b) / 2. With one neighbour only, that is a quarter of the difference, inwards, of the splat's length:
  // its border stays.
  glm::dvec3 middle(0.0);
  glm::dvec3 bend(0.0);             // the sum of the positions' second differences
  glm::dvec3 aside(0.0);            // from the node to the cell's middle, across the columns
  std::array<double, 3> inwards{};  // along i, j, k: 1 or -1 where the cell is a half one
  std::array<float, 3> growth{};
  std::array<double, 3> widths{};
  if (corrections_.growth && rules_.dual_cells) widths = widthGrowth(lattice_, at, neighbours);
  double nearest = std::numeric_limits<double>::infinity();  // neighbour that is not at the node's own place
  double weight_factor = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const glm::dvec3 to_before = node.node_position - lattice_.position(at + neighbours.before[axis]);
    const glm::dvec3 to_after = lattice_.position(at + neighbours.after[axis]) - node.node_position;
    double a = glm::length(to_before), b = glm::length(to_after);
    if (a > 0) nearest = std::min(nearest, a);
    if (b > 0) nearest = std::min(nearest, b);
    const bool whole = neighbours.before[axis] != 0 && neighbours.after[axis] != 0;
    if (whole && rules_.widths) {
      const glm::dvec3 across = glm::cross(jacobian[(axis + 1) % 3], jacobian[(axis + 2) % 3]);
      a = std::abs(glm::dot(to_before, across));
      b = std::abs(glm::dot(to_after, across));
    }
    const double width = whole ? widths[static_cast<size_t>(axis)] : 0.0;
    stretch[axis] *= 1 - kWidthShare * (width * width);
    if (whole) {
      bend += stretch[axis] * stretch[axis] * (to_after - to_before);
      if (corrections_.middles) aside += asideOf(to_before, to_after, a, b);
    }
    if (a + b > 0 && (corrections_.middles || !whole)) middle[axis] = 0.5 * (b - a) / (a + b);
    if (corrections_.growth) growth[axis] = scratch_.growth[axis][in_part];
    if (whole) {
      if (corrections_.growth) middle[axis] += scratch_.drift[axis][in_part];
      if (rules_.dual_cells) middle[axis] += kWidthDrift * width;
      continue;
    }
    if (corrections_.border_codes) {
      if (a + b > 0) {
        inwards[axis] = neighbours.before[axis] == 0 ? 1 : -1;
        stretch[axis] = stretchAtBorder(stretch[axis]);
      }
      middle[axis] *= stretch[axis];
    } else {
      jacobian[axis] *= 2.0;
      middle[axis] = 0;
      weight_factor *= 0.5;
    }
  }
  const double of_neighbours = std::abs(glm::determinant(jacobian)) * weight_factor;
  const double weight = weightOf(at, i, of_neighbours);
  fitToVolume(weight, of_neighbours, inwards, middle, stretch);
  if (fitsLayers() && (on_face || layers != Layers{}))
    node.fits_layers = fitToLayers({inwards, layers, node.lines}, {middle, stretch, growth});
  node.spacing = on_face && std::isfinite(nearest) ? nearest : 0.0;
  node.splat.position = node.node_position + jacobian * middle + aside;
  for (int axis = 0; axis < 3; ++axis) jacobian[axis] *= stretch[axis];
  const double shrink = 1 / (stretch[0] * stretch[1] * stretch[2]);  // from the splat's volume to the cell's

  bool is_left = true;  // a part of the cell at least
  const auto set_values = [&](const auto& frame) {
    constexpr bool kPlain = std::remove_cvref_t<decltype(frame)>::kIsPlain;
    // Along a floored axis, a bend of the scalar cannot be told from one of the coordinates.
    const bool correct_bends = kPlain && corrections_.bends;
    glm::dvec3 bend_in_cells(0.0), aside_in_cells(0.0);
    if constexpr (kPlain) {
      const glm::dvec3 in_cells = frame.inFrame(bend), bent = glm::abs(in_cells);
      const double largest = std::max(std::max(bent.x, bent.y), bent.z);
      const double share = rules_.dual_cells ? kMaxBend / std::max(kMaxBend, largest) : 1.0;
      if (correct_bends) bend_in_cells = share * in_cells;
      aside_in_cells = share * frame.inFrame(aside);
    }
    SplatScalar* value = out_.values.data() + count_ * scalars_.size();
    for (const float* f : scalars_) {
      const double here = f[at];
      glm::dvec3 gradient;
      double second = 0, least = here, most = here;
      for (int axis = 0; axis < 3; ++axis) {
        const double before = f[at + neighbours.before[axis]], after = f[at + neighbours.after[axis]];
        gradient[axis] = 0.5 * (after - before);
        if (neighbours.before[axis] != 0 && neighbours.after[axis] != 0)
          second += stretch[axis] * stretch[axis] * ((after - here) - (here - before));
        least = std::min({least, before, after});
        most = std::max({most, before, after});
      }
      const glm::dvec3 slope = frame.rotate(gradient * stretch);
      double mean = here + glm::dot(gradient, middle) + glm::dot(slope, aside_in_cells);
      if (correct_bends)
        mean = std::clamp(mean + kBend * (second - glm::dot(slope, bend_in_cells)), least, most);
      *value++ = {mean, slope, 0.0};
    }
  };

  splatFromJacobian(
      jacobian, node.splat, [&] { return smallestAxis(at, neighbours); },
      [&](const auto& frame) {
        if (frame.floored() && takePiece(i, at, neighbours, inwards)) return;
        const auto rotate = [&](const glm::dvec3& v) { return frame.rotate(v); };
        node.splat.weight =
            rules_.dual_cells ? weight : std::abs(frame.determinant()) * weight_factor * shrink;
        node.regular = !frame.floored() && weight_factor == 1;
        node.border_code = borderCode(inwards, corrections_.faces && !frame.floored(), rotate);
        const bool has_growth = !frame.floored() && (rules_.growth_codes || on_face || layers != Layers{});
        node.growth_code = has_growth ? growthCode(growth, rotate) : kNoGrowth;
        for (int axis = 0; axis < 3; ++axis) {
          if (frame.floored()) node.lines[axis] = {};
          if (!node.lines[axis].isThere()) continue;
          glm::dvec3 inward(0.0);
          inward[axis] = inwards[axis] != 0 ? inwards[axis] : layers[axis];
          node.lines[axis].setInward(rotate(inward));
        }
        (frame.floored()           ? out_.degenerate
         : frame.determinant() < 0 ? out_.left_handed
                                   : out_.right_handed) += 1;
        if (frame.kIsPlain && corrections_.faces && layers != Layers{}) {
          // The code has the exact plane of the one face that the node is behind, or of one of several
          // without that correction.
          const NodeBehind behind{at, neighbours, layers};
          const auto several =
              std::count_if(layers.begin(), layers.end(), [](int side) { return side != 0; });
          if (node.border_code == kNoBorder && (several == 1 || !corrections_.layers))
            cutBehindOne(behind, node);
          else if (corrections_.layers)
            cutBehindSeveral(
                faces_.cutAtSeveral(behind, inwards, alongFaces(inwards, layers, rotate), node.splat));
        }
        set_values(frame);
        is_left = keepPart(at, rotate);
        while (!is_left && !out_.probes.empty() && out_.probes.back().splat == count_) out_.probes.pop_back();
      });
  count_ += is_left;
}

/// Cuts a node at one face that it is behind: along j before k before i.
void NodeWindow::cutBehindOne(const NodeBehind& behind, NodeSplat& node) const {
  const int axis = behind.layers[1] != 0 ? 1 : behind.layers[2] != 0 ? 2 : 0;
  const std::optional<CutBehindFace> cut = faces_.cutAtOne(behind, axis, node.splat);
  if (!cut) return;
  node.border_code = cut->border_code;
  node.behind_face = true;
  node.node_position = cut->face_node;
  node.spacing = cut->spacing;
}

/// Cuts the last node.
void NodeWindow::cutBehindSeveral(const CutBehindFaces& cut) {
  if (cut.count == 0) return;
  for (size_t n = 0; n < cut.count; ++n) out_.probes.push_back({count_, cut.probes[n]});
  out_.splats[count_].border_code = cut.border.code;
  out_.splats[count_].layers = cut.border.layers;
}

double NodeWindow::smallestAxis(ptrdiff_t at, const Neighbours& neighbours) const {
  const glm::dvec3 here = glm::abs(lattice_.position(at));
  for (const double length : {lattice_.spacing(at, neighbours), std::max({here.x, here.y, here.z})})
    if (length > 0) return std::max(kAxisFloor * length, std::numeric_limits<double>::min());
  return kAxisFloor;
}

}  // namespace

const JointLine* NodeSplat::lineAlong(const glm::dvec3& inward) const {
  constexpr double kSame = 0.9;  // cosine
  for (const JointLine& line : lines)
    if (line.isThere() && glm::dot(line.inward(), inward) > kSame) return &line;
  return nullptr;
}

void computeNodeSplats(const BlockWindow& in, const NodeBox& box, NodeScratch& scratch, NodeSplats& out,
                       const SplatRules& rules) {
  const NodeBox& window = in.window;
  const Halo halo = correctionsToMake().splats.stretch ? kNodeSplatHalo : kNodeHalo;
  CURVISPLAT_CHECK(window.j0 <= box.j0 - std::min(box.j0, halo.before) &&
                   window.k0 <= box.k0 - std::min(box.k0, halo.before));
  CURVISPLAT_CHECK(std::min(box.j1 + halo.after, in.block.nj) <= window.j1 &&
                   std::min(box.k1 + halo.after, in.block.nk) <= window.k1);
  CURVISPLAT_CHECK(window.i0 <= in.i0 - std::min(in.i0, halo.before) &&
                   std::min(in.endOfPart(in.block.ni) + halo.after, in.block.ni) <= window.i1);

  // Sized for the most there can be and cut afterwards: in a run over equal boxes nothing is initialised
  // twice.
  CURVISPLAT_CHECK_OP(in.i0, <, in.endOfPart(in.block.ni));
  const size_t most = (in.endOfPart(in.block.ni) - in.i0) * (box.j1 - box.j0) * (box.k1 - box.k0);
  const size_t variables = in.nodes->scalars.size();
  out.splats.resize(most);
  out.values.resize(most * variables);
  out.probes.clear();
  out.degenerate = out.right_handed = out.left_handed = 0;

  NodeWindow rows(in, box, rules, scratch, out);
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j) rows.addRow(j, k);
  out.splats.resize(rows.count());
  out.values.resize(rows.count() * variables);
}

}  // namespace curvisplat
