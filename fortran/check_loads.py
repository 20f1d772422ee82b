"""Load the extension modules that were built, so that a build fails whose modules can't be loaded.

Python's own symbols are undefined in an extension, so that no linker (-z defs, -undefined error)
sees what else is missing, such as a procedure of libgfortran.
"""

import ctypes
import os
import sys

for place in sys.argv[2:]:
    try:
        ctypes.CDLL(os.path.abspath(place), os.RTLD_NOW)
    except OSError as error:
        sys.exit(f"the extension can't be loaded: {error}")
open(sys.argv[1], "w").close()
