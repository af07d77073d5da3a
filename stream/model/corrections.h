// The corrections of the method, each of which makes pictures truer. The program makes all of them. A test leaves single ones
// out, to measure what each is worth (tests/support/with_corrections.h); nothing else can.
#pragma once

namespace curvisplat {

/// Corrections of nodes' and cells' splats beyond the linear part of the mapping.
struct SplatCorrections {
  bool border_codes = true;  // else a border's node has a whole cell of half the weight, around itself
  bool faces = true;         // borders are faces to be cut at; else cells at borders are drawn in parts
  // Cuts behind several faces; otherwise nodes on a face are cut there alone, others at one face behind them.
  bool layers = true;
  bool middles = true;  // else splats sit at nodes, but for half cells
  bool bends = true;    // means are corrected where the scalar bends (kBend)
  bool stretch = true;  // else splats are as long as their cells
  bool growth = true;   // else kernels are symmetric; needs `stretch`
  bool lines = true;    // else cells at joints know their own block alone; needs `growth` and `stretch`

  bool all() const {
    return border_codes && faces && layers && middles && bends && stretch && growth && lines;
  }
};

struct SliceCorrections {
  bool slopes = true;           // else a splat has its mean everywhere
  bool common_gradient = true;  // else the gradient is each splat's own alone
};

struct IsoCorrections {
  bool common_field = true;  // else the field is that of the splat that weighs most
  bool ended = true;         // else surfaces reach as far behind borders as splats do
  bool smooth = true;        // else outlines have one ray a pixel
};

struct Corrections {
  SplatCorrections splats;
  SliceCorrections slices;
  IsoCorrections isosurfaces;
};

/// The corrections to make. Read them where work begins, not for each splat. Any thread.
const Corrections& correctionsToMake();

}  // namespace curvisplat
