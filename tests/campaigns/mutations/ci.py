"""Four mutations that one short test each must catch, as a proof that the tool works."""

import time

from tests.campaigns.mutations.reach import Check
from tests.campaigns.mutations.sample import Mutation, mutations
from tests.campaigns.mutations.tree import Processes, Tree
from tests.campaigns.mutations.trial import first_failure, put_in, take_out

# File, name, test: one mutation of each language, in lines that hardly ever change. No other change
# to the checkout can make one of them live, so that the gate fails for this reason only.
PLANTED = (
    (
        "fortran/original/linear_solver.fypp", "bound 1: if (scaled > biggest) then",
        "tests/thesis/test_linear_solver.py::"
        "test_rows_are_scaled_and_the_first_of_equal_maxima_is_the_pivot",
    ),
    (
        "fortran/modern/torque_free.f90",
        "sign 1: w(3) = (s2*dn*orbit%amplitude(2)*orbit%omega(3) + sine*cosine*orbit%rates(3))"
        "*inverse",
        "tests/engine/test_closed_form.py::test_any_top_at_any_time",
    ),
    (
        "pyharness/checks/compare/agreement.py",
        "mutmut remove unary ops 1: return np.where(bits >> 63, ~bits, bits | np.uint64(1 << 63))",
        "tests/checks/compare/test_comparison.py::test_ulps_count_representable_values",
    ),
    (
        "web/programs/linear-solver.js",
        "order of operands 1: for (let i = j + 1; i < n; i++) a[i][j] = a[i][j] / a[j][j];",
        "tests/checks/test_port_in_javascript.py::"
        "test_the_javascript_has_the_twins_bits_in_random_scenes",
    ),
)  # fmt: skip


def find(file: str, id: str) -> Mutation:
    return next(each for each in mutations(file) if each.id == id)


def run_planted(processes: Processes) -> int:
    """Try each mutation with its test; return 1 if one lives, or if a test fails without it."""
    begin = time.perf_counter()
    # The planted mutations are in no file that is compiled for each instruction set.
    tree = Tree("planted", processes, "-Dinstruction_sets=plain")
    tests = [Check(test, 10.0, frozenset()) for _, _, test in PLANTED]
    if failed := first_failure(tree, tests):
        print(f"fails without a mutation: {failed.name}")
        return 1
    alive = 0
    for (file, id, _), test in zip(PLANTED, tests, strict=True):
        mutation = find(file, id)
        refused = put_in(mutation, tree)
        caught = refused is None and first_failure(tree, [test]) is not None
        take_out(mutation, tree)
        alive += not caught
        print(f"{'caught' if caught else refused or 'LIVES':7} {file}: {id}", flush=True)
    print(f"{len(PLANTED) - alive} of {len(PLANTED)} caught in {time.perf_counter() - begin:.0f} s")
    return 1 if alive else 0
