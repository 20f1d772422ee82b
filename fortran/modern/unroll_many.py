"""Write out the step of many series side by side, with one loop over the lanes for each order."""

import itertools
import re
from collections.abc import Iterator

ORDERS = (8, 12, 20)
ATTITUDE_ORDERS = (8, 12, 15, 17)
CARRIED = 7  # order of the exponential that propagates perturbations
MOMENTS = 8  # terms that count in the mean of omega over a step
FACTORS = (("x", "y", "z", "fa"), ("y", "x", "z", "fb"), ("z", "x", "y", "fc"))
BEGINNING = """h = s%h(i)
fa = h*s%a(i, 1)
fb = h*s%a(i, 2)
fc = h*s%a(i, 3)
x0 = s%w(i, 1)
y0 = s%w(i, 2)
z0 = s%w(i, 3)"""
LENGTH = """scale = max(s%scale(i), abs(x0), abs(y0), abs(z0))
allowed = s%local_tolerance(i)*scale
r = ratio({order}, allowed, last)
rest = s%rest(i)
next = h*r
if (abs(next)*s%spin(i) > A_STEP) next = sign(A_STEP/s%spin(i), h)
r = next
if (abs(rest) < two*abs(next)) r = share*rest
if (abs(rest) <= one*abs(next)) r = rest
next = r
r = next/h"""
# Poles of the truncation error, as in estimate_truncation of taylor_error.f90.
POLES = """uu = RIDGE*((ux*ux + uy*uy + uz*uz) + (vx*vx + vy*vy + vz*vz))
vv = RIDGE*((vx*vx + vy*vy + vz*vz) + (wx*wx + wy*wy + wz*wz))
uv = (ux*vx + uy*vy + uz*vz) + (vx*wx + vy*wy + vz*wz)
p = (ux*lx + uy*ly + uz*lz) + (vx*ux + vy*uy + vz*uz)
q = (vx*lx + vy*ly + vz*lz) + (wx*ux + wy*uy + wz*uz)
determinant = uu*vv - uv*uv
r = vv*p - uv*q
q = uv*p - uu*q
determinant = max((determinant - r) + q, abs(r - q), abs(q), LEAST)
p = (r - q)*(allowed/determinant)
q = q*(allowed/determinant)"""
MATRIX = """cx = my*nz - mz*ny
cy = mz*nx - mx*nz
cz = mx*ny - my*nx
oxy = fa*(mz + fc*cz)
oxz = fa*(my - fb*cy)
oyx = fb*(mz - fc*cz)
oyz = fb*(mx + fa*cx)
ozx = fc*(my + fb*cy)
ozy = fc*(mx - fa*cx)
p2 = abs(oxy*oyx) + abs(oxz*ozx) + abs(oyz*ozy)
s%spin(i) = sqrt(p2)/max(abs(next), LEAST)"""
END = """rest = rest - next
s%t(i) = s%t(i) + next
s%rest(i) = rest
s%h(i) = next
s%scale(i) = scale
next = going(rest, next, s%t(i), s%growth(i))
s%going(i) = next"""


def paired(text: str) -> Iterator[str]:
    """Yield a procedure whose loop over m lanes alternates two halves, by three statements each.

    While one half waits, the other one computes. The processor itself does not look so far ahead.
    """
    head, rest = text.split("do i = 1, m\n")
    body, end = rest.split("end do\n", 1)
    declared = re.findall(r"^ *real\(dp\) :: (.*)$", head, flags=re.MULTILINE)
    names = {name for line in declared for name in line.split(", ")}
    lines = [line.strip() for line in body.splitlines() if line.strip()]
    for line in head.rstrip().splitlines():
        yield line
        if "real(dp) ::" in line:
            yield re.sub(r"\w+(?=,|$)", r"\g<0>_2", line.replace("(dp)", "(kind=dp)"))
    yield "do i = 1, m/2"
    for place in range(0, len(lines), 3):
        stage = lines[place : place + 3]
        yield from stage
        yield from (_of_other_half(line, names) for line in stage)
    yield from ("end do\n" + end).replace("\n\n", "\n").splitlines()


def _of_other_half(line: str, names: set[str]) -> str:
    line = re.sub(r"(?<!%)\b[a-z]\w*\b", lambda n: n[0] + "_2" * (n[0] in names), line)
    return line.replace("(i)", "(i + m/2)")


def many_steps() -> Iterator[str]:
    """Yield a procedure for each order, and the one that calls them by order."""
    yield "pure subroutine step(order, waves, m, s)"
    yield "  integer, intent(in) :: order, m"
    yield "  logical, intent(in) :: waves"
    yield "  type(slots_t), intent(inout) :: s"
    yield "  select case (merge(order, -order, waves))"
    for order in ORDERS:
        yield f"  case ({order})"
        yield f"    call waves_{order}(m, s)"
        yield f"  case (-{order})"
        yield f"    call steady_{order}(m, s)"
    yield "  end select"
    yield "end subroutine step"
    for name, order in itertools.product(("waves", "steady"), ORDERS):
        lines = list(one_step(order, name == "waves"))
        names = sorted({line.split(" = ")[0] for line in lines if _is_local(line)})
        yield ""
        yield f"pure subroutine {name}_{order}(m, s)"
        yield "  integer, intent(in) :: m"
        yield "  type(slots_t), intent(inout) :: s"
        yield from (f"  real(dp) :: {name}" for name in names)
        yield "  real(dp) :: one, two, share"
        yield "  integer :: i"
        # In the loop, members of s that are no arrays would keep it from becoming vector code.
        yield from ("  one = s%one", "  two = s%two", "  share = s%part")
        yield "  do i = 1, iand(m, -8)"
        yield from (f"    {line}" for line in lines)
        yield "  end do"
        yield f"end subroutine {name}_{order}"


def attitude_sums() -> Iterator[str]:
    """Yield the procedures of the attitude for each number of terms, and those that call them.

    More terms are computed from those before, which are in memory.
    """
    kinds = (
        ("expand_attitude", "s, w0, h, u", attitude_terms, (
            "type(slots_t), intent(in) :: s", "real(dp), intent(in) :: w0(SLOTS, 3), h(SLOTS)",
            "real(dp), intent(inout) :: u(SLOTS, 4, MOST_TERMS)",
        )),
        ("sum_attitude", "now, r", attitude_sum, (
            "type(attitudes_t), intent(in) :: now", "type(sums_t), intent(inout) :: r",
        )),
    )  # fmt: skip
    for name, given, statements, declared in kinds:
        yield f"pure subroutine {name}(order, m, {given})"
        yield "  integer, intent(in) :: order, m"
        yield from (f"  {line}" for line in declared)
        for before, order in itertools.pairwise((0, *ATTITUDE_ORDERS)):
            is_due = f"order > {before}" if statements is attitude_terms else f"order == {order}"
            yield f"  if ({is_due}) call {name}_{order}(m, {given})"
        yield f"end subroutine {name}"
        for before, order in itertools.pairwise((0, *ATTITUDE_ORDERS)):
            lines = list(statements(before, order))
            names = sorted({line.split(" = ")[0] for line in lines if _is_local(line)})
            yield ""
            yield f"pure subroutine {name}_{order}(m, {given})"
            yield "  integer, intent(in) :: m"
            yield from (f"  {line}" for line in declared)
            yield from (f"  real(dp) :: {local}" for local in names)
            yield "  integer :: i"
            if "now" in given:
                yield "  integer :: latest, previous"
                yield from ("  latest = now%latest", "  previous = 3 - latest")
            yield "  do i = 1, iand(m, -8)"
            yield from (f"    {line}" for line in lines)
            yield "  end do"
            yield f"end subroutine {name}_{order}"
        yield ""


def attitude_terms(before: int, order: int) -> Iterator[str]:
    """Yield the statements for one lane: terms a, b, c, d of the attitude's four numbers.

    The first `before` terms are known.
    """
    yield "f = 0.5_dp*h(i)"
    for axis, x in enumerate("xyz", 1):
        yield f"{x}0 = w0(i, {axis})"
        yield from (f"{x}{k} = s%torque(i, {axis}, {k})" for k in range(1, order))
    if before == 0:
        yield from ("b1 = f*x0", "c1 = f*y0", "d1 = f*z0", "u(i, 1, 1) = 0.0_dp")
        yield from (f"u(i, {place}, 1) = {u}1" for place, u in enumerate("bcd", 2))
    for k in range(1, before + 1):
        yield from (f"{u}{k} = u(i, {n}, {k})" for n, u in enumerate("abcd", 1) if u > "a" or k > 1)
    for k in range(max(before, 1) + 1, order + 1):
        for place, (u, x, products) in enumerate((
            ("a", "", "-bx -cy -dz"), ("b", "x", "+ax +cz -dy"),
            ("c", "y", "+ay +dx -bz"), ("d", "z", "+az +by -cx"),
        ), 1):  # fmt: skip
            total = f"{x}{k - 1}" if x else "0.0_dp"
            for j in range(1, k):
                for product in products.split():
                    sign, first, second = tuple(product)
                    if first == "a" and j == 1:
                        continue  # a1 is 0
                    yield f"p = {total} {sign} {first}{j}*{second}{k - 1 - j}"
                    total = "p"
            yield f"{u}{k} = (f*(1.0_dp/{k}.0_dp))*p"
            yield f"u(i, {place}, {k}) = {u}{k}"


def attitude_sum(_: int, order: int) -> Iterator[str]:
    """Yield the statements for one lane: the sums of two series, and powers of the distances."""
    for place, step, at, power in (
        ("from", "previous", "ahead", "old"), ("to", "latest", "back", "new"),
    ):  # fmt: skip
        yield f"t = r%{at}(i)"
        for axis in range(1, 5):
            yield f"p = now%u(i, {axis}, {order}, {step})*t"
            for k in range(order - 1, 0, -1):
                yield f"p = (p + now%u(i, {axis}, {k}, {step}))*t"
            yield f"r%{place}(i, {axis}) = " + ("1.0_dp + p" if axis == 1 else "p")
        yield "t = abs(t)"
        yield "p = t"
        yield from ("p = p*t" for _ in range(order - 1))
        yield f"r%{power}(i) = p"


def _is_local(line: str) -> bool:
    return " = " in line and line.split(" = ")[0].isidentifier()


def one_step(order: int, waves: bool) -> Iterator[str]:
    """Yield the statements for one lane."""
    yield from BEGINNING.splitlines()
    for k in range(1, order + 1):
        yield from term(k, waves)
    last = " + ".join(f"(abs({x}{order}) + abs({x}{order - 1}))" for x in "xyz")
    yield f"last = {last}"
    yield from LENGTH.format(order=order).splitlines()
    for axis, x in enumerate("xyz", 1):
        yield f"change = {x}{order}*r"
        yield from (f"change = (change + {x}{k})*r" for k in range(order - 1, 0, -1))
        yield f"change = change + s%low(i, {axis})"
        yield f"total = {x}0 + change"
        yield f"part = total - {x}0"
        yield f"s%low(i, {axis}) = ({x}0 - (total - part)) + (change - part)"
        yield f"s%w(i, {axis}) = total"
    # The last four terms of the step, over their allowed size.
    yield f"power = {' * '.join(['r'] * (order - 3))}".replace(" * ", "*")
    yield "power = power/max(allowed, LEAST)"
    for k, name in zip(range(order - 3, order + 1), "wvul", strict=True):
        yield from (f"{name}{x} = {x}{k}*power" for x in "xyz")
        if k < order:
            yield "power = power*r"
    for name, weights in (("m", mean_weight), ("n", moment_weight)):
        for x in "xyz":
            yield f"{name}{x} = ({x}{MOMENTS}*{weights(MOMENTS)})*r"
            for k in range(MOMENTS - 1, 0, -1):
                yield f"{name}{x} = ({name}{x} + {x}{k}*{weights(k)})*r"
            if name == "m":
                yield f"m{x} = m{x} + {x}0"
    yield from (f"{factor} = {factor}*r" for factor in ("fa", "fb", "fc"))
    yield from POLES.splitlines()
    yield from MATRIX.splitlines()
    yield from ("sx = 0.0_dp", "sy = 0.0_dp", "sz = 0.0_dp")
    for column in range(4):  # the error, and the columns of the state-transition matrix
        places = [
            f"error(i, {axis})" if column == 0 else f"small(i, {axis}, {column})"
            for axis in (1, 2, 3)
        ]
        for place, x in zip(places, "xyz", strict=True):
            yield f"d{x} = s%{place}"
            yield f"e{x} = d{x}"
        for k in range(CARRIED, 0, -1):
            yield f"gx = (oxy*ey + oxz*ez)*(1.0_dp/{k}.0_dp) + dx"
            yield f"gy = (oyx*ex + oyz*ez)*(1.0_dp/{k}.0_dp) + dy"
            yield f"ez = (ozx*ex + ozy*ey)*(1.0_dp/{k}.0_dp) + dz"
            yield from ("ex = gx", "ey = gy")
        for place, x in zip(places, "xyz", strict=True):
            # The truncation error of the step is subtracted.
            if column == 0:
                yield f"e{x} = e{x} - (p*l{x} - q*u{x})"
            else:
                yield f"s{x} = s{x} + abs(e{x})"
            yield f"s%{place} = e{x}"
        if column == 0:
            yield "s%worst(i) = max(s%worst(i), abs(ex) + abs(ey) + abs(ez))"
    # A sum, because a maximum may lose a NaN.
    yield "s%growth(i) = max(s%growth(i), sx, sy, sz) + 0.0_dp*((sx + sy) + sz)"
    yield from END.splitlines()


def term(k: int, waves: bool) -> Iterator[str]:
    """Yield term k of the three unknowns, from two sums, so that no sum has to wait for itself."""
    steady = {
        1: "h*(s%constant(i, {axis}) + s%rate(i, {axis})*s%t(i))",
        2: "(0.5_dp*h)*(h*s%rate(i, {axis}))",
    }.get(k)
    pairs = sorted(((j, k - 1 - j) for j in range(k)), key=max)
    for axis, (x, u, v, factor) in enumerate(FACTORS, 1):
        sums = ("p", "q") if len(pairs) > 4 else ("p",)
        for n, (i, j) in enumerate(pairs):
            place = sums[n % len(sums)]
            more = f" + {place}" if n >= len(sums) else ""
            yield f"{place} = {u}{i}*{v}{j}{more}"
        if len(sums) > 1:
            yield "p = p + q"
        more = f" + {steady.format(axis=axis)}" if steady else ""
        more += f" + s%torque(i, {axis}, {k})" if waves else ""
        yield f"{x}{k} = ({factor}*(1.0_dp/{k}.0_dp))*p{more}"
        if waves:  # the attitude needs the terms
            yield f"s%torque(i, {axis}, {k}) = {x}{k}"


def mean_weight(k: int) -> str:
    """Return the weight of term k in the mean of omega: its integral over the step."""
    return f"(1.0_dp/{k + 1}.0_dp)"


def moment_weight(k: int) -> str:
    """Return the weight of term k in the moment: its integral times the time from the middle."""
    return f"({k}.0_dp/{2 * (k + 1) * (k + 2)}.0_dp)"
