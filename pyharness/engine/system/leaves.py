"""C code (leaves) for values, Taylor series, Jacobian and rounding errors of recorded operations.

It replaces the interpreter, tape_terms.c and tape_perturbations.c in fortran/modern. Tapes (lists
of operations) that differ only in coefficients share the code, which reads these from memory.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from itertools import chain

from pyharness.engine.system.leaf_text import (
    FIRST_UNKNOWN,
    TIME,
    Listed,
    Structure,
    combined,
    letters,
    numbered_terms,
    place,
    rates_of,
    rule_of,
    slots_read,
    unknowns_of,
    with_slots,
)
from pyharness.model.codes import Operations, Storage
from pyharness.model.recurrences import OPERATIONS, WAVE, Operation

_ABREAST = 4  # products side by side, and at most nodes of the Jacobian, else 2
_CHUNK = 8  # groups of products that are summed together; the registers suffice for 8
_BLOCK = 8  # columns of the Jacobian in a row of its storage
_TERMS_AMID = 16  # terms of a series at a node
_SIZE = -(-Storage.MOST_UNKNOWNS // _BLOCK) * Storage.MOST_UNKNOWNS * _BLOCK  # of a Jacobian

HEADER = (
    f"""
enum {{ SIZE = {_SIZE} }};
#define A(slot, k) a[(slot - 1) * {Storage.SERIES_LENGTH} + k]"""
    + """
typedef double abreast __attribute__((vector_size(32)));
typedef long long bits __attribute__((vector_size(32)));
static double size(double x) { return __builtin_fabs(x); }
static double root_of(double x) { return __builtin_sqrt(x); }
static double slope_at_root(double root) { return 0.5 / (root > 0x1p-1022 ? root : 0x1p-1022); }
static double halved(double x, double root) { return x ? x / (2.0 * root) : 0.0; }
static abreast slope_of_root(abreast root)
{
  const bits is_other = root != 0.0;
  return (abreast)((bits)(0.5 / root) & is_other);
}
#ifdef __clang__
#define MIXED __builtin_shufflevector
#else
#define MIXED(x, y, i, j, k, l) __builtin_shuffle(x, y, (bits){i, j, k, l})
#endif
static void put(double *to, int nodes, double h, abreast a, abreast b, abreast c, abreast d)
{
  const abreast p = MIXED(a, b, 0, 4, 2, 6), q = MIXED(a, b, 1, 5, 3, 7);
  const abreast r = MIXED(c, d, 0, 4, 2, 6), s = MIXED(c, d, 1, 5, 3, 7);
  *(abreast *)to = h * MIXED(p, r, 0, 1, 4, 5);
  *(abreast *)(to + SIZE) = h * MIXED(q, s, 0, 1, 4, 5);
  if (nodes == 2) return;
  *(abreast *)(to + 2 * SIZE) = h * MIXED(p, r, 2, 3, 6, 7);
  *(abreast *)(to + 3 * SIZE) = h * MIXED(q, s, 2, 3, 6, 7);
}
"""
)


@lru_cache(maxsize=64)
def source(tape: Structure, suffix: str = "") -> str:
    """Return the C source of tape.h's functions for one body, static if names get a `suffix`."""
    parts = chain(_expand(tape), _set_jacobian(tape), _set_values(tape), _set_noise(tape))
    text = "\n".join([HEADER, *parts]) + "\n"
    if suffix:
        text = re.sub(r"^void (\w+)", rf"static void \1{suffix}", text, flags=re.M)
    return text


def names(tape: Structure, suffix: str = "") -> list[str]:
    """Return the names of `source`'s functions in the order of tape.h; "0" for a missing one."""
    values = f"set_values{suffix}" if first_values(tape) else "0"
    return [f"expand{suffix}", f"set_jacobian{suffix}", values, f"set_noise{suffix}"]


def recurrences(tape: Structure) -> tuple[list[str], list[tuple[int, int]]]:
    """Return C statements for term k of all results, and the slots whose products they sum."""
    pairs: dict[tuple[int, int], int] = {}
    terms = []
    for operation in tape.operations:
        slots = letters(operation)
        if operation[0] == Operations.LINEAR:
            rule = Operation((f"t_o = {combined(tape, operation[1], 't', is_value=False)}",))
        else:
            rule = rule_of(operation)
        both = [sorted(slots[letter] for letter in pair) for pair in rule.pairs]
        sums = [f"sum[{pairs.setdefault((x, y), len(pairs))}]" for x, y in both]
        for line in rule.series:
            text = with_slots(line, operation)
            for number, each in enumerate(sums):
                text = text.replace(f"s{number}", each)
            terms.append(f"const double {text};")
            terms.append(f"{place(slots[line[2]], 'k')} = t{slots[line[2]]};")
    return terms, list(pairs)


def rates_of_term(tape: Structure) -> tuple[list[str], list[str]]:
    """Return C code for terms 0 and k of the unknowns' derivatives."""
    first = [combined(tape, number, "z", is_value=True) for number in rates_of(tape)]
    return first, [combined(tape, number, "t", is_value=False) for number in rates_of(tape)]


def _expand(tape: Structure) -> Iterator[str]:
    terms, pairs = recurrences(tape)
    groups = [pairs[i : i + _ABREAST] for i in range(0, len(pairs), _ABREAST)]
    for g, group in enumerate(groups):
        terms.append(f"x[{g}][k] = {_vector([f't{x}' for x, _ in group])};")
        terms.append(f"y[{g}][k] = {_vector([f't{y}' for _, y in group])};")
    unknowns = unknowns_of(tape)
    first, later = rates_of_term(tape)
    shape = f"[{max(1, len(groups))}][{Storage.SERIES_LENGTH}]"
    yield "void expand(double *restrict a, const double *restrict c, const double *restrict d,"
    yield "            double *restrict unknowns, double h, int order)\n{"
    yield f"  abreast x{shape}, y{shape}, sums[{max(1, len(groups))}];"
    yield "  const double *const sum = (const double *)sums;"
    for slot in slots_read(terms + first):
        yield f"  const double z{slot} = {place(slot, '0')};"
    for slot, rate in zip(unknowns, first, strict=True):
        yield f"  double t{slot} = h*({rate});"
    yield from _kept(unknowns, "1")
    yield f"  double t{TIME} = {place(TIME, '1')};"
    yield "  for (int k = 1; k < order; k++) {"
    yield "    const double i = 1.0/k, part = h/(k + 1);"
    n_chunks = -(-len(groups) // _CHUNK)
    for c in range(n_chunks):
        chunk = range(c * len(groups) // n_chunks, (c + 1) * len(groups) // n_chunks)
        yield from (f"    abreast s{g} = {{0.0}};" for g in chunk)
        # The newest terms come last, so that the processor need not wait for them.
        yield "    for (int j = 2; j < k - 1; j++) {"
        yield from (f"      s{g} += x[{g}][j]*y[{g}][k - j];" for g in chunk)
        yield "    }"
        yield from (f"    if (k > 2) s{g} += x[{g}][1]*y[{g}][k - 1];" for g in chunk)
        yield from (f"    if (k > 1) s{g} += x[{g}][k - 1]*y[{g}][1];" for g in chunk)
        yield from (f"    sums[{g}] = s{g};" for g in chunk)
    yield from (f"    {each}" for each in terms)
    for slot, rate in zip(unknowns, later, strict=True):
        yield f"    const double next{slot} = part*({rate});"
    yield from (f"    t{slot} = next{slot};" for slot in unknowns)
    yield from _kept(unknowns, "k + 1")
    yield f"    t{TIME} = 0.0;\n  }}\n}}"


def _vector(names: list[str]) -> str:
    return f"(abreast){{{', '.join(names + ['0.0'] * (_ABREAST - len(names)))}}}"


def _kept(unknowns: range, k: str) -> Iterator[str]:
    """Yield C code that stores term k of the unknowns, singly and in groups."""
    yield from (f"  {place(slot, k)} = t{slot};" for slot in unknowns)
    for begin in unknowns[::_ABREAST]:
        at = (begin - FIRST_UNKNOWN) * Storage.PERTURBATION_LENGTH
        names = [f"t{slot}" for slot in range(begin, min(begin + _ABREAST, unknowns.stop))]
        yield f"  *(abreast *)(unknowns + {at} + {_ABREAST}*({k})) = {_vector(names)};"


def _set_jacobian(tape: Structure) -> Iterator[str]:
    yield "void set_jacobian(const double *restrict a, const double *restrict c,"
    yield "                  const double *restrict d, const double *restrict parts, int nodes,"
    yield "                  double h, double *restrict jacobian)\n{"
    yield "  const abreast u = *(const abreast *)parts, w = u*u, zero = {0.0}, one = zero + 1.0;"
    lines, rows = derivatives(tape, _TERMS_AMID)
    yield from (f"  const abreast {each};" for each in lines)
    for i, texts in enumerate(rows):
        for column in range(0, _BLOCK * -(-tape.n_unknowns // _BLOCK), _ABREAST):
            begin = (column // _BLOCK * Storage.MOST_UNKNOWNS + i) * _BLOCK + column % _BLOCK
            row = [texts.get(FIRST_UNKNOWN + column + j, "zero") for j in range(_ABREAST)]
            yield f"  put(jacobian + {begin}, nodes, h, {', '.join(row)});"
    yield "}"


def first_values(tape: Structure) -> list[str]:
    """Return C definitions of term 0 of all results, or [] if the interpreter must compute one."""
    lines = []
    for operation in tape.operations:
        if operation[0] == Operations.LINEAR:
            text = combined(tape, operation[1], "z", is_value=True)
        else:
            rule = rule_of(operation)
            text = with_slots(rule.first or rule.value.replace("m_", "z_"), operation)
        if not text:
            return []
        lines.append(f"z{operation[3]} = {text}")
    return lines


def _set_values(tape: Structure) -> Iterator[str]:
    if lines := first_values(tape):
        yield "void set_values(double *restrict a, const double *restrict c,"
        yield "                const double *restrict d, double *restrict rates)\n{"
        rates, _ = rates_of_term(tape)
        yield from kept_values(lines, rates, "double")
        yield from (f"  rates[{i}] = {each};" for i, each in enumerate(rates))
        yield "}"


def kept_values(lines: list[str], rates: list[str], number: str) -> Iterator[str]:
    """Yield C code that stores term 0 of all results, and defines what `rates` read."""
    results = [int(each[1 : each.index(" ")]) for each in lines]
    for slot in slots_read([each.partition("=")[2] for each in lines] + rates):
        if slot not in results:
            yield f"  const {number} z{slot} = {place(slot, '0')};"
    for slot, line in zip(results, lines, strict=True):
        yield f"  const {number} {line};"
        yield f"  {place(slot, '0')} = z{slot};"


def _roundings(tape: Structure) -> tuple[list[str], list[str]]:
    """Return C code for rounding errors of results and rates, as in fortran/modern/tape_noise.h."""
    # Inputs have no errors.
    known: set[int] = set()
    lines = []

    def of_combination(number: int) -> str:
        parts = [
            f"size(c[{i}])*" + (f"(size(z{slot}) + e{slot})" if slot in known else f"size(z{slot})")
            for i, slot in numbered_terms(tape, number)
        ]
        return " + ".join([*parts, f"size(d[{number - 1}])"] if parts else ["0.0"])

    for operation in tape.operations:
        kind, x, y, out = operation
        if kind == Operations.LINEAR:
            texts = {out: of_combination(x)}
        else:
            rule = rule_of(operation)
            slopes = {out: [*zip((x, y), rule.slopes, strict=False)]}
            if rule.second:
                slopes[out + 1] = [(x, rule.second)]
            # An angle proportional to time has no rounding error.
            is_exact = rule is OPERATIONS[WAVE]
            texts = {
                slot: " + ".join(
                    [with_slots(rule.rounding, operation).replace(f"z{out}", f"z{slot}")]
                    + [
                        f"size({with_slots(of.replace('m_', 'z_'), operation)})*e{operand}"
                        for operand, of in each
                        if operand in known and not is_exact
                    ]
                ).replace("slope_of_root", "slope_at_root")
                for slot, each in slopes.items()
            }
        lines += [f"e{slot} = {text}" for slot, text in texts.items()]
        known |= set(texts)
    return lines, [of_combination(number) for number in rates_of(tape)]


def _set_noise(tape: Structure) -> Iterator[str]:
    yield "void set_noise(const double *restrict a, const double *restrict c,"
    yield "               const double *restrict d, double *restrict noise)\n{"
    yield from noises(tape, "double", str)
    yield "}"


def noises(tape: Structure, number: str, written: Callable[[str], str]) -> Iterator[str]:
    """Yield C statements that bound the rates' rounding errors, in the C type `number`.

    `written` translates a definition to this type.
    """
    lines, rates = _roundings(tape)
    for slot in slots_read(lines + rates):
        yield f"  const {number} z{slot} = {place(slot, '0')};"
    yield from (f"  const {number} {written(each)};" for each in lines)
    yield from (f"  {written(f'noise[{i}] = {each}')};" for i, each in enumerate(rates))


def derivatives(tape: Structure, count: int) -> tuple[list[str], list[dict[int, str]]]:
    """Return C code of all operations' values and derivatives, and each rate's derivatives."""
    # Names of derivatives, by slot and unknown.
    by = {slot: {slot: "one"} for slot in unknowns_of(tape)}
    lines = [_summed(slot, count) for slot in (TIME, *unknowns_of(tape))]
    for operation in tape.operations:
        kind, x, y, out = operation
        if kind == Operations.LINEAR:
            lines.append(f"m{out} = zero + {combined(tape, x, 'm', is_value=True)}")
            slopes = {out: _slopes_of_combination(tape, x, by)}
        else:
            rule = rule_of(operation)
            value = with_slots(rule.value, operation)
            lines.append(f"m{out} = {value}" if value else _summed(out, count))
            if "m_p" in rule.slopes:
                lines.append(_summed(out + 1, count))
            slopes = {out: _products(zip((x, y), rule.slopes, strict=False), operation, by)}
            if rule.second:
                slopes[out + 1] = _products([(x, rule.second)], operation, by)
        for slot, texts in slopes.items():
            by[slot] = {unknown: f"v{slot}_{unknown}" for unknown in texts}
            lines += [f"{by[slot][unknown]} = {text}" for unknown, text in texts.items()]
    return lines, [_slopes_of_combination(tape, number, by) for number in rates_of(tape)]


def _summed(slot: int, count: int) -> str:
    """Return a C definition of a slot's value; even and odd terms have separate sums."""
    sums = ["", ""]
    for k in reversed(range(count)):
        later = sums[k % 2]
        sums[k % 2] = f"({place(slot, str(k))} + w*{later})" if later else place(slot, str(k))
    return f"m{slot} = {sums[0]} + u*{sums[1]}"


def _slopes_of_combination(
    tape: Structure, number: int, by: dict[int, dict[int, str]]
) -> dict[int, str]:
    parts = [
        (unknown, f"c[{i}]*{name}")
        for i, slot in numbered_terms(tape, number)
        for unknown, name in by.get(slot, {}).items()
    ]
    return _sums(parts)


def _products(
    slopes: Iterable[tuple[int, str]], operation: Listed, by: dict[int, dict[int, str]]
) -> dict[int, str]:
    parts = [
        (unknown, f"({with_slots(slope, operation)})*{name}")
        for slot, slope in slopes
        for unknown, name in by.get(slot, {}).items()
    ]
    return _sums(parts)


def _sums(parts: Iterable[tuple[int, str]]) -> dict[int, str]:
    sums: dict[int, list[str]] = {}
    for unknown, text in parts:
        sums.setdefault(unknown, []).append(text)
    return {unknown: " + ".join(texts) for unknown, texts in sums.items()}
