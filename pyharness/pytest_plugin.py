"""A plugin of pytest that checks a port of the programs, with one test for each cell.

A port is an implementation of the programs of the thesis in any language. A cell is a combination
of program, case and listing. `pytest --pyharness-port=COMMAND` requests the tests. Without the
option, nothing but this module is imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pyharness.checks.port import Cell, PortCheck
    from pyharness.checks.port_process import PortProcess

_OPTIONS = {
    "port": "Check the port that this command starts, bit for bit, with one test for each cell.",
    "cells": "Check the port only in these cells, separated by commas, as in two-term/case-3.",
    "draws": "Number of random scenes in which the port is checked too (default 0).",
    "seed": "Text that seeds the random scenes (default: the present year and week).",
}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options of the plugin."""
    group = parser.getgroup("pyharness", "checks of a port of the programs (pyharness)")
    for name, text in _OPTIONS.items():
        metavar = {"port": "COMMAND", "cells": "NAME,...", "draws": "N", "seed": "S"}[name]
        group.addoption(f"--pyharness-{name}", dest=f"pyharness_{name}", metavar=metavar, help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Refuse options of the plugin that have no meaning without a port.

    Raise pytest.UsageError for such an option.
    """
    if config.getoption("pyharness_port") is None:
        for name in list(_OPTIONS)[1:]:
            if config.getoption(f"pyharness_{name}") is not None:
                raise pytest.UsageError(
                    f"--pyharness-{name} has no meaning without --pyharness-port"
                )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Add a test for each requested cell, before the tests are selected by -k and -m.

    Raise pytest.UsageError if a requested cell, or another value of an option, is not allowed.
    """
    if config.getoption("pyharness_port") is not None:
        name = "pyharness-port"
        collector = PortCollector.from_parent(session, name=name, nodeid=name)
        # With the hooks of a collection, pytest counts and shows the tests like all others.
        report = collector.ihook.pytest_make_collect_report(collector=collector)
        collector.ihook.pytest_collectreport(report=report)
        items.extend(report.result)


def _requested(config: pytest.Config) -> list[Cell]:
    from pyharness.checks.port_process import split_command
    from pyharness.cli.port_checks import requested_cells
    from pyharness.model.errors import InputError
    from pyharness.model.listing import PROGRAMS
    from pyharness.model.scene_file import case_numbers

    command, names, draws, seed = (config.getoption(f"pyharness_{name}") for name in _OPTIONS)
    asked = [] if names is None else [name.strip() for name in names.split(",")]
    try:
        split_command(command)
        return requested_cells(asked, PROGRAMS, case_numbers(), draws, seed)[0]
    except InputError as error:
        message = str(error).replace("--cell ", "--cells ").replace("--", "--pyharness-")
        raise pytest.UsageError(message) from None


class PortCollector(pytest.Collector):
    """The collector of the tests of a port, with the process of the port that all tests use.

    Each process of pytest, such as a worker of pytest-xdist, has one collector and starts the port
    once, at its first test.
    """

    def __init__(self, **given: Any) -> None:
        """Select the cells; the port is not started yet.

        Raise pytest.UsageError if no cell is requested, or if an option has a wrong value.
        """
        super().__init__(**given)
        self._command: str = self.config.getoption("pyharness_port")
        self._cells = _requested(self.config)
        self._process: PortProcess | None = None
        self._ended = ""  # the test that ended the port

    def collect(self) -> Iterator[PortTest]:
        """Yield a test for each requested cell."""
        for cell in self._cells:
            yield PortTest.from_parent(self, name=cell.name, cell=cell)

    def check(self, cell: Cell) -> PortCheck:
        """Return the check of one cell; start the port if it does not run.

        Parameters
        ----------
        cell : Cell
            The run that is requested from the port.

        Returns
        -------
        PortCheck
            The comparison with our Python program.

        Raises
        ------
        PortError
            If the port gives no valid answer. Later tests are then skipped.
        """
        from pyharness.checks.port import asked
        from pyharness.checks.port_process import PortError, PortProcess

        if self._ended:
            pytest.skip(f"the port gave no valid answer in {self._ended}")
        try:
            if self._process is None:
                process = PortProcess(self._command)
                process.__enter__()
                self._process = process
                self.config.add_cleanup(lambda: process.__exit__(None, None, None))
            return asked(self._process, self._command, cell)
        except PortError:
            self._ended = cell.name
            raise


class PortFailure(Exception):
    """An error raised if the port's answer differs; it has the check, which has the values."""

    def __init__(self, check: PortCheck) -> None:
        """Store the check of a port that failed."""
        super().__init__(check.note)
        self.check = check


class PortTest(pytest.Item):
    """The test of a port in one cell, a combination of program, case and listing."""

    def __init__(self, *, cell: Cell, **given: Any) -> None:
        """Store the cell, which is requested from the port when the test runs."""
        super().__init__(**given)
        self._cell = cell

    def runtest(self) -> None:
        """Request the run from the port and compare the answer with our Python program.

        Raise PortFailure if they differ, and PortError if the answer is not valid.
        """
        assert isinstance(self.parent, PortCollector)
        check = self.parent.check(self._cell)
        if not check.passed:
            raise PortFailure(check)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *_: object) -> Any:
        """Return the report of a failure: the difference, a table of the step, and a command.

        The command repeats the check alone.
        """
        from pyharness.checks.port import replay_command
        from pyharness.checks.port_process import PortError
        from pyharness.checks.port_report import step_section
        from pyharness.model.report import Report
        from pyharness.views.render import render

        error = excinfo.value
        command = self.config.getoption("pyharness_port")
        if isinstance(error, PortError):
            return f"port/{self.name}: {error}\n{replay_command(command, self._cell)}"
        if not isinstance(error, PortFailure):
            return super().repr_failure(excinfo)
        step = [step_section(error.check)] if error.check.difference else []
        shown = render(Report("verify", step, dict), "table") if step else ""
        return f"port/{self.name}: {error.check.note}\n\n{shown}\n{error.check.again}"

    def reportinfo(self) -> tuple[Any, int | None, str]:
        """Return the place and the name of the test for the reports of pytest."""
        return self.config.rootpath, None, f"port/{self.name}"
