// Scenes with the troubles of real grids, for tests that must not depend on real ones.
//
//   spectral   a wavy channel of spectral elements. Nodes gather at the ends of each element (Chebyshev-
//              Gauss-Lobatto points), so that cell sizes rise and fall again and again
//   dome       a half ball with a flat base, hollow near its centre. With 25 nodes along j, cells grow by the
//              factor 1.5 from one to the next. Periodic along i; at k = 0 all i coincide on a line
//   globe      six thin shells, the faces of a cubed sphere. Neighbours share the nodes of their edges
//   duct       three blocks of a bent duct, one behind the other. They share the nodes of their faces, and
//              their cells there have very different lengths
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/scenes/scene.h"

namespace curvisplat {

std::shared_ptr<const Scene> makeSpectral();
/// `clustering`: as makeScenes().
std::shared_ptr<const Scene> makeDome(std::optional<double> clustering);
std::vector<std::shared_ptr<const Scene>> makeGlobe();
std::vector<std::shared_ptr<const Scene>> makeDuct();

}  // namespace curvisplat
