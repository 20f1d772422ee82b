"""The report of `bench --ensemble`."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from operator import attrgetter
from typing import Any

from pyharness.bench.ensemble_measure import STEPS, Memory, Rate, Rates, Size
from pyharness.bench.report import grouped, measured_report, power
from pyharness.model.report import Column, Picture, Report, Table, digits, numbers, short

_DRIFT = (
    "One process and one run: the shortest times of interleaved rounds, on one core in the "
    "processor's time, on more in that on the wall. Times drift with the machine and with what "
    "else it does: compare the ratios, not the rates."
)
_STYLES = {"prepared": "D-.", "closed-form": "o-", "taylor": "s--", "rk4": "^:"}


@dataclass(frozen=True)
class Ensembles:
    rates: Rates
    sizes: Sequence[Size]
    memory: Sequence[Memory]


def ensemble_report(found: Ensembles, packages: Iterable[str], command: str) -> Report:
    text = [*_make_tables(found), _notes(found)]
    pictures = {"growth": partial(size_picture, found.sizes)}
    report = Report("bench", text, partial(_record, found), _data(found.rates), pictures=pictures)
    return measured_report("## Ensembles", _DRIFT, report, packages, command)


def ours_over(rows: Sequence[Rate], row: Rate) -> float | None:
    """Return our highest speed with as many threads, divided by the speed in `row`, or None."""
    rates = [each.rate for each in rows if each.method in _STYLES and each.threads == row.threads]
    return max(rates) / row.rate if rates else None


def _make_tables(found: Ensembles) -> list[tuple[str, Table]]:
    tables: dict[tuple[str, float | None], list[Rate]] = {}
    for row in found.rates.rows:
        tables.setdefault((row.load, row.target), []).append(row)
    parts = []
    for (load, target), rows in tables.items():
        what = "body-steps" if target is None else "bodies"
        columns = [
            Column("", left=True), Column("cores"),
            Column("setting", _setting), Column("bodies"), Column("error", short),
            Column(f"million {what}/s", digits(".3g", 1e-6)), Column("ours over it", _ratio),
        ]  # fmt: skip
        cells = [
            [f"{row.method}, {row.note}".removesuffix(", "), row.threads, row.setting, row.bodies,
             row.error, row.rate, ours_over(rows, row)]
            for row in rows
        ]  # fmt: skip
        title = f"{load[0].upper()}{load[1:]}, T = 3 s, "
        title += f"{STEPS} steps of RK4" if target is None else f"to {short(target)}"
        parts.append((title.replace("1.0e", "1e"), Table(columns, cells)))
    time = digits(".3g", 1e9)
    if found.sizes:
        names = list(found.sizes[0].seconds)
        heads = {"prepared": "closed form, prepared", "closed-form": "closed form"}
        heads["taylor"] = "Taylor, 1e-12"
        columns = [Column("bodies")]
        columns += [Column(heads.get(name, f"RK4, {STEPS} steps"), time) for name in names]
        rows_of_sizes = [[each.bodies, *each.seconds.values()] for each in found.sizes]
        parts.append(("Growth with the number: ns a body, one core", Table(columns, rows_of_sizes)))
    if found.memory:
        mega = digits(".1f", 1e-6)
        columns = [
            Column("", left=True), Column("bodies"), Column("arrays in and out, MB", mega),
            Column("process grew by, MB", mega), Column("ratio", digits(".2f")),
        ]  # fmt: skip
        cells = [[each.method, each.bodies, each.arrays, each.peak, each.ratio]
                 for each in found.memory]  # fmt: skip
        parts.append(("Memory", Table(columns, cells)))
    return parts


def _setting(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f} steps" if value > 1.0 else power(value)


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def _notes(found: Ensembles) -> list[str]:
    lines = [
        f"{found.rates.bodies} bodies with I = (40, 30, 20), starts and torques at random, seed "
        f"{found.rates.seed}; who would take long gets fewer, and the rate is theirs. error: the "
        "largest among the first 200, each over the body's largest omega at start and end, against "
        "solve at 1e-15. setting: the coarsest that keeps the error in the title; of a tolerance "
        "decades, of steps factors of 2**(1/4).",
        "ours over it: the best rate of ours on as many cores over the own one. Compiling is not "
        "in the times. heyoka-ensemble copies its integrator for each batch; heyoka-batch has one, "
        "in a loop of Python's. Of several sizes of a batch the fastest counts.",
    ]
    return lines + grouped((name, why, place) for place, name, why in found.rates.refused)


def _data(rates: Rates) -> Table:
    heads = "load target method cores setting bodies seconds error bodies_a_second note"
    values = attrgetter(*heads.replace("cores", "threads").split())
    return numbers(heads, [values(row) for row in rates.rows])


def _record(found: Ensembles) -> dict[str, Any]:
    rates, rows, refused = found.rates, [], []
    for row in rates.rows:
        more = {"bodies_a_second": row.bodies_a_second, "note": row.note or None}
        rows.append(asdict(row) | more)
    for place, name, why in rates.refused:
        refused.append({"place": place or None, "method": name, "reason": why})
    memory = [asdict(each) | {"ratio": each.ratio} for each in found.memory]
    told = {"seed": rates.seed, "bodies": rates.bodies, "rows": rows, "refused": refused}
    return told | {"growth": list(map(asdict, found.sizes)), "memory": memory}


def size_picture(sizes: Sequence[Size]) -> Picture:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.5, 4.5), dpi=110, layout="constrained")
    axes = figure.subplots()
    names, bodies = list(sizes[0].seconds), [each.bodies for each in sizes]
    for name in names:
        times = [1e9 * each.seconds[name] for each in sizes]
        label = "closed-form, prepared" if name == "prepared" else name
        axes.loglog(bodies, times, _STYLES[name], label=label, linewidth=1.2, markersize=5.0)
    axes.set_xlabel("bodies of a call")
    axes.set_ylabel("ns a body, one core")
    axes.set_title(f"To T = 3 s; taylor to 1e-12, rk4 in {STEPS} steps", fontsize=10)
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(frameon=False)
    rows = [[each.bodies, *(each.seconds[name] for name in names)] for each in sizes]
    data = numbers(" ".join(["bodies", *(name.replace("-", "_") for name in names)]), rows)
    return Picture(figure, data)
