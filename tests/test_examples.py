"""The examples run as they are, and docs/python.md shows them as they are."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
TABLE = ROOT / "examples" / "trials.csv"
IMPORT = "--gait RPM_1,RPM_2,RPM_3 --unit rpm --score Displacement_mm --score-unit mm --duration 20"


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_without_arguments_or_hardware(example: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "MPLBACKEND": "agg"}

    command = [sys.executable, "-W", "error", str(example)]
    answer = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)

    assert answer.returncode == 0, answer.stderr
    assert answer.stdout or any(tmp_path.iterdir())


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_shown_in_the_documentation(example: Path) -> None:
    code = example.read_text()

    assert len(code.splitlines()) < 40
    assert f"```python\n{code}```" in (ROOT / "docs" / "python.md").read_text()


def test_the_sample_table_is_what_the_example_makes(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(ROOT / "examples" / "make_trials.py")], cwd=tmp_path, check=True)

    made, shipped = (list(csv.reader(path.read_text().splitlines())) for path in (tmp_path / "trials.csv", TABLE))

    # The displacements may differ in the last bits of the processor's arithmetic, which the twin's contacts amplify.
    assert [row[:3] for row in made] == [row[:3] for row in shipped]
    assert len(shipped) == 25
    totals_mm = [sum(float(row[3]) for row in table[1:]) for table in (made, shipped)]
    assert totals_mm[0] == pytest.approx(totals_mm[1], rel=0.02)


def test_the_sample_table_becomes_a_source(tmp_path: Path) -> None:
    lab, out = str(tmp_path / "lab"), str(tmp_path / "out")

    assert main(["import", str(TABLE), *IMPORT.split(), "--out", lab]) == 0
    assert main(["learn", "--source", lab, "--trials", "3", "--duration", "1", "--no-recording", "--out", out]) == 0
