"""The printer page: a trajectory in, the lines of the 1982 line printer out.

The page is what paper showed: the first character of each record, the carriage control, is
taken off. It is always a blank (`data/printer.toml` has the FORMATs and what is conjecture).
"""

from typing import Any

from pyharness.history.fortran_format import write
from pyharness.model.facts import facts
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory


def page(scene: Scene, program: str, trajectory: Trajectory) -> str:
    """Return the page of a program.

    Parameters
    ----------
    scene : Scene
        Its moments and torques are the header; it must have moments.
    program : str
        The program whose FORMATs are taken.
    trajectory : Trajectory
        One line for each of its rows; that of a stop is the last.

    Returns
    -------
    str
        Lines without blanks at their ends.
    """
    formats = formats_of(program)
    assert scene.moments is not None
    pairs = zip(scene.moments, _torque_cards(scene), strict=True)
    records = write(formats["header"], [value for pair in pairs for value in pair])
    records += write(formats["heads"], [])
    assert trajectory.velocity is not None
    for index, (omega, velocity) in enumerate(
        zip(trajectory.omega.tolist(), trajectory.velocity.tolist(), strict=True)
    ):
        numbers = [index + 1]
        if trajectory.ier is not None:
            numbers.append(int(trajectory.ier[index]))
        records += write(formats["rows"], [*omega, *numbers, *velocity])
    return "".join(record[1:].rstrip() + "\n" for record in records)


def formats_of(program: str) -> dict[str, Any]:
    """Return the FORMATs of a program, with what is certain about them."""
    for entry in facts("printer")["program"]:
        if entry["name"] == program:
            formats: dict[str, Any] = entry
            return formats
    raise KeyError(program)


def _torque_cards(scene: Scene) -> tuple[float, float, float]:
    """Return the torques that the cards of the deck set: a law of time stands on none."""
    for entry in facts("printer")["initial_torque"]:
        if entry["case"] == scene.case:
            first, second, third = entry["torque"]
            return first, second, third
    return scene.torque.constant
