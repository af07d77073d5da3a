// Packs the splats of a brick into bytes, and unpacks them. Lossy within the bounds below, and deterministic.
//
//   position   fixed point in the brick's cell, 5 to 32 bits per axis, the same for the whole brick. Error at
//              most 0.05 of the smallest standard deviation in the brick (σ_K times the smallest singular
//              value of A; σ_K = 0.447 is the kernel's standard deviation)
//   shape      2 log axes, the log volume and 3 shears: ‖S^-½ S' S^-½ - I‖ <= 0.05 at any aspect ratio
//   weight     relative to the decoded a0 a1 a2: relative error at most 2e-3, and of the brick's sum 1e-5
//   mean       16 bits over the brick's range, or 24, or by its own scale
//   slope      error at most 2^-11 of the brick's span; √variance: 2^-13 of it; or by their own scale (values_codec.h)
//
// The symbols (A, S, axes, shears) are those of stream/model/splats.h; stream/FORMAT.md specifies the bytes.
// Encoding also returns the decoded splats, because merging and octree membership are computed from what a
// reader will see.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/values_codec.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// An encoded brick: its record and its streams.
struct EncodedBrick {
  Brick brick;  // without parent, children, error and file offset
  std::vector<std::byte> geometry;
  std::vector<std::vector<std::byte>> values;  // [variable]
  std::vector<BrickVariable> variables;        // [variable], without file offsets
  double weight = 0;                           // sum of the decoded splats' weights
};

/// Encodes `brick` (1 to kMaxBrickSplats splats) and replaces its splats by the decoded ones, in double.
/// `codings`: [variable]; empty: ValuePrecision::kNormal for all. Pure: any thread. Throws nothing but
/// bad_alloc.
EncodedBrick encodeBrick(const RootCube& root, BrickSplats& brick, std::span<const ValueCoding> codings = {});

/// One encoded variable of a brick.
struct EncodedValues {
  std::vector<std::byte> bytes;
  BrickVariable variable;  // without file offset
};

/// Encodes the values of one variable as encodeBrick() does, and replaces them by the decoded ones. The
/// values must be finite. `runs` and `border_codes`: the brick's. `references`: the brick's decoded values at
/// one or two earlier time steps, from which the stream may be predicted. Pure: any thread. Throws nothing
/// but bad_alloc.
EncodedValues encodeValues(std::span<const NodeRun> runs, std::span<const uint32_t> border_codes,
                           std::span<SplatScalar> values, const TimeReferences& references = {},
                           const ValueCoding& coding = {});

/// Decodes the geometry stream of `brick`. The bytes are untrusted: throws an Error that names the brick
/// unless they decode to exactly brick.splats finite splats inside the cell, and allocates memory for no more
/// than that. `runs`, if not null, receives the node runs of a leaf. Pure: any thread.
void decodeGeometry(const RootCube& root, const Brick& brick, std::span<const std::byte> bytes,
                    SplatGeometry& out, std::vector<NodeRun>* runs = nullptr);

/// Decodes the values of one variable. The bytes are untrusted; throws and allocates as decodeGeometry()
/// does. Pure: any thread.
void decodeVariable(const Brick& brick, const BrickVariable& variable, std::span<const std::byte> bytes,
                    SplatVariable& out);

/// Decode a stream as the two functions above do, to arrays of brick.splats elements. `references`: those that
/// stepsBackOf() names for this stream.
void decodeGeometry(const RootCube& root, const Brick& brick, std::span<const std::byte> bytes,
                    const GeometryArrays<float>& out);
void decodeVariable(const Brick& brick, std::span<const std::byte> bytes, const VariableArrays<float>& out,
                    const TimeReferences& references = {});

/// Decodes geometry and values to doubles with exact positions, for merging into coarser bricks.
BrickSplats decodeForMerging(const RootCube& root, const Brick& brick, std::span<const std::byte> geometry,
                             std::span<const BrickVariable> variables,
                             std::span<const std::vector<std::byte>> values);
/// The geometry alone. Overwrites `out`, which has no variables then, and keeps its capacity.
void decodeForMerging(const RootCube& root, const Brick& brick, std::span<const std::byte> geometry,
                      BrickSplats& out);

}  // namespace curvisplat
