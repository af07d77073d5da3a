// Packs a brick's splats into bytes, and back. Lossy within the bounds of design section 4, and
// deterministic.
//
//   positions  fixed point in the brick's cell, 5 to 32 bits an axis and brick: the error is at most 0.05 of
//   the
//              smallest local standard deviation (σ_K times the smallest singular value of A)
//   shapes     3 log axes and 3 shears; ‖S^-½ S' S^-½ - I‖ <= 0.05
//   weights    relative to a0 a1 a2, 1e-3 or better
//   mean       16 bits over the brick's range at least, slope and variance against the same range
//
// Encoding returns the decoded values as well, since merging and membership follow what a reader will see.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/model/brick.h"
#include "stream/model/brick_splats.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

struct EncodedBrick {
  Brick brick;  // without parent, children, error and file offsets
  std::vector<std::byte> geometry;
  std::vector<std::vector<std::byte>> values;  // [variable]
  std::vector<BrickVariable> variables;        // [variable], without file offsets
  double weight = 0;                           // sum over the splats, as decoded
};

/// Encodes `brick` (1 .. kMaxBrickSplats splats) and replaces its contents by what decoding gives, in double.
/// Pure: any thread. Throws nothing but bad_alloc.
EncodedBrick encodeBrick(const RootCube& root, BrickSplats& brick);

/// One variable of a brick.
struct EncodedValues {
  std::vector<std::byte> bytes;
  BrickVariable variable;  // without file offset
};

/// Encodes the values of one variable, as encodeBrick does, and replaces them by what decoding gives. They
/// are finite. `runs`: the brick's. Pure: any thread. Throws nothing but bad_alloc.
EncodedValues encodeValues(std::span<const NodeRun> runs, std::span<const uint32_t> border_codes,
                           std::span<SplatScalar> values);

/// Decodes the geometry stream of `brick`. Bytes are untrusted: throws Error (naming the brick) for anything
/// that does not decode to exactly brick.splats finite splats inside the cell; allocates no more than that
/// many. `runs`, if not null, receives the node runs of a leaf. Pure: any thread.
void decodeGeometry(const RootCube& root, const Brick& brick, std::span<const std::byte> bytes,
                    SplatGeometry& out, std::vector<NodeRun>* runs = nullptr);

/// As decodeGeometry, for the values of one variable.
void decodeVariable(const Brick& brick, const BrickVariable& variable, std::span<const std::byte> bytes,
                    SplatVariable& out);

/// The same two, into arrays of brick.splats elements.
void decodeGeometry(const RootCube& root, const Brick& brick, std::span<const std::byte> bytes,
                    const GeometryArrays<float>& out);
void decodeVariable(const Brick& brick, std::span<const std::byte> bytes, const VariableArrays<float>& out);

/// Both, in double and with exact positions, as conversion merges them.
BrickSplats decodeForMerging(const RootCube& root, const Brick& brick, std::span<const std::byte> geometry,
                             std::span<const BrickVariable> variables,
                             std::span<const std::vector<std::byte>> values);

}  // namespace curvisplat
