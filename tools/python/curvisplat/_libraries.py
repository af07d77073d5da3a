"""Imported before all else that needs _core. A wheel carries its own libraries, such as HDF5. Their functions have the names that those of
other versions have, which other modules or the interpreter may have made known to the whole process: the wheel's come first here."""

import os
import sys

if os.path.isdir(os.path.join(os.path.dirname(__file__), "lib")):
    _flags = sys.getdlopenflags()
    sys.setdlopenflags(os.RTLD_NOW | os.RTLD_LOCAL | os.RTLD_DEEPBIND)
    try:
        from . import _core  # noqa: F401
    finally:
        sys.setdlopenflags(_flags)
