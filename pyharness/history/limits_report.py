"""The report of `limits`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from pyharness.history.limits import Limit
from pyharness.model.records import scene_record
from pyharness.model.report import Column, Report, Section, Table, digits, short
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading

_STEP = digits("g")
_COLUMNS = (
    Column("step", _STEP, unit="s", full=_STEP),
    Column("from the limit", short, unit="rad/s"),
    Column("from the truth", short, unit="rad/s"),
)


def limits_report(
    scene: Scene, found: Sequence[Limit], invisible: Mapping[str, Sequence[str]]
) -> Report:
    """Report what each program tends to, and the defects that change nothing, by program."""
    text: list[Section] = [heading(scene)]
    data = []
    for each in found:
        rows = [[h.step_size, h.from_limit, h.from_truth] for h in each.halvings]
        data += [[each.program, *row] for row in rows]
        title = f"original {each.program}: tends to {each.tends_to}"
        text.append([title, Table(_COLUMNS, rows), f"order {each.order:.2f} toward the limit"])
    hidden = [f"{each.program}: {', '.join(invisible[each.program]) or 'none'}" for each in found]
    text.append(["defects that change no omega here, corrected alone:", "; ".join(hidden)])
    return Report(
        "limits",
        text,
        record=lambda: {
            "scene": scene_record(scene),
            "limits": [asdict(each) for each in found],
            "invisible": {name: list(each) for name, each in invisible.items()},
        },
        data=Table((Column("program"), *_COLUMNS), data),
    )
