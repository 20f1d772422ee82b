"""Recorder of the functions that each test, or each kind of `verify`, enters; a plugin of pytest.

A function of Python is named `file:qualified.name`, a compiled one `module:procedure` or `:name`.
"""

import cProfile
import ctypes
import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

PLACES = 1 << 16  # the same as in hooks.c


class Recorder:
    """The functions entered since `begin`, by name."""

    def __init__(self) -> None:
        self._folder = f"{Path.cwd()}{os.sep}"
        self._code: dict[int, CodeType] = {}
        self._profile = cProfile.Profile()
        self._names: dict[int, str] = {}
        hooks = ctypes.CDLL(os.environ["LD_PRELOAD"])
        self._entered = (ctypes.c_void_p * PLACES).in_dll(hooks, "entered")

    def begin(self) -> None:
        """Clear the record, and watch every call from now on."""
        self._code.clear()
        ctypes.memset(ctypes.addressof(self._entered), 0, ctypes.sizeof(self._entered))
        threading.settrace(self._look)
        # The profile sees this thread alone, and takes a small part of the time of a trace.
        self._profile = cProfile.Profile(builtins=False)
        self._profile.enable()

    def end(self) -> list[str]:
        """Return the names of the functions that were entered."""
        self._profile.disable()
        threading.settrace(None)
        found = set()
        profiled = (each.code for each in self._profile.getstats())
        for code in [*self._code.values(), *(c for c in profiled if isinstance(c, CodeType))]:
            if code.co_filename.startswith(self._folder):
                path = code.co_filename.removeprefix(self._folder)
                if path.startswith("pyharness/"):
                    found.add(f"{path}:{code.co_qualname.partition('.<locals>')[0]}")
        entered = {address for address in self._entered if address}
        if entered and not self._names:
            self._names = _compiled_names()
        return sorted(found.union(self._names[x] for x in entered if x in self._names))

    def _look(self, frame: FrameType, event: str, argument: Any) -> None:
        self._code[id(frame.f_code)] = frame.f_code


def _compiled_names() -> dict[int, str]:
    """Return the names of our libraries' functions by their addresses in this process."""
    found = {}
    maps = Path("/proc/self/maps").read_text()
    for begin, path in re.findall(r"^(\w+)-\S+ \S+ 0+ .*?(\S+/pyharness/_\w+\S*\.so)$", maps, re.M):
        listed = subprocess.run(["nm", path], capture_output=True, text=True, check=True).stdout
        for offset, name in re.findall(r"^(\w+) [tT] (\S+)$", listed, re.M):
            module, mod, procedure = name.removeprefix("__").partition("_MOD_")
            plain = re.sub(r"\.\w+(\.\d+)?$", "", procedure if mod else name)
            place = re.sub(r"_(binary\d+|plain|avx2|avx512)$", "", module) if mod else ""
            found[int(begin, 16) + int(offset, 16)] = f"{place}:{plain.lower()}"
    return found


class Plugin:
    """A plugin that writes {test: [seconds, names, passed, is a campaign]}."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._recorder = Recorder()
        self._tests: dict[str, list[Any]] = {}
        self._failed: set[str] = set()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Record one test with its fixtures."""
        begin = time.perf_counter()
        self._recorder.begin()
        yield
        names = self._recorder.end()
        seconds = round(time.perf_counter() - begin, 3)
        is_campaign = item.get_closest_marker("campaign") is not None
        passed = item.nodeid not in self._failed
        self._tests[item.nodeid] = [seconds, names, passed, is_campaign]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Remember a test that does not pass."""
        if report.outcome != "passed":
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write the record."""
        self._path.write_text(json.dumps(self._tests))


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugin."""
    config.pluginmanager.register(Plugin(Path(os.environ["MUTATIONS_RECORD"])))


def main() -> int:
    """Run a command line of pyharness, and record it as one test."""
    from pyharness.cli.main import main as run

    recorder = Recorder()
    begin = time.perf_counter()
    recorder.begin()
    code = run(sys.argv[1:])
    names = recorder.end()
    one = {"verify": [round(time.perf_counter() - begin, 3), names, code == 0, True]}
    Path(os.environ["MUTATIONS_RECORD"]).write_text(json.dumps(one))
    return code


if __name__ == "__main__":
    sys.exit(main())
