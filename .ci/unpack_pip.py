"""Unpack the pip that comes with Python into the environment of this Python.

ensurepip installs it too, but compiles its 500 modules, which takes longer than all that follows.
"""

import ensurepip
import sysconfig
from pathlib import Path
from zipfile import ZipFile

# Some distributions keep the wheels elsewhere.
folder = sysconfig.get_config_var("WHEEL_PKG_DIR") or Path(ensurepip.__file__).parent / "_bundled"
with ZipFile(max(Path(folder).glob("pip-*.whl"))) as wheel:
    wheel.extractall(sysconfig.get_path("purelib"))
