"""C code for Taylor series of many bodies, one per vector lane, for fortran/many/tape_lanes.c.

To save loads, sums of products for four successive terms begin together.
"""

import re
from collections.abc import Iterator
from functools import lru_cache

from pyharness.engine.system.leaf_text import TIME, Structure, place, slots_read, unknowns_of
from pyharness.engine.system.leaves import (
    HEADER,
    derivatives,
    first_values,
    kept_values,
    names,
    noises,
    rates_of_term,
    recurrences,
    source,
)
from pyharness.model.codes import Storage

_UNKNOWNS = (3, 7)  # numbers of unknowns that have lanes: without and with attitude
_TOGETHER = 4  # sums
_N_INPUTS = 8  # time, omega and attitude; parameters follow
_MOST_INLINED = 60  # sums; many more would take a minute to compile
_TERMS_AMID = 5  # terms of a series in the middle of a step
_ROW = 7  # length of a row of the Jacobian

_HEADER = (
    f"""
#undef A
#define A(slot, k) a[((slot) - 1) * {Storage.LANE_TERMS} + k]"""
    + """
#if defined(__AVX512F__)
enum { IN_REGISTER = 8 };
#elif defined(__AVX__)
enum { IN_REGISTER = 4 };
#else
enum { IN_REGISTER = 2 };
#endif
typedef double reg __attribute__((vector_size(8 * IN_REGISTER)));
typedef long long reg_bits __attribute__((vector_size(8 * IN_REGISTER)));
static reg half_in_lanes(reg x, reg root)
{
  return (reg)((reg_bits)(x / (2.0 * root)) & (x != 0.0));
}
static reg size_in_lanes(reg x) { return (reg)((reg_bits)x & 0x7fffffffffffffffLL); }
static reg root_in_lanes(reg x)
{
  for (int i = 0; i < IN_REGISTER; i++) x[i] = __builtin_sqrt(x[i]);
  return x;
}
static reg root_slope_in_lanes(reg root) { return (reg)((reg_bits)(0.5 / root) & (root != 0.0)); }
/* The sum of the products of terms 1 to k - 1. */
static reg sum_in_lanes(const reg *x, const reg *y, int k)
{
  reg sum = {0.0};
  for (int j = 1; j < k; j++) sum += x[j] * y[k - j];
  return sum;
}
/* The parts of four such sums, from number k, of products of terms before k. */
static void sums_in_lanes(const reg *x, const reg *y, int k, reg *sums)
{
  reg y1 = y[k - 3], y2 = y[k - 2], y3 = y[k - 1];
  reg a = x[1] * y3 + x[3] * y1, b = x[2] * y3, c = x[3] * y3, d = {0.0};
  reg a2 = x[2] * y2, b2 = x[3] * y2, c2 = {0.0}, d2 = {0.0};
  for (int j = 4; j < k; j += 4) {
    const reg u0 = y[k - j], u1 = y[k - j - 1], u2 = y[k - j - 2], u3 = y[k - j - 3];
    a += x[j] * u0, b += x[j] * y1, c += x[j] * y2, d += x[j] * y3;
    a2 += x[j + 1] * u1, b2 += x[j + 1] * u0, c2 += x[j + 1] * y1, d2 += x[j + 1] * y2;
    a += x[j + 2] * u2, b += x[j + 2] * u1, c += x[j + 2] * u0, d += x[j + 2] * y1;
    a2 += x[j + 3] * u3, b2 += x[j + 3] * u2, c2 += x[j + 3] * u1, d2 += x[j + 3] * u0;
    y1 = u3, y2 = u2, y3 = u1;
  }
  sums[0] = a + a2, sums[1] = b + b2, sums[2] = c + c2, sums[3] = d + d2;
}
/* Begin four such sums, or compute one of few products. */
static __attribute__((noinline))
void begin_sums(const reg *x, const reg *y, int k, int late, reg *sums)
{
  if (k == late) sums[late] = sum_in_lanes(x, y, k);
  else if (late == 0) sums_in_lanes(x, y, k, sums);
}
/* The sum, of which `sums` has the part of products of terms before k - late. */
static SHORT reg late_sum(const reg *x, const reg *y, int k, int late, const reg *sums)
{
  reg sum = sums[late];
  if (k == late || late == 0) return sum;
  sum += x[k - 1] * y[1] + y[k - 1] * x[1];
  if (late == 1) return sum;
  sum += x[k - 2] * y[2] + y[k - 2] * x[2];
  if (late == 2) return sum;
  return sum + (x[k - 3] * y[3] + y[k - 3] * x[3]);
}
"""
)


@lru_cache(maxsize=64)
def whole_source(tape: Structure) -> str:
    """Return C source of the functions for recorded operations, and of their table (see tape.h)."""
    functions, lines = ["0"] * 4, [HEADER]
    if not _has_parameters(tape):
        functions, lines = names(tape), [source(tape)]
    if tape.n_unknowns in _UNKNOWNS:
        is_short = len(recurrences(tape)[1]) <= _MOST_INLINED
        how = "inline" if is_short else "__attribute__((noinline))"
        lines += [f"#define SHORT {how}", _HEADER, *_expand(tape), *_set_jacobian(tape)]
        lines += [*_set_values(tape), *_set_noise(tape)]
        functions += ["expand_lanes", "set_lane_jacobian"]
        functions += ["set_lane_values" if first_values(tape) else "0", "set_lane_noise"]
        functions += ["IN_REGISTER"]
    table = ", ".join(f"(void *){each}" for each in functions)
    return "\n".join([*lines, f"const void *const leaves[9] = {{{table}}};"]) + "\n"


def _in_lanes(text: str) -> str:
    """Return C statements for numbers, rewritten for vector registers."""
    for old, new in {
        "const double t": "const reg t",
        "halved(": "half_in_lanes(",
        "slope_of_root(": "root_slope_in_lanes(",
        "slope_at_root(": "0.5/(",
        "root_of(": "root_in_lanes(",
        "= 0.0;": "= {0.0};",
    }.items():
        text = text.replace(old, new)
    # Code for vectors has no special case for an exponential of a constant.
    text = re.sub(r"\bz\d+ \? 0\.0 : ", "", text)
    text = re.sub(r"\bsize\((?![cd]\[)", "size_in_lanes(", text)
    return re.sub(r"\bk\*", "whole*", text)


def _first_result(tape: Structure) -> int:
    return min((operation[3] for operation in tape.operations), default=_N_INPUTS + 1)


def _has_parameters(tape: Structure) -> bool:
    return tape.n_unknowns in _UNKNOWNS and _first_result(tape) > _N_INPUTS + 1


def _inputs(tape: Structure, texts: list[str], letter: str) -> list[int]:
    """Return the numbers of inputs that C statements read, such as 5 for t5."""
    read = {int(each) for each in re.findall(rf"\b{letter}(\d+)", " ".join(texts))}
    return sorted(slot for slot in read if slot < _first_result(tape))


def _expand(tape: Structure) -> Iterator[str]:
    terms, pairs = recurrences(tape)
    terms = [_in_lanes(each) for each in terms]
    first, later = rates_of_term(tape)
    body = [f"const reg t{x} = {place(x, 'k')};" for x in _inputs(tape, terms + later, "t")]
    body += terms
    for slot, rate in zip(unknowns_of(tape), later, strict=True):
        body.append(f"{place(slot, 'k + 1')} = part*({rate});")
    yield "void expand_lanes(reg *restrict a, const double *restrict c, const double *restrict d,"
    yield "                  const reg *restrict step, int order)\n{"
    yield "  const reg h = *step;"
    yield f"  reg sum[{max(1, len(pairs))}], sums[{max(1, len(pairs))}][{_TOGETHER}];"
    for slot in slots_read(terms + first):
        yield f"  const reg z{slot} = {place(slot, '0')};"
    for slot, rate in zip(unknowns_of(tape), first, strict=True):
        yield f"  {place(slot, '1')} = h*({rate});"
    yield "  for (int k = 1; k < order; k++) {"
    yield f"    const int late = k % {_TOGETHER};"
    yield "    const double whole = k, i = 1.0/whole;"
    yield "    const reg part = h/(whole + 1.0);"
    yield "    if (k == late || late == 0) {"
    both = [f"&A({x}, 0), &A({y}, 0), k, late, sums[{n}]" for n, (x, y) in enumerate(pairs)]
    yield from (f"      begin_sums({each});" for each in both)
    yield "    }"
    yield from (f"    sum[{n}] = late_sum({each});" for n, each in enumerate(both))
    yield from (f"    {each}" for each in body)
    yield "  }\n}"


def _set_jacobian(tape: Structure) -> Iterator[str]:
    lines, rows = derivatives(tape, _TERMS_AMID)
    lines = [_in_lanes(each) for each in lines]
    known = {TIME, *unknowns_of(tape)}
    yield "void set_lane_jacobian(const reg *restrict a, const double *restrict c,"
    yield "                       const double *restrict d, const reg *restrict amid,"
    yield f"                       const reg *restrict step, reg (*restrict jacobian)[{_ROW}])\n{{"
    yield "  const reg u = *amid, w = u*u, h = *step, zero = {0.0}, one = zero + 1.0;"
    for slot in _inputs(tape, lines, "m"):
        if slot not in known:
            yield f"  const reg m{slot} = {place(slot, '0')};"
    yield from (f"  const reg {each};" for each in lines)
    for i, texts in enumerate(rows):
        for j, slot in enumerate(unknowns_of(tape)):
            yield f"  jacobian[{i}][{j}] = h*({texts.get(slot, 'zero')});"
    yield "}"


def _set_values(tape: Structure) -> Iterator[str]:
    if lines := first_values(tape):
        yield "void set_lane_values(reg *restrict a, const double *restrict c,"
        yield "                     const double *restrict d)\n{"
        yield "  const reg zero = {0.0};"
        yield from kept_values([_of_registers(each) for each in lines], [], "reg")
        yield "}"


def _set_noise(tape: Structure) -> Iterator[str]:
    yield "void set_lane_noise(const reg *restrict a, const double *restrict c,"
    yield "                    const double *restrict d, reg *restrict noise)\n{"
    yield "  const reg zero = {0.0};"
    yield from noises(tape, "reg", _of_registers)
    yield "}"


def _of_registers(text: str) -> str:
    """Return a C definition for registers; adding `zero` converts a plain number."""
    return _in_lanes(text).replace("= ", "= zero + ", 1)
