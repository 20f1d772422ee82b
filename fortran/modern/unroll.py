"""Write a hot module for one instruction set: other names, and the marked loops written out."""

import re
import sys
from collections.abc import Iterator

MODULES = (
    "euler_equations",
    "scaled_motion",
    "scaled_march",
    "scaled_runge_kutta",
    "taylor_plan",
    "taylor_series",
    "taylor",
)
MOST_ORDER = 28
FIRST_CHECK = 6
# From this order on the products of the three equations are summed side by side.
WIDE = 10
# Numbers just stored one by one can't be loaded together without a wait: the newest two terms of
# each factor stay out of the wide sums.
LAG = 2
LOCALS = [f"{name}{axis}" for name in ("p", "pp", "q", "qq", "tail") for axis in (1, 2, 3)]
FACTORS = (("y", "z"), ("x", "z"), ("x", "y"))
PLACES = {
    "x": ("left(2", "left(3"),
    "y": ("left(1", "right(3"),
    "z": ("right(1", "right(2"),
}


def main(source: str, target: str, level: str) -> None:
    """Read `source`, write `target`; names in it end in `level`."""
    with open(source) as file:
        text = file.read()
    for module in MODULES:
        text = re.sub(rf"\b(module|use) {module}\b", rf"\1 {module}_{level}", text)
    text = re.sub(r'(bind\(c, name="\w+_)level"', rf'\1{level}"', text)
    blocks = re.split(r" *! unroll: m (\d+)\n.*?! end unroll\n", text, flags=re.DOTALL)
    unknowns = [f"{name}{k}" for k in range(MOST_ORDER + 1) for name in "xyz"]
    parts = [blocks[0]]
    for orders, rest in zip(blocks[1::2], blocks[2::2], strict=True):
        reals = [*unknowns, *LOCALS, "even", "odd", "last"]
        parts += [f"    real(dp) :: {each}\n" for each in reals]
        parts += ["    integer :: i\n"]
        parts += [f"    {line}\n" for line in series(int(orders))]
        parts += [rest]
    with open(target, "w") as file:
        file.write("".join(parts))


def series(torque_orders: int) -> Iterator[str]:
    """Yield the statements; the torque has terms in the first `torque_orders` orders."""
    for name, (place, _) in PLACES.items():
        yield f"{name}0 = s%{place}, 0)"
    for n in range(0, MOST_ORDER, 2):
        if n < WIDE:
            yield from known(n)
        yield from finish(n + 1, "p", torque_orders)
        yield from finish(n + 2, "q", torque_orders)
        if n + 2 >= FIRST_CHECK:
            yield from check(n + 2)


def known(n: int) -> Iterator[str]:
    """Yield p1 ... p3 and q1 ... q3: of the Cauchy products n and n + 1, what is known by now.

    From the middle outwards, so that the newest terms come last; two orders at once, so that a
    term that is loaded serves twice; two sums for each, so that one need not wait for itself.
    """
    begun = set()
    for j in range((n + 1) // 2, 0, -1):
        for total, i in (("p", n - j), ("q", n + 1 - j)):
            if i < j or i >= n:
                continue
            for low, high in ((j, i), (i, j)) if i > j else ((j, i),):
                for axis, (u, v) in enumerate(FACTORS, 1):
                    place = f"{total}{axis}" if low <= high else f"{total}{total}{axis}"
                    start = f"{place} + " if place in begun else ""
                    begun.add(place)
                    yield f"{place} = {start}{u}{low}*{v}{high}"
    for place in sorted(begun):
        if len(place) == 3:
            yield f"{place[1:]} = {place[1:]} + {place}"


def wide(n: int) -> Iterator[str]:
    """Yield the Cauchy products n of the three equations in one loop, the newest terms left out."""
    yield "do i = 1, 4"
    begun = set()
    for m, j in enumerate(sorted(range(LAG, n - LAG + 1), key=lambda j: max(j, n - j))):
        place = "odd" if m % 2 else "even"
        start = f"{place} + " if place in begun else ""
        begun.add(place)
        yield f"  {place} = {start}s%left(i, {j})*s%right(i, {n - j})"
    yield "  s%sums(i) = even + odd"
    yield "end do"


def finish(k: int, total: str, torque_orders: int) -> Iterator[str]:
    """Yield term k of the three unknowns from the sums so far and the newest products."""
    n = k - 1
    if n >= WIDE:
        yield from wide(n)
        newest = [pair for j in range(LAG - 1, -1, -1) for pair in ((j, n - j), (n - j, j))]
    else:
        newest = [(1, n - 1), (n - 1, 1)] if total == "q" and n > 2 else []
        newest += [(0, n), (n, 0)] if n else [(0, 0)]
    for axis, (u, v) in enumerate(FACTORS, 1):
        place = f"{total}{axis}"
        start = f"s%sums({axis}) + " if n >= WIDE else f"{place} + " if n == 2 or n > 3 else ""
        for low, high in newest:
            yield f"{place} = {start}{u}{low}*{v}{high}"
            start = f"{place} + "
    for axis, name in enumerate("xyz", 1):
        torque = f" + s%m({axis}, {k})" if k <= torque_orders else ""
        # A table costs more than it saves where the torque keeps the processor busy.
        factor = f"s%k{axis}({k})" if torque_orders == 1 else f"(s%k{axis}(1)*INVERSE({k}))"
        yield f"{name}{k} = {factor}*{total}{axis}{torque}"
        first, second = PLACES[name]
        yield f"s%{first}, {k}) = {name}{k}"
        if LAG <= k <= MOST_ORDER - LAG:
            yield f"s%{second}, {k}) = {name}{k}"
        if k == 4:
            yield f"tail{axis} = {name}{k}"
        elif k > 4:
            yield f"tail{axis} = tail{axis} + {name}{k}"


def check(k: int) -> Iterator[str]:
    """Yield the end of the series at order k, where its last two terms are small enough."""
    yield f"if (least <= {k}) then"
    yield f"  last = (abs(x{k}) + abs(x{k - 1})) + (abs(y{k}) + abs(y{k - 1})) &"
    yield f"         + (abs(z{k}) + abs(z{k - 1}))"
    yield f"  if (last <= allowed .or. most <= {k}) then"
    yield f"    s%order = {k}"
    yield "    s%last = last"
    for axis in (1, 2, 3):
        yield f"    s%tail({axis}) = tail{axis}"
    yield "    return"
    yield "  end if"
    yield "end if"


if __name__ == "__main__":
    main(*sys.argv[1:])
