"""The verb `prove`."""

import argparse
import json

from pyharness.cli import options as shared
from pyharness.model.errors import InputError
from pyharness.model.output_files import check_writable, write_files
from pyharness.model.pipes import read_input
from pyharness.truth.certificate import prove
from pyharness.truth.certificate_checker import FORMAT, LARGEST, check_file
from pyharness.truth.enclosed import with_energy
from pyharness.truth.enclosure import MOST_DIGITS, enclose
from pyharness.truth.enclosure_report import certificates_report, enclosure_report

_DIGITS = 25
_MARK = FORMAT.rpartition("-")[0].encode()  # in certificates of every version
OPTIONS = {
    **shared.SCENE,
    "--times T1,T2,...": "Times of the results (s), of one sign and increasing in size; the first "
    "may be 0 (default: the end of the scene's last step).",
    "--digits D": f"Number of digits, 1 to {MOST_DIGITS} (default {_DIGITS}): the half-width of "
    "each interval of omega is at most 10**-D rad/s, or 10**-D of the largest component if that "
    "exceeds 1 rad/s.",
    "--velocity": "Enclose the translational velocity too; needs python-flint.",
    "--transition": "Enclose the derivatives with respect to the initial omega too; needs "
    "python-flint.",
    "--certificate FILE": "Write the steps of the proof to this file (JSON); needs a torque that "
    "depends on time alone; not with --velocity or --transition.",
    "--check FILE,...": "Verify the certificates in these files.",
    **shared.EFFORT_WITHOUT_PROGRAMS,
    **shared.outputs(plot=""),
}
USAGE = "(--case N | --scene FILE | --check FILE,...)"
EXAMPLE = "prove --case 3 --times 1,3"


def run(options: argparse.Namespace) -> int:
    """Print an enclosure of the solution, or check certificates (return 1 if one is invalid)."""
    if options.check is not None:
        return _check(options)
    kinds = ("any_axes", "any_torque", "any_state", "changing")
    scene = shared.chosen_scene(options, **dict.fromkeys(kinds, True))
    end = [scene.times()[-1]]
    times = end if options.times is None else shared.numbers(options.times, "--times")
    digits = shared.whole_up_to(MOST_DIGITS, options.digits, "--digits", _DIGITS)
    effort = shared.chosen_effort(options)
    shared.check_outputs(options)
    if options.certificate is None:
        more = {"velocity": options.velocity, "transition": options.transition}
        found = enclose(scene, times, digits, **more, effort=effort, progress=shared.progress)
    else:
        shared.refuse(options, "--certificate", ("velocity", "transition"))
        if not any(times):
            raise InputError("--certificate: the only time is 0; give a time other than 0")
        check_writable(options.certificate, "--certificate")
        proof = prove(scene, times, digits, effort, shared.progress)
        text = json.dumps(proof.certificate, separators=(",", ":")) + "\n"
        write_files({options.certificate: text.encode()}, "--certificate")
        found = with_energy(scene, proof.enclosure)
    return shared.show(enclosure_report(scene, digits, found), options)


def _check(options: argparse.Namespace) -> int:
    others = ("times", "digits", "velocity", "transition", "certificate", "effort")
    shared.refuse(options, "--check", (*shared.SCENE, *others))
    shared.check_outputs(options)
    found, names = [], shared.names(options.check)
    for number, name in enumerate(names):
        shared.progress(number, len(names), name)
        found.append((name, *check_file(name, _text(name))))
    failed = any(proved is None for _, proved, _ in found)
    return shared.show(certificates_report(found), options, failed=failed)


def _text(name: str) -> str:
    where = f"--check '{name}'"
    content = read_input(name, where, LARGEST, "a certificate")
    if not content.isascii() or _MARK not in content:
        raise InputError(f"{where}: is not a certificate; give a file of prove --certificate")
    return content.decode()
