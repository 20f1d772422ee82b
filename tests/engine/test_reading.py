"""Prepared solvers read the numbers of an array, and nothing beyond its end."""

import subprocess
import sys

import pytest

# The arrays end where inaccessible memory begins: a read beyond the end kills the process.
SCRIPT = """
import ctypes, mmap
import numpy as np
from pyharness import Scene, prepare

page = mmap.PAGESIZE
memory = mmap.mmap(-1, 2 * page)
begin = ctypes.addressof(ctypes.c_char.from_buffer(memory))
assert ctypes.CDLL(None).mprotect(ctypes.c_void_p(begin + page), page, 0) == 0

def at_the_end(*numbers):
    array = np.frombuffer(memory, float, len(numbers), page - 8 * len(numbers))
    array[:] = numbers
    return array

scene = Scene("", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0))
solver = prepare(scene, {arguments})
print(solver({given}))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="mprotect is of POSIX")
@pytest.mark.parametrize(("arguments", "given"), [
    ('"auto"', "at_the_end(0.3, -0.4, 1.2), 2.0"),
    ('"auto", attitude=True', "[0.3, -0.4, 1.2], 2.0, at_the_end(0.5, 0.5, 0.5, 0.5)"),
])  # fmt: skip
def test_no_number_is_read_behind_the_end_of_an_array(arguments: str, given: str) -> None:
    script = SCRIPT.replace("{arguments}", arguments).replace("{given}", given)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
