// What a view of a cache begins with. Finding it reads: 0.1 to 0.3 s and more on a busy machine. So it is found on the
// thread that opens the cache, and the window's own thread answers meanwhile.
#pragma once

#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/edited_function.h"
#include "tools/viewer/view_state.h"
#include "tools/viewer/viewer_options.h"

namespace curvisplat {

struct PreparedView {
  CacheReader cache;
  ViewState state;
  std::string scalar;                   // for which
  EditedFunction automatic;             // was chosen from the data
  std::vector<std::string> face_names;  // that the list of surfaces offers
};

/// The first view, or the one that was left last time, with what `options` (but `carried`) ask for. `picture`: in pixels.
/// Any thread. Throws Error as reading the cache or the state does.
PreparedView prepareView(CacheReader cache, const ViewerOptions& options, ImageSize picture);

}  // namespace curvisplat
