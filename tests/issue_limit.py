"""`python -m tests.issue_limit`: how near the loop of RK4 on many bodies is to its issue limit.

The kernels of many bodies are compiled to assembly as in the build, and once more with a changed
loop of RK4. In the changed loop no arithmetic instruction waits for another: each reads one
register, which is set to 0 before the loop and not written in it. The number and the kinds of the
instructions do not change, nor do loads, stores and counting. A fused multiply-add also reads the
register that it writes; these registers rotate, so that each was written long before. Both versions
solve in turn a block of bodies in the nearest cache, and the shortest run of each counts. The time
without dependencies over the time with them is the fraction of the limit that is reached.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.instruction_sets import LEVELS, level_here

ROOT = Path(__file__).parent.parent
FORTRAN = ROOT / "fortran"
IDLE = 15  # the register that the changed loop reads
FUSED = 18  # a step of a register: four times three products, and twice three at the end
BODIES, STEPS = 64, 400_000
ROUNDS = 41
SOURCES = (
    "modern/two_words", "modern/torque_terms", "modern/taylor_plan", "many/many_circular",
    "many/many_columns", "many/many_orbits", "many/many_turns", "many/many_free", "many/many_fixed",
    "many/many_slots", "many/many_attitudes", "many/many_taylor",
)  # fmt: skip
COMMON = ("kinds", "interruption", "modern/problem", "modern/torque_noise", "many/bodies")
KINDS = {
    "fused": r"vfn?m(add|sub)\w+",
    "add": r"v(add|sub)pd",
    "multiply": r"vmulpd",
    "move, load, store": r"vmov[au]pd",
}
DRIVER = """program driver
  use, intrinsic :: iso_c_binding, only: c_int, c_loc, c_long, c_ptr
  use bodies, only: bodies_t, i1
  use kinds, only: dp
  use methods, only: RK4
  implicit none (type, external)
  interface
    subroutine solve(bodies_at, method, n, omega, status, interrupted) &
      bind(c, name="solve_many_fixed_LEVEL")
      import :: c_int, c_ptr, dp, i1
      type(c_ptr), intent(in), value :: bodies_at
      integer(c_int), intent(in), value :: method, n
      real(dp), intent(inout) :: omega(3, *)
      integer(i1), intent(inout) :: status(*)
      integer(c_int), intent(out) :: interrupted
    end subroutine solve
    integer(c_long) function processor_time() bind(c, name="clock")  ! us, of this process
      import :: c_long
    end function processor_time
  end interface
  integer, parameter :: n = N_BODIES
  type(bodies_t), target :: given
  real(dp) :: omega(3, n)
  integer(i1) :: status(n)
  integer(c_int) :: interrupted
  integer(c_long) :: start, finish
  integer :: i
  given%by_moments = .true.
  given%tolerance = 1e-12_dp
  given%step = 0.01_dp
  given%n = n
  allocate (given%body(3, 1), given%constant(3, n), given%rate(3, 1), given%omega0(3, n))
  allocate (given%sines(4, 0, 1), given%cosines(4, 0, 1), given%times(1))
  given%body(:, 1) = [40.0_dp, 30.0_dp, 20.0_dp]
  given%rate = 0.0_dp
  given%times = 0.01_dp*N_STEPS
  do i = 1, n
    ! So little that the bodies are not spun up.
    given%constant(:, i) = [1e-6_dp, 2e-6_dp, -1e-6_dp]*i
    given%omega0(:, i) = [0.3_dp, 1.0_dp, -0.5_dp] + 0.01_dp*i
  end do
  start = processor_time()
  call solve(c_loc(given), int(RK4, c_int), int(n, c_int), omega, status, interrupted)
  finish = processor_time()
  print *, real(finish - start, dp)*1e-6_dp, sum(omega)
end program driver
"""


def main(arguments: Sequence[str]) -> int:
    """Print the steps of bodies per second as built, at the limit, and the fraction reached."""
    levels = [name for name in LEVELS[level_here() : 0 : -1] if not arguments or name in arguments]
    if not levels:
        print("no AVX2 or AVX-512 here, in this build or among the names given")
        return 1
    for level in levels:
        with tempfile.TemporaryDirectory() as folder:
            report(level, Path(folder))
    return 0


def report(level: str, folder: Path) -> None:
    """Compile, time and print for one instruction set."""
    assembly = compiled(level, folder)
    changed, loop = without_dependencies(assembly, level)
    programs = [
        linked(text, name, level, folder)
        for name, text in (("as_it_is", assembly), ("limit", changed))
    ]
    best = [float("inf")] * 2
    for _ in range(ROUNDS):
        for k, program in enumerate(programs):
            told = subprocess.run([program], check=True, capture_output=True, text=True).stdout
            best[k] = min(best[k], float(told.split()[0]))
    kinds = Counter(kind_of(line) for line in loop)
    told = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    lanes = kinds["fused"] // FUSED * (8 if level == "avx512" else 4)
    print(f"{level}: a step of {lanes} bodies is {len(loop)} instructions: {told}")
    rates = [BODIES * STEPS / seconds / 1e6 for seconds in best]
    print(f"  as it is             {rates[0]:7.0f} million body-steps/s")
    print(f"  without dependencies {rates[1]:7.0f}")
    print(f"  part of the limit    {best[1] / best[0]:7.2f}", flush=True)


def flags(level: str) -> list[str]:
    """Return the compiler flags of the build, from its record."""
    (built,) = (ROOT / "build").glob("cp*/build.ninja")
    text = built.read_text()
    rule = re.search(rf"^build libbodies_{level}\.a\.p/\S*\.o: fortran.*?ARGS = (.*?)$",
                     text, flags=re.DOTALL | re.MULTILINE)  # fmt: skip
    assert rule is not None
    return [each for each in rule[1].split() if not each.startswith(("-I", "-J", "-fdiag"))]


def compiled(level: str, folder: Path) -> str:
    """Return the assembly of the kernels of many bodies; compile the modules that they use."""
    given = [str(FORTRAN / f"{name}.f90") for name in SOURCES]
    target = f"bodies_{level}.f90"
    unroll = [sys.executable, str(FORTRAN / "modern/unroll.py"), level, target]
    subprocess.run([*unroll, *given], cwd=folder, check=True)
    codes = [sys.executable, str(FORTRAN / "make_codes.py"), str(ROOT / "pyharness/model/codes.py")]
    subprocess.run([*codes, "."], cwd=folder, check=True)
    for source in (
        "methods.f90",
        "series.f90",
        "statuses.f90",
        *(str(FORTRAN / f"{name}.f90") for name in COMMON),
    ):
        gfortran(folder, "-O2", "-c", source)
    gfortran(folder, *flags(level), "-S", target, "-o", "bodies.s")
    return (folder / "bodies.s").read_text()


def without_dependencies(assembly: str, level: str) -> tuple[str, list[str]]:
    """Return the assembly with changed loops of RK4, and the first of these loops unchanged."""
    wide = "zmm" if level == "avx512" else "ymm"
    lines = assembly.splitlines()
    begin = next(i for i, line in enumerate(lines) if line == f"solve_many_fixed_{level}:")
    end = next(i for i in range(begin, len(lines)) if ".cfi_endproc" in lines[i])
    found: list[str] = []
    label, first = "", begin
    for i in range(begin, end):
        if labelled := re.match(r"(\.L\w+):", lines[i]):
            label, first = labelled[1], i + 1
        if re.match(rf"\s+j\w+\s+{re.escape(label)}$", lines[i]) and label:
            loop = lines[first : i + 1]
            fused = [line for line in loop if kind_of(line) == "fused" and wide in line]
            # The compiler advances two registers in turn, or only one.
            if len(fused) in (FUSED, 2 * FUSED):
                lines[first : i + 1] = independent(loop, wide)
                # All registers are written, so that one is set to 0 before the loop and left alone
                # in it.
                zero = f"%{wide}{IDLE}"
                lines[first - 1] = f"\tvxorpd\t{zero}, {zero}, {zero}\n{lines[first - 1]}"
                found = found or loop
    assert found, "the loop of RK4 was not found"
    return "\n".join(lines) + "\n", found


def independent(loop: Sequence[str], wide: str) -> list[str]:
    """Return a loop of the same kinds of vector instructions, none of which waits for another."""
    count = 32 if wide == "zmm" else 16
    register = re.compile(rf"%{wide}(\d+)")
    free = [each for each in range(count) if each != IDLE]
    # A register that is only written is renamed inside the processor each time.
    plain_ones, round_ones = free[:2], free[2:]
    used: Counter[str] = Counter()
    result = []
    for line in loop:
        parts = line.rsplit(",", 1)
        target = register.fullmatch(parts[-1].strip())
        if not register.search(line):
            result.append(line)
        elif target is None:  # a store
            result.append(register.sub(f"%{wide}{IDLE}", line))
        else:
            kind = "round" if kind_of(line) == "fused" else "plain"
            some = round_ones if kind == "round" else plain_ones
            place = some[used[kind] % len(some)]
            used[kind] += 1
            sources = register.sub(f"%{wide}{IDLE}", parts[0])
            result.append(f"{sources}, %{wide}{place}")
    return result


def kind_of(line: str) -> str:
    """Return the kind of an instruction."""
    name = line.split()[0]
    return next((kind for kind, text in KINDS.items() if re.fullmatch(text, name)), "counting")


def linked(text: str, name: str, level: str, folder: Path) -> str:
    """Return a program that times the kernels of an assembly."""
    (folder / f"{name}.s").write_text(text)
    driver = DRIVER.replace("LEVEL", level).replace("N_BODIES", str(BODIES))
    (folder / "driver.f90").write_text(driver.replace("N_STEPS", str(STEPS)))
    never = str(ROOT / "tests/never_interrupted.f90")
    gfortran(folder, "-O1", "driver.f90", f"{name}.s", never, *objects(), "-o", name)
    return str(folder / name)


def objects() -> list[str]:
    """Return the object files of the modules that the kernels use."""
    return ["codes.o", *(f"{Path(name).name}.o" for name in COMMON)]


def gfortran(folder: Path, *arguments: str) -> None:
    """Call the compiler; raise CalledProcessError if it fails."""
    subprocess.run([os.environ.get("FC", "gfortran"), *arguments], cwd=folder, check=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
