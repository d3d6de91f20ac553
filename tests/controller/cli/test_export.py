import csv
import json
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.runs.log import read_run


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "tried"
    assert main(["trial", "12", "-14", "9", "--duration", "0.3", "--repeats", "3", "--quiet", "--out", str(path)]) == 0
    return path


def test_a_run_becomes_a_table_with_a_line_for_each_trial(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "tried.csv"

    assert main(["export", str(run), "--csv", str(path), "--json"]) == 0

    rows = list(csv.DictReader(path.read_text().splitlines()))
    scores = [logged.score for logged in read_run(run).trials]
    assert json.loads(capsys.readouterr().out) == {"csv": str(path), "trials": 3}
    assert [float(row["score_m_s"]) for row in rows] == scores


def test_a_dash_is_standard_output(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["export", str(run), "--csv", str(tmp_path / "tried.csv")])
    capsys.readouterr()

    assert main(["export", str(run), "--csv", "-"]) == 0

    assert capsys.readouterr().out == (tmp_path / "tried.csv").read_text()


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        (("--csv", "-", "--json"), 2, "choose one"),
        (("--csv", "no/where.csv"), 1, "no/where.csv cannot be written"),
    ],
)
def test_what_cannot_be_written_is_one_line(
    run: Path,
    arguments: tuple[str, ...],
    status: int,
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main(["export", str(run), *arguments]) == status

    (line,) = capsys.readouterr().err.splitlines()
    assert complaint in line


@pytest.mark.parametrize("command", ["export {run} --csv {log}", "report {run} --out {log}", "foxglove-layout {log}"])
def test_a_file_of_another_kind_is_never_replaced(run: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    log = run / "trials.mcap"
    content = log.read_bytes()

    assert main([word.format(run=run, log=log) for word in command.split()]) == 1

    assert "exists and is no ." in capsys.readouterr().err
    assert log.read_bytes() == content


@pytest.mark.parametrize("name", ["table", "table.CSV"])
def test_a_table_is_replaced_by_a_newer_one(run: Path, name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("old")

    assert main(["export", str(run), "--csv", str(tmp_path / name)]) == 0

    assert (tmp_path / name).read_text() != "old"
