// What this machine has to draw with, for `curvisplat info --system`.
#pragma once

namespace curvisplat {

void printSystem(bool json);

}  // namespace curvisplat
