"""Build the conda recipe without a channel: `python .ci/conda/build.py` in an environment.

The environment has py-rattler-build and the dependency group `build`. The packages that the recipe
requires are placeholders in a local channel, without content. The placeholder of Python calls the
Python of the environment, and the compilers are those of the machine. The built package therefore
shows that the recipe is understood, that its script builds the project, and that the result has the
extension and the command; it is not for use. The output is in the folder build/conda.
"""

import hashlib
import json
import shutil
import sys
from pathlib import Path

import rattler_build

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / "build" / "conda"
PLATFORM = "linux-64"
# The script pip of an environment would install into the environment.
PYTHON = """#!/bin/sh
prefix=$(cd "$(dirname "$0")/.." && pwd)
PATH={tools}:/usr/bin:/bin:$PATH PIP_PREFIX=$prefix \\
  PIP_IGNORE_INSTALLED=1 exec {python} "$@"
"""


def rendered() -> rattler_build.RenderedVariant:
    """Return the recipe for this machine and the version of this Python."""
    python = f"{sys.version_info[0]}.{sys.version_info[1]}"
    variants = f"python: ['{python}.*']\nc_stdlib: ['sysroot']\n"
    platform = rattler_build.PlatformConfig(target_platform=PLATFORM)
    (found,) = rattler_build.Stage0Recipe.from_file(Path(__file__).with_name("recipe.yaml")).render(
        rattler_build.VariantConfig.from_yaml(variants), rattler_build.RenderConfig(platform)
    )
    return found


def make_channel(folder: Path, requirements: list[str]) -> None:
    """Write a channel of placeholders that satisfy the requirements."""
    stage = folder / "python"
    (stage / "bin").mkdir(parents=True)
    python = stage / "bin" / "python"
    python.write_text(PYTHON.format(tools=Path(sys.executable).parent, python=sys.executable))
    python.chmod(0o755)
    packages = {}
    for name in requirements:
        version = ".".join(map(str, sys.version_info[:3])) if name == "python" else "99.0"
        out = rattler_build.assemble_package(
            name, version, PLATFORM, "h0_0", folder / PLATFORM,
            files_dir=stage if name == "python" else None,
        )  # fmt: skip
        data = Path(out.path).read_bytes()
        packages[Path(out.path).name] = {
            "name": name, "version": version, "build": "h0_0", "build_number": 0, "depends": [],
            "subdir": PLATFORM, "size": len(data), "sha256": hashlib.sha256(data).hexdigest(),
        }  # fmt: skip
    for subdir, content in ((PLATFORM, packages), ("noarch", {})):
        (folder / subdir).mkdir(exist_ok=True)
        text = {"info": {"subdir": subdir}, "packages": {}, "packages.conda": content}
        (folder / subdir / "repodata.json").write_text(json.dumps(text))


def main() -> int:
    """Build the recipe, and print the name of the package and the number of its files."""
    shutil.rmtree(PLACE, ignore_errors=True)
    recipe = rendered()
    needed = recipe.recipe.to_dict()["requirements"]
    names = {each.split()[0] for group in ("build", "host", "run") for each in needed[group]}
    make_channel(PLACE / "channel", sorted(names))
    recipe.run_build(
        rattler_build.ToolConfiguration(use_sharded=False, use_zstd=False, use_bz2=False),
        output_dir=PLACE / "output",
        channels=[(PLACE / "channel").as_uri()],
        env_isolation=rattler_build.EnvironmentIsolation.NONE,
    )
    (path,) = (PLACE / "output" / PLATFORM).glob("rigid-body-harness-*.conda")
    files = {str(each) for each in rattler_build.Package.from_file(path).files}
    print(f"{path.name}: {len(files)} files")
    has_extension = any("pyharness/_kernels." in each for each in files)
    return 0 if has_extension and "bin/pyharness" in files else 1


if __name__ == "__main__":
    sys.exit(main())
