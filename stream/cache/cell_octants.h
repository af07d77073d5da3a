#pragma once

namespace curvisplat {

/// A feature of caches (manifest.h): splats at nodes beside blanked ones lack the octants of their cells that lie in
/// cells with a blanked node (preprocess/splats/node_splats.h). Readers need not do anything; a program that adds
/// scalars has to make the same splats.
inline constexpr const char* kCellOctants = "cell-octants";

}  // namespace curvisplat
