"""Write the performance-critical modules for one instruction set, with the marked loops unrolled.

The names of modules and entry points get suffixes. All modules go into one file, because a compiler
inlines procedures within a file.

If a processor has registers for all three axes, the recurrence is written in C: no Fortran compiler
generates the permutations of their lanes that it needs. Other processors get Fortran, axis by axis.
"""

import re
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path

import layout
from unroll_many import attitude_sums, many_steps, paired

MODULES = (
    "two_words",
    "word_pairs",
    "principal_lanes",
    "principal_frames",
    "step_nodes",
    "torque_terms",
    "scaled_motion",
    "scaled_march",
    "scaled_runge_kutta",
    "taylor_plan",
    "taylor_series",
    "taylor_attitude",
    "taylor_error",
    "taylor_rows",
    "taylor_march",
    "taylor",
    "tape_powers",
    "tape_growth",
    "tape_values",
    "tape_series",
    "tape_plan",
    "tape_steady",
    "tape_roots",
    "tape_switches",
    "tape_crossings",
    "tape_live",
    "tape_runge_kutta",
    "tape_state",
    "tape_error",
    "tape_rows",
    "tape_march",
    "tape_solve",
    "tape_step",
    "tape_variation",
    "many_circular",
    "many_columns",
    "many_orbits",
    "many_growth",
    "many_turns",
    "many_free",
    "many_fixed",
    "many_slots",
    "many_attitudes",
    "many_rows",
    "many_taylor",
    "lanes",
    "lanes_two_term",
    "lanes_four_term",
    "lanes_runge_kutta",
    "many_programs",
)
NAMED = re.compile(rf"\b(module|use) ({'|'.join(MODULES)})\b")
LEAST_ORDER, MOST_ORDER = layout.ORDERS.LEAST_ORDER, layout.ORDERS.MOST_ORDER
ORDERS = range(LEAST_ORDER, MOST_ORDER + 1, 2)
ORDER_CARRIED = 7
# The two factors of the products in equations 13-15, and the arrays in which the plain code stores
# each unknown.
FACTORS = (("y", "z"), ("x", "z"), ("x", "y"))
PLACES = {"x": ("left(2", "left(3"), "y": ("left(1", "right(3"), "z": ("right(1", "right(2")}
# A factor over k is a product with 1/k, which is rounded. The rounding error has the same sign in
# each step, so that the energy would drift in proportion to time. In these terms 1/k is therefore
# corrected by its rounding error. Higher terms cause no drift that could be measured.
CORRECTIONS = {k: float(Fraction(1, k) - Fraction(1.0 / k)) for k in (3, 5, 6)}
WIDE, LAG = 10, 2  # order from which sums are over all axes at once; newest terms not in them
# Offsets of the members of series_t, in numbers.
TERMS, TORQUE, RATES, CHANGE, LANES, TURNS, HALF, TURN = (
    layout.OFFSETS[name]
    for name in ("terms", "torque", "factors", "change", "lanes", "turns", "half", "turn")
)
# What is used of immintrin.h, which takes a third of the time to compile a file.
AVX2 = """typedef double __m256d __attribute__((vector_size(32)));
#define _MM_SHUFFLE(z, y, x, w) ((z) << 6 | (y) << 4 | (x) << 2 | (w))
#define _mm256_permute4x64_pd(v, places) __builtin_ia32_permdf256(v, places)
#define _mm256_permute_pd(v, places) __builtin_ia32_vpermilpd256(v, places)
#define _mm256_fmadd_pd(x, y, z) __builtin_ia32_vfmaddpd256(x, y, z)
#define _mm256_mul_pd(x, y) ((x) * (y))
#define _mm256_add_pd(x, y) ((x) + (y))
#define _mm256_set1_pd(x) ((__m256d){x, x, x, x})
#define _mm256_setr_pd(x, y, z, w) ((__m256d){x, y, z, w})
#define _mm256_setzero_pd() _mm256_set1_pd(0.0)
#define _mm256_load_pd(place) (*(const __m256d *)(place))
#define _mm256_store_pd(place, v) (*(__m256d *)(place) = (v))"""
OTHERS = {1: (2, 3), 2: (1, 3), 3: (1, 2)}  # the other two axes
# Signs of the parts of q (0, x, y, z), axis by axis.
SIGNS = ("-1.0, 1.0, 1.0, -1.0", "-1.0, -1.0, 1.0, 1.0", "-1.0, 1.0, -1.0, 1.0")


def texts(levels: str, *groups: str) -> dict[str, str]:
    """Return files by name: for each of the levels, one with each group, and C for registers.

    A group is its name after a plus sign, then its sources.
    """
    sources_of: dict[str, list[str]] = {}
    for each in groups:
        if each.startswith("+"):
            sources_of[each[1:]] = sources = []
        else:
            sources.append(each)
    found = {}
    for level in levels.split():
        for name, sources in sources_of.items():
            # The name of the file makes those of modules unique: a module may be in several files.
            file = f"{name}_{level}"
            parts = (fortran_source(Path(each).read_text(), level, file) for each in sources)
            found[f"{file}.f90"] = "".join(parts)
        # A register's lanes are turned in C.
        if level != "plain":
            found[f"taylor_terms_{level}.c"] = "\n".join(c_source(level)) + "\n"
    return found


# ---- The recurrence -----------------------------------------------------------------------------


def recurrence(order: int) -> Iterator[str]:
    """Yield the statements for the terms up to `order`, each for three unknowns at once.

    Term k is t; a and b are t rotated by one and by two axes. m is the torque's part of it, f the
    step times A, B, C, i one over k, and e the rounding error of i. Products of older terms are
    summed first and products of the newest term last, so that there is one rotation and two sums
    from one term to the next.
    """
    yield from ("g = f*a0", "h = f*b0", "t1 = g*b0 + m1")
    for k in range(2, order + 1):
        n = k - 1
        pairs = sorted(((j, n - j) for j in range(1, n)), key=max)
        # Two sums, so that no sum has to wait for itself.
        sums = ("q", "r") if len(pairs) > 3 else ("q",)
        for m, (j, i) in enumerate(pairs):
            place = f"{sums[m % len(sums)]}{k}"
            yield f"{place} = a{j}*b{i}" + (f" + {place}" if m >= len(sums) else "")
        if len(sums) > 1:
            yield f"q{k} = q{k} + r{k}"
        if k in CORRECTIONS:
            yield f"u{k} = f*e{k}"
            yield f"u{k} = f*i{k} + u{k}"
            yield from (f"v{k} = u{k}*a0", f"w{k} = u{k}*b0")
        else:
            yield from (f"v{k} = g*i{k}", f"w{k} = h*i{k}")
        if pairs:
            if k not in CORRECTIONS:
                yield f"u{k} = f*i{k}"
            yield f"s{k} = q{k}*u{k} + m{k}"
            yield f"s{k} = v{k}*b{n} + s{k}"
        else:
            yield f"s{k} = v{k}*b{n} + m{k}"
        yield f"t{k} = w{k}*a{n} + s{k}"


# ---- Fortran ------------------------------------------------------------------------------------


def fortran_source(text: str, level: str, file: str) -> str:
    """Return a module for one instruction set; its name ends in the name of the file."""
    text = NAMED.sub(rf"\1 \2_{file}", text)
    text = re.sub(r'(bind\(c, name="\w+_)level"', rf'\1{level}"', text)
    written: dict[str, Iterator[str]] = {
        "expand": fortran_door("expand", "taylor_terms", level),
        "expand_both": fortran_door("expand_both", "attitude_terms", level),
        "multiply": fortran_multiply(),
        "propagate_precisely": fortran_door("propagate_precisely", "variation_terms", level),
        "many_step": many_steps(),
        "many_attitude": attitude_sums(),
    }
    if level == "plain":
        written["expand"] = fortran_terms()
        del written["expand_both"], written["propagate_precisely"]
    blocks = re.split(r" *! unroll: (\w+)\n(.*?) *! end unroll\n", text, flags=re.DOTALL)
    parts = [blocks[0]]
    for name, as_written, rest in zip(blocks[1::3], blocks[2::3], blocks[3::3], strict=True):
        lines = paired(as_written) if name == "paired" and level == "avx512" else written.get(name)
        parts += [as_written] if lines is None else [f"  {line}\n" for line in lines]
        parts.append(rest)
    return "".join(parts)


def fortran_door(name: str, entry: str, level: str) -> Iterator[str]:
    """Yield a procedure that calls the C function for this instruction set."""
    yield from f"""subroutine {name}(order, s)
  integer(c_int), intent(in), value :: order
  type(series_t), intent(inout) :: s
  interface
    subroutine terms(order, s) bind(c, name="{entry}_{level}")
      import :: c_int, series_t
      implicit none(type, external)
      integer(c_int), intent(in), value :: order
      type(series_t), intent(inout) :: s
    end subroutine terms
  end interface
  call terms(order, s)
end subroutine {name}""".splitlines()


def fortran_terms() -> Iterator[str]:
    """Yield the recurrence for a processor that has no register of four numbers.

    Low orders treat each unknown by itself. Higher orders sum the older products of all three side
    by side. Numbers just stored one by one cannot be loaded together without a wait, so the newest
    two terms of each factor are not in those sums.
    """
    yield "subroutine expand(order, s)"
    yield "  integer(c_int), intent(in), value :: order"
    yield "  type(series_t), intent(inout) :: s"
    yield f"  real(dp), dimension(4, 0:{MOST_ORDER}) :: left, right"
    yield "  real(dp) :: sums(4), even, odd"
    names = [f"{name}{k}" for k in range(MOST_ORDER + 1) for name in "xyz"]
    names += [f"{name}{axis}" for name in ("p", "pp", "q", "qq", "tail") for axis in (1, 2, 3)]
    yield from (f"  real(dp) :: {name}" for name in names)
    yield "  integer :: i"
    yield from (f"  {name}0 = s%terms({axis}, 0)" for axis, name in enumerate("xyz", 1))
    yield "  left(4, :) = 0.0_dp"
    yield "  right(4, :) = 0.0_dp"
    for n in range(0, MOST_ORDER, 2):
        if n < WIDE:
            yield from (f"  {line}" for line in known(n))
        yield from (
            f"  {line}" for k, total in ((n + 1, "p"), (n + 2, "q")) for line in term(k, total)
        )
        if n + 2 in ORDERS[:-1]:
            yield f"  if (order == {n + 2}) then"
            yield from (f"    {line}" for line in end_of_terms())
            yield "    return"
            yield "  end if"
    yield from (f"  {line}" for line in end_of_terms())
    yield "end subroutine expand"


def known(n: int) -> Iterator[str]:
    """Yield p1 ... p3 and q1 ... q3: the parts of the Cauchy products n and n + 1 known so far.

    The products are added from the middle outwards, so that the newest terms come last. Two orders
    are computed at once, so that each loaded term is used twice. Each has two sums, so that no sum
    has to wait for itself.
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


def term(k: int, total: str) -> Iterator[str]:
    """Yield term k of the three unknowns from the sums so far and the newest products."""
    n = k - 1
    if n >= WIDE:
        older = sorted(range(LAG, n - LAG + 1), key=lambda j: max(j, n - j))
        yield "do i = 1, 4"
        for m, j in enumerate(older):
            place = ("even", "odd")[m % 2]
            yield f"  {place} = {f'{place} + ' if m > 1 else ''}left(i, {j})*right(i, {n - j})"
        yield "  sums(i) = even + odd"
        yield "end do"
        newest = [pair for j in range(LAG - 1, -1, -1) for pair in ((j, n - j), (n - j, j))]
    else:
        newest = [(1, n - 1), (n - 1, 1)] if total == "q" and n > 2 else []
        newest += [(0, n), (n, 0)] if n else [(0, 0)]
    for axis, (u, v) in enumerate(FACTORS, 1):
        place = f"{total}{axis}"
        start = f"sums({axis}) + " if n >= WIDE else f"{place} + " if n == 2 or n > 3 else ""
        for low, high in newest:
            yield f"{place} = {start}{u}{low}*{v}{high}"
            start = f"{place} + "
    for axis, name in enumerate("xyz", 1):
        # Without a fused multiply-add, a correction would be lost.
        share = f"/{k}.0_dp" if k in CORRECTIONS else f"*(1.0_dp/{k}.0_dp)"
        yield f"{name}{k} = (s%factors({axis}){share})*{total}{axis} + s%torque({axis}, {k})"
        yield f"s%terms({axis}, {k}) = {name}{k}"
        if LAG <= k <= MOST_ORDER - LAG:
            yield from (f"{place}, {k}) = {name}{k}" for place in PLACES[name])
        if k >= 4:
            yield f"tail{axis} = {f'tail{axis} + ' if k > 4 else ''}{name}{k}"
    yield f"s%terms(4, {k}) = 0.0_dp"


def end_of_terms() -> Iterator[str]:
    """Yield the sum of the terms, to which the largest terms are added last."""
    for axis, name in enumerate("xyz", 1):
        yield f"s%change({axis}) = ((tail{axis} + {name}3) + {name}2) + {name}1"
    yield "s%change(4) = 0.0_dp"


def fortran_multiply() -> Iterator[str]:
    """Yield the product of several vectors with the exponential of a matrix of zero diagonal."""
    yield "pure subroutine multiply(o, lanes)"
    yield "  real(dp), intent(in) :: o(6)"
    yield "  real(dp), intent(inout) :: lanes(4, 3)"
    yield "  real(dp) :: x, y, z, u, v, w, p, q, r"
    yield "  integer :: i"
    yield "  do i = 1, 4"
    for axis, (name, copy) in enumerate(zip("xyz", "uvw", strict=True), 1):
        yield f"    {name} = lanes(i, {axis})"
        yield f"    {copy} = {name}"
    for k in range(ORDER_CARRIED, 0, -1):
        yield f"    p = x + (o(1)*v + o(2)*w)*(1.0_dp/{k}.0_dp)"
        yield f"    q = y + (o(3)*u + o(4)*w)*(1.0_dp/{k}.0_dp)"
        yield f"    r = z + (o(5)*u + o(6)*v)*(1.0_dp/{k}.0_dp)"
        yield from ("    u = p", "    v = q", "    w = r")
    yield from (f"    lanes(i, {axis}) = {name}" for axis, name in enumerate("uvw", 1))
    yield "  end do"
    yield "end subroutine multiply"


# ---- C ------------------------------------------------------------------------------------------


def c_source(level: str) -> Iterator[str]:
    """Yield a C function for each order, and those that call them by order."""
    yield "/* Written by unroll.py: the Taylor terms of a step, one register a term. */"
    yield "#include <immintrin.h>" if level == "avx512" else AVX2
    yield from """
/* Lanes x y z and an idle one: turned by one axis, and by two. */
#define TURNED_ONCE(v) _mm256_permute4x64_pd(v, _MM_SHUFFLE(3, 0, 2, 1))
#define TURNED_TWICE(v) _mm256_permute4x64_pd(v, _MM_SHUFFLE(3, 1, 0, 2))
/* A quaternion's parts where its product with the unit of an axis has them, but for signs. */
#define PARTS1(q) _mm256_permute_pd(q, 5)
#define PARTS2(q) _mm256_permute4x64_pd(q, _MM_SHUFFLE(1, 0, 3, 2))
#define PARTS3(q) _mm256_permute4x64_pd(q, _MM_SHUFFLE(0, 1, 2, 3))
#define AXIS(v, n) _mm256_permute4x64_pd(v, 0x55 * (n - 1))
#define EACH(x) _mm256_set1_pd(x)
#define BOTH(low, high) _mm512_insertf64x4(_mm512_castpd256_pd512(low), high, 1)
#define FOLDED(v) _mm256_add_pd(_mm512_castpd512_pd256(v), _mm512_extractf64x4_pd(v, 1))
""".splitlines()
    wide = level == "avx512"
    # An end inside omega's or the attitude's terms would cost up to a tenth of the time of a step.
    for order in ORDERS:
        for name in ("terms", "both"):
            yield f"static void {name}_{order}(double *restrict s)"
            yield from c_body(c_terms(order, name == "both", wide))
    for entry, body in {
        "taylor_terms": c_calls("terms"),
        "attitude_terms": c_calls("both"),
        "variation_terms": c_variations(wide),
    }.items():
        yield f"void {entry}_{level}(int order, double *restrict s)"
        yield from c_body(body)


def c_calls(name: str) -> Iterator[str]:
    yield "switch (order) {"
    yield from (f"case {order}: {name}_{order}(s); break;" for order in ORDERS)
    yield "}"


def c_body(lines: Iterable[str]) -> Iterator[str]:
    yield "{"
    yield from (f"  {line}" for line in lines)
    yield "}"


def c_terms(order: int, with_attitude: bool, wide: bool) -> Iterator[str]:
    """Yield the statements for omega, mixed with those for the attitude, which wait less."""
    yield f"const __m256d f = {load(RATES)}, t0 = {load(TERMS)};"
    yield "const __m256d a0 = TURNED_ONCE(t0), b0 = TURNED_TWICE(t0);"
    if with_attitude:
        yield f"const __m256d half = {load(HALF)};"
        for axis, signs in enumerate(SIGNS, 1):
            yield f"const __m256d h{axis} = _mm256_mul_pd(half, _mm256_setr_pd({signs}));"
        yield f"const __m256d k0 = {load(TURNS)};"
        yield from ready_for_products(0, wide)
    known: set[str] = set()
    for line in recurrence(order):
        yield c(line, known)
        term = re.match(r"t(\d+) ", line)
        if not term:
            continue
        k = int(term[1])
        yield f"_mm256_store_pd(s + {TERMS + 4 * k}, t{k});"
        if k < order:
            yield f"const __m256d a{k} = TURNED_ONCE(t{k}), b{k} = TURNED_TWICE(t{k});"
        if k == 5:
            yield c("c = t4 + t5", known)
        elif k > 5:
            yield c(f"c = c + t{k}", known)
        if with_attitude:
            yield from attitude_term(k, wide)
            yield from ready_for_products(k, wide)
            if k == 5:
                yield c("d = k4 + k5", known)
            elif k > 5:
                yield c(f"d = d + k{k}", known)
    yield from (c(f"c = c + t{k}", known) for k in (3, 2, 1))
    yield f"_mm256_store_pd(s + {CHANGE}, c);"
    if with_attitude:
        k = order + 1
        yield from attitude_term(k, wide)
        # Omega has no term of this order.
        yield f"const __m256d t{k} = _mm256_setzero_pd();"
        yield from ready_for_products(k, wide)
        yield from attitude_term(k + 1, wide)
        yield from (c(f"d = d + k{k}", known) for k in (3, 2, 1))
        yield f"_mm256_store_pd(s + {TURN}, d);"


def ready_for_products(k: int, wide: bool) -> Iterator[str]:
    """Yield the factors that term k of omega and term k of the attitude contribute to products.

    A wide register has two terms: k - 1 and k of the attitude, or k and k - 1 of omega.
    """
    for axis in (1, 2, 3):
        yield f"const __m256d o{axis}_{k} = _mm256_mul_pd(AXIS(t{k}, {axis}), h{axis});"
        yield f"const __m256d p{axis}_{k} = PARTS{axis}(k{k});"
    if wide:
        for axis in (1, 2, 3):
            if k > 1:
                yield f"const __m512d oo{axis}_{k} = BOTH(o{axis}_{k}, o{axis}_{k - 1});"
            if k % 2:
                yield f"const __m512d pp{axis}_{k} = BOTH(p{axis}_{k - 1}, p{axis}_{k});"


def attitude_term(k: int, wide: bool) -> Iterator[str]:
    """Yield term k of the attitude: products with omega over k, those of the newest term last."""
    older = range(k - 1)
    if wide:
        pairs = [i for i in older if i % 2 and i < k - 1]
        # Products whose factors are known earlier come first: sums then wait only for the newest.
        for n, i in enumerate(sorted(pairs, key=lambda i: max(i, k - i))):
            for axis in (1, 2, 3):
                given = f"pp{axis}_{i}, oo{axis}_{k - i}"
                if n:
                    yield f"e{axis}_{k} = _mm512_fmadd_pd({given}, e{axis}_{k});"
                else:
                    yield f"__m512d e{axis}_{k} = _mm512_mul_pd({given});"
        if pairs:
            sums = f"_mm512_add_pd(e1_{k}, _mm512_add_pd(e2_{k}, e3_{k}))"
            yield f"__m256d e{k} = FOLDED({sums});"
        rest = [i for i in older if not i % 2 and i + 1 not in older]
    else:
        pairs, rest = [], list(older)
    for n, i in enumerate(rest):
        for axis in (1, 2, 3):
            given = f"p{axis}_{i}, o{axis}_{k - 1 - i}"
            if wide and pairs:
                yield f"e{k} = _mm256_fmadd_pd({given}, e{k});"
            elif wide:
                start = f"__m256d e{k} = _mm256_mul_pd({given});"
                yield start if axis == 1 else f"e{k} = _mm256_fmadd_pd({given}, e{k});"
            elif n:
                yield f"e{axis}_{k} = _mm256_fmadd_pd({given}, e{axis}_{k});"
            else:
                yield f"__m256d e{axis}_{k} = _mm256_mul_pd({given});"
    if not wide and rest:
        yield f"__m256d e{k} = _mm256_add_pd(e1_{k}, _mm256_add_pd(e2_{k}, e3_{k}));"
    for axis in (1, 2, 3):
        yield f"const __m256d n{axis}_{k} = {c_over(f'o{axis}_0', k)};"
    newest = f"_mm256_mul_pd(p3_{k - 1}, n3_{k})"
    yield f"const __m256d y{k} = _mm256_fmadd_pd(p2_{k - 1}, n2_{k}, {newest});"
    first = f"p1_{k - 1}, n1_{k}"
    if k > 1:
        yield f"const __m256d z{k} = _mm256_fmadd_pd({first}, {c_over(f'e{k}', k)});"
    else:
        yield f"const __m256d z{k} = _mm256_mul_pd({first});"
    yield f"const __m256d k{k} = _mm256_add_pd(y{k}, z{k});"
    yield f"_mm256_store_pd(s + {TURNS + 4 * k}, k{k});"


def c_variations(wide: bool) -> Iterator[str]:
    """Yield the linear part of the recurrence for four perturbations of omega, one a lane.

    Term k of the perturbation of an axis is v1_k, v2_k or v3_k. A wide register has the terms of
    two axes, and the terms of omega that they are multiplied by. Two orders are summed at once, so
    that each loaded term is used twice. Products with the newest terms are added last.
    """
    yield f"const __m256d v1_0 = {load(LANES)}, v2_0 = {load(LANES + 4)}, v3_0 = {load(LANES + 8)};"
    for axis, (u, v) in OTHERS.items():
        yield f"const __m256d f{axis} = EACH(s[{RATES + axis - 1}]);"
        # Axis u is multiplied by the omega of axis v, and the other way round.
        for mine, other in ((u, v), (v, u)):
            factor = f"EACH(s[{TERMS + other - 1}])"
            yield f"const __m256d n{axis}{mine} = _mm256_mul_pd(f{axis}, {factor});"
    yield "__m256d sum1 = v1_0, sum2 = v2_0, sum3 = v3_0;"
    yield from older_factors(0, wide)
    for k in range(1, MOST_ORDER, 2):
        yield from (line for j in (k - 1, k) if j for line in omega_factors(j, wide))
        for i in range(k):
            for axis in OTHERS:
                for m in (k, k + 1):
                    if m - 1 > i:
                        yield from older_product(axis, m, i, wide)
        for m in (k, k + 1):
            for axis, (u, v) in OTHERS.items():
                value = f"_mm256_mul_pd(n{axis}{u}, v{u}_{m - 1})"
                if m > 1:
                    older = f"FOLDED(e{axis}_{m})" if wide else f"e{axis}_{m}"
                    older = f"_mm256_mul_pd(f{axis}, {older})"
                    value = f"_mm256_fmadd_pd(n{axis}{u}, v{u}_{m - 1}, {older})"
                value = f"_mm256_fmadd_pd(n{axis}{v}, v{v}_{m - 1}, {value})"
                value = f"_mm256_mul_pd({value}, _mm256_set1_pd(1.0 / {m}))"
                yield f"const __m256d v{axis}_{m} = {value};"
                yield f"sum{axis} = _mm256_add_pd(sum{axis}, v{axis}_{m});"
            yield from older_factors(m, wide)
        if k + 1 in ORDERS:
            places = {axis: LANES + 4 * axis - 4 for axis in OTHERS}
            yield f"if (order == {k + 1}) {{"
            yield from (f"  _mm256_store_pd(s + {at}, sum{axis});" for axis, at in places.items())
            yield from ("  return;", "}")


def older_factors(k: int, wide: bool) -> Iterator[str]:
    """Yield the registers of two axes that term k of the perturbations contributes to products."""
    if wide:
        for axis, (u, v) in OTHERS.items():
            yield f"const __m512d vv{axis}_{k} = BOTH(v{u}_{k}, v{v}_{k});"


def omega_factors(j: int, wide: bool) -> Iterator[str]:
    """Yield the registers that term j of omega contributes to products."""
    if not wide:
        yield from (
            f"const __m256d w{axis}_{j} = EACH(s[{TERMS + 4 * j + axis - 1}]);"
            for axis in (1, 2, 3)
        )
        return
    yield f"const __m512d w_{j} = _mm512_broadcast_f64x4({load(TERMS + 4 * j)});"
    for axis, (u, v) in OTHERS.items():
        places = ", ".join([str(v - 1)] * 4 + [str(u - 1)] * 4)
        yield (
            f"const __m512d ww{axis}_{j} = "
            f"_mm512_permutexvar_pd(_mm512_setr_epi64({places}), w_{j});"
        )


def older_product(axis: int, m: int, i: int, wide: bool) -> Iterator[str]:
    """Yield the sum e for term m of an axis with the product of term i of the perturbations."""
    u, v = OTHERS[axis]
    j, total = m - 1 - i, f"e{axis}_{m}"
    if wide:
        given = f"vv{axis}_{i}, ww{axis}_{j}"
        if i == 0:
            yield f"__m512d {total} = _mm512_mul_pd({given});"
        else:
            yield f"{total} = _mm512_fmadd_pd({given}, {total});"
        return
    for n, (mine, other) in enumerate(((u, v), (v, u))):
        given = f"v{mine}_{i}, w{other}_{j}"
        if i == 0 and n == 0:
            yield f"__m256d {total} = _mm256_mul_pd({given});"
        else:
            yield f"{total} = _mm256_fmadd_pd({given}, {total});"


def c_over(value: str, k: int) -> str:
    """Return the C expression of a register over k."""
    whole = f"{value}, _mm256_set1_pd(1.0 / {k})"
    if k in CORRECTIONS:
        rest = f"_mm256_mul_pd({value}, _mm256_set1_pd({CORRECTIONS[k]}))"
        return f"_mm256_fmadd_pd({whole}, {rest})"
    return f"_mm256_mul_pd({whole})"


def c(line: str, known: set[str]) -> str:
    """Return a C statement for a register, which the statement declares if it is new."""
    target, value = line.split(" = ")
    value = re.sub(r"\bi(\d+)", r"_mm256_set1_pd(1.0 / \1)", value)
    value = re.sub(r"\be(\d+)", lambda k: f"_mm256_set1_pd({CORRECTIONS[int(k[1])]})", value)
    value = re.sub(r"\bm(\d+)", lambda found: load(TORQUE + 4 * int(found[1]) - 4), value)
    first, _, second = value.partition(" + ")
    if "*" not in first:
        value = f"_mm256_add_pd({first}, {second})"
    elif second:
        value = f"_mm256_fmadd_pd({first.replace('*', ', ')}, {second})"
    else:
        value = f"_mm256_mul_pd({first.replace('*', ', ')})"
    declared = "" if target in known else "__m256d "
    known.add(target)
    return f"{declared}{target} = {value};"


def load(place: int) -> str:
    """Return the C expression that loads four numbers at an offset of series_t."""
    return f"_mm256_load_pd(s + {place})"
