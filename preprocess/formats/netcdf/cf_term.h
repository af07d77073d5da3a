// NetCDF variables as functions on the nodes of a block. A CfTerm knows along which axes of the block its
// variable varies, and reads its values at a range of nodes; a variable on staggered points is interpolated
// to the nodes half-way between them. A CfMask is a term that tells which nodes are water, or hold values at
// all.
//
// Reading needs memory for the values of the range alone. Any number of threads may read; calls into
// libnetcdf run one after the other.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// A box of nodes of a block: half-open ranges along i, j, k.
struct CfRange {
  std::array<uint64_t, 3> begin{}, end{};
};

/// Values of a term. Along an axis on which the term does not depend there is a single value.
struct CfValues {
  std::array<uint64_t, 3> count{1, 1, 1};
  std::vector<double> values;
  double at(uint64_t i, uint64_t j, uint64_t k) const {
    const uint64_t n =
        (count[0] > 1 ? i : 0) + count[0] * ((count[1] > 1 ? j : 0) + count[1] * (count[2] > 1 ? k : 0));
    return values[n];
  }
};

/// The block's dimensions in the file: along i, j, k, of time, and of the faces of a grid that has several.
struct CfDimensions {
  static constexpr size_t kNoDimension = SIZE_MAX;  // of an axis with a single node
  std::array<size_t, 3> axes{};
  std::optional<size_t> time, face;
  std::optional<size_t> levels;  // the axis of the levels, if it is known
  size_t time_step = 0;
};

/// A variable as a function on the nodes of a block.
class CfTerm {
 public:
  /// Matches the variable's dimensions with the block's. A dimension that is not one of the block's is
  /// matched by position, counted from the last, and by length:
  ///
  ///   equal length   its points are the block's nodes
  ///   one longer     the block's nodes are half-way between its points
  ///   one shorter    its points are half-way between the block's nodes; the outer nodes are extrapolated
  ///   1              ignored
  ///
  /// The only dimension of a variable is matched with the levels instead, if the block names them: GFDL's pk along phalf.
  /// nullopt if a dimension does not match.
  static std::optional<CfTerm> of(const NetcdfFiles& file, const NetcdfVariable& variable,
                                  const CfDimensions& block);

  /// A variable of a supergrid (fms_mosaic.h), which has two dimensions. With 2n + 1 points along an axis,
  /// the n nodes of the block are every second point from the second on (centres of cells); with 2n - 1
  /// points, every second one from the first on (corners). nullopt if it has other lengths.
  static std::optional<CfTerm> ofSupergrid(const NetcdfFiles& file, const NetcdfVariable& variable,
                                           const CfDimensions& block);

  /// The index along an axis times `metres`: for dimensions without a coordinate. Its variable is called
  /// "index".
  static CfTerm ofIndex(size_t axis, double metres);

  /// Numbers that are no variable's: one, or one for each of the block's levels or of the interfaces around them. Its
  /// variable is called "index". nullopt if there are fewer or more.
  static std::optional<CfTerm> ofNumbers(const NetcdfFiles& file, std::vector<double> numbers,
                                         const CfDimensions& block);

  const NetcdfVariable& variable() const { return *variable_; }
  bool varies(size_t axis) const { return along_[axis].has_value(); }
  /// The position among the variable's dimensions of that along `axis`; for axes along which it varies.
  size_t dimensionOf(size_t axis) const { return *along_[axis]; }
  /// Whether all of its dimensions are the block's own.
  bool exact() const { return exact_; }
  /// Whether its points are the block's nodes: nothing is interpolated.
  bool onNodes() const { return longer_ == std::array<int, 3>{}; }
  /// Whether the nodes are in the middle of four of its points, along i and j.
  bool ofCorners() const {
    return longer_ == std::array<int, 3>{1, 1, 0} && axes() == 2 && *along_[1] < *along_[0];
  }
  /// Whether the nodes are half-way between its points along `axis`.
  bool surrounds(size_t axis) const { return longer_[axis] > 0; }
  /// Whether it differs between the faces of the grid. read() takes the values of one, at first of the
  /// first.
  bool ofFaces() const { return face_.has_value(); }
  void setFace(uint64_t face) {
    if (face_) start_[*face_] = face;
  }
  size_t axes() const { return varies(0) + varies(1) + varies(2); }

  /// Whether it stores one value for each node, in the order of the nodes (i fastest).
  bool ofNodes() const;
  NetcdfBox boxOf(const CfRange& range) const;  // the stored values needed for `range`

  /// Makes read() return degrees, of angles that are stored in radians.
  void setDegrees();

  CfValues read(const NetcdfFiles& file, const CfRange& range) const;

 private:
  const NetcdfVariable* variable_ = nullptr;
  double scale_ = 1;                            // of the stored values
  std::array<std::optional<size_t>, 3> along_;  // [axis of the block]: its dimension; nullopt: independent
  std::array<int, 3> longer_{};                 // [axis]: its length minus the block's: -1, 0 or 1
  std::array<uint64_t, 3> length_{};            // [axis]: its length
  std::array<uint64_t, 3> first_{}, step_{1, 1, 1};  // [axis]: of the points that are nodes, of a supergrid
  bool exact_ = true;
  double index_metres_ = 0;      // above 0: there is no variable, see ofIndex()
  std::vector<double> numbers_;  // if there are any: see ofNumbers()
  std::optional<size_t> face_;   // its dimension of the faces
  std::vector<size_t>
      start_;  // [dimension]: the time step for that of time, the face for that of faces, else 0
};

/// The variable that tells which nodes of a grid are water, or hold values at all: land masks and flag
/// variables by the names and attributes that models give them.
class CfMask {
 public:
  /// The mask of the nodes of `block`; nullopt if the files have none. `levels`: the axis of its levels.
  /// `ocean`: the nodes lie below the surface, where land has no values; above it, it does not count.
  ///
  ///   mask_rho, mask_u, ..., tmask, umask, ..., maskC, maskW, ..., wet, sea_binary_mask   0 is land
  ///   hFacC, hFacW, hFacS      the part of the cell that is water; 0 is land
  ///   KMT, KMU                 the number of levels that are water
  ///   land_binary_mask         other than 0 is land
  ///   flag_values, flag_meanings    a meaning of land, hole, blanked, solid, masked, outside, missing
  ///
  /// Its dimensions are the block's, or have their lengths. A mask of a single level counts at all of them.
  static std::optional<CfMask> of(const NetcdfFiles& files, const NetcdfVariable& variable,
                                  const CfDimensions& block, size_t levels, bool ocean);

  /// Whether `variable` is a mask by its name or attributes: it is seldom the scalar of interest.
  static bool isMask(const NetcdfVariable& variable);

  /// "mask_rho is 0", for messages.
  const std::string& description() const { return description_; }

  /// Sets the face whose nodes apply() masks, in a grid of several faces.
  void setFace(uint64_t face) { term_.setFace(face); }

  /// Sets the marks of nodes that the mask hides to 1. `blank`: the nodes of `range`, i fastest.
  void apply(const NetcdfFiles& files, const CfRange& range, std::span<uint8_t> blank) const;

 private:
  enum class Rule { kZero, kNotZero, kLevels, kFlags };

  static std::optional<Rule> ruleOf(const NetcdfVariable& variable, bool ocean);
  bool hides(double value, uint64_t level) const;

  CfTerm term_;
  Rule rule_ = Rule::kZero;
  std::vector<double> hidden_;  // kFlags
  size_t levels_ = 2;
  std::string description_;
};

}  // namespace curvisplat
