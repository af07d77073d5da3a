// Scenes with the troubles of real grids, for tests that must not depend on real ones.
//
//   spectral   a wavy channel of spectral elements: nodes gather at the elements' ends (Gauss-Lobatto spacing), so that
//              neighbouring cells differ by up to a factor of three, again and again
//   dome       a half ball on a flat base, cut out near its centre; cells grow by the factor 1.5 from one to the next
//              with 25 nodes along j. i closes on itself, and the pole k = 0 is a line
//   globe      six thin shells, the faces of a cubed sphere; they share their edges' nodes
//   duct       three blocks of a bent duct, one behind the other. They share the nodes of their faces, and their cells
//              there are of very different lengths
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/scenes/scenes.h"

namespace curvisplat {

std::shared_ptr<const Scene> makeSpectral();
/// `clustering`: as makeScenes().
std::shared_ptr<const Scene> makeDome(std::optional<double> clustering);
std::vector<std::shared_ptr<const Scene>> makeGlobe();
std::vector<std::shared_ptr<const Scene>> makeDuct();

}  // namespace curvisplat
