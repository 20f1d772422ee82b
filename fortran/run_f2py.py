"""Run f2py, and fail if it meets an unknown kind of number, which it would map to C float."""

import subprocess
import sys


def main(module: str, folder: str, *sources: str) -> int:
    """Write the wrapper of `sources` for extension `module` to `folder`; return an exit status."""
    command = [sys.executable, "-m", "numpy.f2py", *sources, "-m", module, "--lower"]
    command += ["--build-dir", folder]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    output = done.stdout + done.stderr
    guesses = [line for line in output.splitlines() if "is mapped to C" in line]
    if done.returncode or guesses:
        sys.stderr.write(output if done.returncode else "\n".join(guesses) + "\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
