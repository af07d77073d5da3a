// `curvisplat info --system`: prints the drawing back ends and the window system of this machine.
#pragma once

namespace curvisplat {

void printSystem(bool json);

}  // namespace curvisplat
