"""Write a hot module for one instruction set: other names, and the marked loops written out."""

import re
import sys
from collections.abc import Iterator

MODULES = ("taylor", "euler_equations")
MOST_ORDER = 28
FIRST_CHECK = 6


def main(source: str, target: str, level: str) -> None:
    """Read `source`, write `target`; names in it end in `level`."""
    with open(source) as file:
        text = file.read()
    for module in MODULES:
        text = re.sub(rf"\b(module|use) {module}\b", rf"\1 {module}_{level}", text)
    text = re.sub(r'(bind\(c, name="\w+_)level"', rf'\1{level}"', text)
    blocks = re.split(r" *! unroll: m (\d+)\n.*?! end unroll\n", text, flags=re.DOTALL)
    parts = [blocks[0]]
    for orders, rest in zip(blocks[1::2], blocks[2::2], strict=True):
        locals_ = [f"{name}{k}" for k in range(MOST_ORDER + 1) for name in "xyz"]
        parts[-1] = parts[-1].rstrip() + "\n"
        parts.append("".join(f"    real(dp) :: {each}\n" for each in [*locals_, *LOCALS]))
        parts.append("".join(f"    {line}\n" for line in series(int(orders))))
        parts.append(rest)
    with open(target, "w") as file:
        file.write("".join(parts))


LOCALS = ("p1", "p2", "p3", "q1", "q2", "q3", "tail1", "tail2", "tail3", "last")


def series(torque_orders: int) -> Iterator[str]:
    """Yield the statements; the torque has terms in the first `torque_orders` orders."""
    for name in "xyz":
        yield f"{name}0 = s%{name}(0)"
    for k in range(1, MOST_ORDER + 1):
        yield from products(k - 1)
        for axis, name in enumerate("xyz", 1):
            torque = f" + s%m({k}, {axis})" if k <= torque_orders else ""
            yield f"{name}{k} = s%k{axis}({k})*p{axis}{torque}"
            yield f"s%{name}({k}) = {name}{k}"
            if k == 4:
                yield f"tail{axis} = {name}{k}"
            elif k > 4:
                yield f"tail{axis} = tail{axis} + {name}{k}"
        if k >= FIRST_CHECK and k % 2 == 0:
            yield f"if (least <= {k}) then"
            yield f"  last = (abs(x{k}) + abs(x{k - 1})) + (abs(y{k}) + abs(y{k - 1})) &"
            yield f"         + (abs(z{k}) + abs(z{k - 1}))"
            yield f"  if (last <= allowed .or. most <= {k}) then"
            yield f"    s%order = {k}"
            yield "    s%last = last"
            yield "    s%tail(1) = tail1"
            yield "    s%tail(2) = tail2"
            yield "    s%tail(3) = tail3"
            yield "    return"
            yield "  end if"
            yield "end if"


def products(n: int) -> Iterator[str]:
    """Yield p1 ... p3, the Cauchy products of order n: two sums each, the newest terms last."""
    factors = (("y", "z"), ("x", "z"), ("x", "y"))
    begun = set()
    for low in range(n // 2, -1, -1):
        for j, total in ((low, "p"), (n - low, "q")) if 2 * low < n else ((low, "p"),):
            for axis, (u, v) in enumerate(factors, 1):
                # The newest term joins the sum that is complete.
                sums = f"{total}{axis}"
                if low == 0 and n >= 3:
                    if total == "p":
                        yield f"p{axis} = (p{axis} + q{axis}) + {u}{j}*{v}{n - j}"
                    else:
                        yield f"p{axis} = p{axis} + {u}{j}*{v}{n - j}"
                elif low == 0 and n and total == "q":
                    yield f"p{axis} = p{axis} + {u}{j}*{v}{n - j}"
                elif sums in begun:
                    yield f"{sums} = {sums} + {u}{j}*{v}{n - j}"
                else:
                    yield f"{sums} = {u}{j}*{v}{n - j}"
                    begun.add(sums)


if __name__ == "__main__":
    main(*sys.argv[1:])
