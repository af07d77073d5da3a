// Makes standard input, output and error usable even if the program was started with some of them closed.
#pragma once

namespace curvisplat {

/// Opens closed ones on /dev/null, so that no file the program opens gets number 0, 1 or 2. Reading from or
/// printing to them fails. Call before opening anything else.
void openStandardStreams();

/// Flushes standard output. Prints a message and returns false if anything printed could not be written.
bool finishStandardOutput();

}  // namespace curvisplat
