"""What is released: the wheel holds everything and one import name, and works in an environment with nothing else."""

import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("controller", "drivers", "twin", "transfer")
LEFT_BEHIND = shutil.ignore_patterns(".*", "__pycache__", "build", "dist", "*.egg-info", "runs-*")


def call(*command: str | Path, cwd: Path, **environment: str) -> str:
    answer = subprocess.run(
        list(map(str, command)), cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True
    )
    assert answer.returncode == 0, f"{command}\n{answer.stdout}\n{answer.stderr}"
    return answer.stdout


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source archive and, in `direct` and `archived`, the wheels of the checkout and the archive."""
    # A copy: what an earlier build left in build/ would get into the wheel.
    source = shutil.copytree(ROOT, tmp_path_factory.mktemp("source") / "vvvaltr", symlinks=True, ignore=LEFT_BEHIND)
    out = tmp_path_factory.mktemp("dist")
    call(sys.executable, "-m", "build", "-q", "--sdist", "-o", out, ".", cwd=source)
    call(sys.executable, "-m", "build", "-q", "--wheel", "-o", out / "direct", ".", cwd=source)
    call("tar", "xzf", next(out.glob("*.tar.gz")), cwd=out)
    unpacked = next(out.glob("vvvaltr-*/"))
    call(sys.executable, "-m", "build", "-q", "--wheel", "-o", out / "archived", ".", cwd=unpacked)
    return out


def contents(folder: Path) -> dict[str, int]:
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as wheel:
        return {entry.filename: entry.CRC for entry in wheel.infolist() if not entry.filename.endswith("/RECORD")}


def test_the_wheel_takes_one_import_name(dist: Path) -> None:
    tops = {name.partition("/")[0] for name in contents(dist / "direct")}

    assert {top for top in tops if not top.endswith(".dist-info")} == {"vvvaltr"}


def test_the_wheel_holds_every_file_of_the_rooms(dist: Path) -> None:
    rooms = {
        f"vvvaltr/{path.relative_to(ROOT)}" for room in ROOMS for path in (ROOT / room).rglob("*") if path.is_file()
    }
    front = {f"vvvaltr/{path.name}" for path in (ROOT / "vvvaltr").iterdir() if path.is_file()}

    held = {name for name in contents(dist / "direct") if name.startswith("vvvaltr/")}

    assert held == {name for name in rooms | front if "__pycache__" not in name}
    assert {Path(name).suffix for name in held} >= {".py", ".typed", ".proto", ".md"}


def test_the_source_archive_builds_the_same_wheel(dist: Path) -> None:
    assert contents(dist / "archived") == contents(dist / "direct")


@pytest.fixture(scope="module")
def bare(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of an environment that holds the wheel and what it needs, nothing else."""
    place = tmp_path_factory.mktemp("bare") / "venv"
    venv.create(place, with_pip=True)
    call(place / "bin" / "python", "-m", "pip", "install", "-q", next((dist / "direct").glob("*.whl")), cwd=dist)
    return place / "bin"


def test_the_readmes_first_command_learns_in_a_bare_environment(bare: Path, tmp_path: Path) -> None:
    first = re.search(r"^python3 -m venv .*(vvvaltr learn .*)$", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert first

    answer = call(bare / "vvvaltr", *first[1].split()[1:], "--out", "found", cwd=tmp_path)

    assert "best gait" in answer
    assert "'trials': 40" in call(
        bare / "python", "-c", "import json; print(json.load(open('found/summary.json')))", cwd=tmp_path
    )


def test_the_public_names_resolve_in_a_bare_environment(bare: Path, tmp_path: Path) -> None:
    code = "import vvvaltr; print(len([getattr(vvvaltr, name) for name in vvvaltr.__all__]))"

    assert int(call(bare / "python", "-c", code, cwd=tmp_path)) > 20


@pytest.mark.parametrize("place", ["first on the path", "in the working folder"])
def test_a_package_controller_of_others_stays_theirs(bare: Path, tmp_path: Path, place: str) -> None:
    for name in ROOMS:
        (tmp_path / "theirs" / name).mkdir(parents=True)
        (tmp_path / "theirs" / name / "__init__.py").write_text("Robot = 'theirs'\n")
    where = {"PYTHONPATH": str(tmp_path / "theirs")} if place == "first on the path" else {}
    cwd = tmp_path if where else tmp_path / "theirs"

    assert call(bare / "python", "-c", "from controller import Robot; print(Robot)", cwd=cwd, **where) == "theirs\n"
    assert call(bare / "vvvaltr", "--version", cwd=cwd, **where).startswith("vvvaltr ")
    assert call(bare / "python", "-m", "vvvaltr", "--version", cwd=cwd, **where).startswith("vvvaltr ")
    learn = ["learn", "--trials", "2", "--duration", "1", "--json"]
    assert '"trials": 2' in call(bare / "vvvaltr", *learn, cwd=cwd, **where)
