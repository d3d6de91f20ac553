"""Whether every part of the installation has a ready-made wheel for the robot's own computer (Linux on aarch64).

    python -m benchmarks.wheels [--python-version 3.11] [--json]

Downloads what ``vvvaltr`` and each extra need for another machine, without building anything. Needs the network.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from benchmarks.figures import make_parser

ROOT = Path(__file__).parent.parent
# glibc 2.28 and every older one, as pip on the machine itself would accept them.
PLATFORMS = (*(f"manylinux_2_{minor}_aarch64" for minor in range(28, 16, -1)), "manylinux2014_aarch64")


def parts() -> dict[str, list[str]]:
    """Return the requirements of the lean install and of each extra for users."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {name: needs for name, needs in project["optional-dependencies"].items() if name not in ("all", "dev")}
    return {"lean": project["dependencies"], **extras}


def missing(needs: list[str], python_version: str) -> str:
    """Return the first thing that has no wheel, in pip's words; nothing if all have one."""
    platforms = [word for platform in PLATFORMS for word in ("--platform", platform)]
    with tempfile.TemporaryDirectory() as folder:
        command = ["download", "-q", "--only-binary=:all:", *platforms, "--python-version", python_version]
        answer = subprocess.run(
            [sys.executable, "-m", "pip", *command, "-d", folder, *needs], capture_output=True, text=True
        )
    errors = [line for line in answer.stderr.splitlines() if line.startswith("ERROR")]
    return "" if answer.returncode == 0 else (errors or ["pip failed"])[-1]


def main() -> int:
    """Print what was found; the status is 1 if anything is missing."""
    parser = make_parser(__doc__)
    parser.add_argument("--python-version", default="3.11", help="Python of the robot's computer")
    arguments = parser.parse_args()
    found = {name: missing(needs, arguments.python_version) for name, needs in parts().items()}
    if arguments.json:
        print(json.dumps(found))
    else:
        for name, reason in found.items():
            print(f"{name:10} {reason or 'all wheels exist'}")
    return 1 if any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
