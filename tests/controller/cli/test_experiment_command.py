import json
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main

QUICK = ("--repeats", "1", "--trials", "5", "--duration", "0.5", "--starts", "2", "--methods", "efficient")


def test_an_experiment_ends_with_its_findings_and_can_be_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "e1"

    assert main(["experiment", "1b", *QUICK, "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert found["out"] == str(out)
    assert found["experiments"]["1b"]["repeats"] == 1
    assert {"true_m_s", "final_best_m_s", "gain_over_plain_percent", "trials_to_plain_level", "p", "effect"} <= set(
        found["experiments"]["1b"]["methods"]["efficient"]
    )

    assert main(["report", str(out), "--markdown"]) == 0
    assert "| efficient |" in capsys.readouterr().out
    assert not (out / "report.html").exists()
    assert main(["report", str(out), "--json"]) == 0
    assert Path(json.loads(capsys.readouterr().out)["report"]).exists()


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        ("experiment 7 --out {new}", 2, "'7'"),
        ("experiment 1 --methods gaurded --out {new}", 2, "unknown method 'gaurded' (did you mean guarded?)"),
        ("experiment 1 --methods plain,efficient --out {new}", 2, "leave out plain: every experiment has it"),
        ("experiment 1 --duration 4000 --out {new}", 2, "--duration is 4000"),
        ("experiment 1 --scheduler nowhere --out {new}", 1, "Dask"),
        ("report {new}", 1, "is neither a run nor a campaign"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    arguments: str, status: int, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new = tmp_path / "new"

    assert main(arguments.format(new=new).split()) == status

    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and complaint in lines[0]
    assert not new.exists()
