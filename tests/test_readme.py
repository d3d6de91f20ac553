"""Every command of the README works as typed, block after block, in one shell.

The text is run as it stands. What stands in for a fresh machine is the environment: its ``python3``, ``pip`` and
``vvvaltr`` install nothing, hide the library of each extra that the README has not installed yet, and cut the budgets
of the long commands (``SMALLER`` changes a number, ``SHORTER`` adds options).
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

VVVALTR = '''
import sys
from pathlib import Path

SMALLER = {"--trials": lambda n: str(max(2, int(n) // 10)), "--repeats": lambda n: "2", "--grid": lambda n: "3",
           "--gaits": lambda n: "12", "--confirm": lambda n: "1x1"}
SHORTER = {"learn": ["--no-recording"],
           "experiment": ["--trials", "3", "--starts", "1", "--duration", "1"],
           "calibrate": ["--points", "2", "--seconds", "1"],
           "landscape": ["--repeats", "1", "--jobs", "1", "--duration", "1"],
           "repertoire": ["--duration", "2"],
           "go": ["--within", "0.15"]}
LIBRARIES = {"rerun": "rerun", "matplotlib": "report", "mujoco": "spatial", "cv2": "camera", "distributed": "cluster"}


class NotInstalled:
    """Hides the libraries of the extras that were not installed."""

    installed = Path(__file__).with_name("extras").read_text().split()

    def find_spec(self, name, *_):
        if LIBRARIES.get(name, "all") not in [*self.installed, "all"] and "all" not in self.installed:
            raise ModuleNotFoundError(f"the README has not installed the extra {LIBRARIES[name]}", name=name)


sys.meta_path.insert(0, NotInstalled())
words = [SMALLER.get(before, str)(word) for before, word in zip(sys.argv, sys.argv[1:])]
if __name__ == "__main__":
    from vvvaltr.controller.cli.main import main

    sys.exit(main([*words, *SHORTER.get(words[0], [])]))
'''

PIP = """
import re
import sys
import tomllib
from pathlib import Path

known = tomllib.loads(Path({pyproject!r}).read_text())["project"]["optional-dependencies"]
for extra in re.findall(r"[\\w]+", sys.argv[-1]):
    assert extra in known, f"there is no extra {{extra}}"
    with Path(__file__).with_name("extras").open("a") as file:
        print(extra, file=file)
"""


def write_program(path: Path, interpreter: str, text: str) -> None:
    path.write_text(f"#!{interpreter}\n{text}")
    path.chmod(0o755)


@pytest.fixture
def fresh_machine(tmp_path: Path) -> Path:
    """A folder with the repository's examples, and the programs that the README calls."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    (programs / "extras").touch()
    (programs / "activate").write_text(f'PATH="{programs}:$PATH"\n')
    write_program(programs / "vvvaltr", sys.executable, VVVALTR)
    write_program(programs / "pip", sys.executable, PIP.format(pyproject=str(ROOT / "pyproject.toml")))
    tests = "-m pytest -q -n 4 --dist loadfile"
    write_program(programs / "python", "/bin/sh", f'[ "$*" = "{tests}" ] && exec {sys.executable} "$@" --version\n')
    (tmp_path / "bin").mkdir()
    # Where the README waits for the mock, wait for as long as that takes: this machine may be busy.
    write_program(tmp_path / "bin" / "sleep", "/bin/sh", "until [ -e qik0.toml ]; do /bin/sleep 0.1; done\n")
    write_program(tmp_path / "bin" / "python3", "/bin/sh", '[ "$*" = "-m venv .venv" ]\n')
    return tmp_path


@pytest.mark.timeout(600)
def test_every_block_of_the_readme_works_as_typed_in_one_shell(fresh_machine: Path) -> None:
    blocks = re.findall(r"^```sh\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    environment = {**os.environ, "PATH": f"{fresh_machine / 'bin'}:{os.environ['PATH']}"}

    shell = subprocess.Popen(
        ["bash", "-euxo", "pipefail", "-c", "".join(blocks)],
        cwd=fresh_machine,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        _, told = shell.communicate(timeout=580)
    finally:
        with suppress(ProcessLookupError):  # nothing is left, as it should be
            os.killpg(shell.pid, signal.SIGTERM)

    assert shell.returncode == 0, told[-3000:]
    for result in (
        "runs/flat/trials.mcap",
        "flat.csv",
        "landscape.png",
        "runs/hil/summary.json",
        "runs/lab/trials.mcap",
    ):
        assert (fresh_machine / result).stat().st_size > 0
    assert not (fresh_machine / "qik0.toml").exists(), "the mock still runs"
