// Standard input, output and error, whatever the program was started with.
#pragma once

namespace curvisplat {

/// Opens those of the three that are closed, so that no file of ours is taken for one of them: nothing can be
/// read from or written to them. Before anything else is opened.
void openStandardStreams();

/// Whether all that was printed is written. Says so if not.
bool finishStandardOutput();

}  // namespace curvisplat
