import errno
import json
import os
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.runs.log import read_run

TABLE = "Trial,RPM_1,RPM_2,RPM_3,Displacement_mm\n1,600,-300,0,100\n2,120,0,60,40\n"


def imported(folder: Path, table: str | bytes = TABLE, *more: str, **changed: str) -> int:
    """Import a table into ``folder / "lab"``; options are given without dashes, an empty one is left out."""
    path = folder / "trials.csv"
    path.write_bytes(table if isinstance(table, bytes) else table.encode())
    options = {
        "gait": "RPM_1,RPM_2,RPM_3",
        "unit": "rpm",
        "score": "Displacement_mm",
        "score-unit": "mm",
        "duration": "20",
        "out": str(folder / "lab"),
        **changed,
    }
    pairs = [part for name, value in options.items() if value for part in (f"--{name}", value)]
    return main(["import", str(path), *pairs, *more])


def test_trials_become_a_run_in_our_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert imported(tmp_path, TABLE, "--json") == 0

    found = json.loads(capsys.readouterr().out)
    trials = read_run(tmp_path / "lab").trials
    assert [logged.trial.gait.frequency_hz for logged in trials] == [(10.0, -5.0, 0.0), (2.0, 0.0, 1.0)]
    assert [logged.score for logged in trials] == pytest.approx([0.005, 0.002])
    assert found["best_observed"]["trial"] == 1
    assert found == json.loads((tmp_path / "lab" / "summary.json").read_text())


@pytest.mark.parametrize(
    ("unit", "score_unit", "duration", "hz", "m_s"),
    [("hz", "m", "20", 600.0, 5.0), ("rad/s", "mm/s", "", 95.4929658551, 0.1), ("rpm", "m/s", "", 10.0, 1.0)],
)
def test_every_unit_is_understood(
    unit: str, score_unit: str, duration: str, hz: float, m_s: float, tmp_path: Path
) -> None:
    table = TABLE.replace(",100\n", ",1\n").replace(",40\n", ",0.4\n") if score_unit == "m/s" else TABLE
    assert imported(tmp_path, table, unit=unit, duration=duration, **{"score-unit": score_unit}) == 0

    first = read_run(tmp_path / "lab").trials[0]
    assert (first.trial.gait.frequency_hz[0], first.score) == pytest.approx((hz, m_s))


def test_a_run_learns_from_imported_trials(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imported(tmp_path)

    learn = ["learn", "--source", str(tmp_path / "lab"), "--trials", "2", "--duration", "0.5", "--out"]
    assert main([*learn, str(tmp_path / "run")]) == 0
    assert read_run(tmp_path / "run").sources[0].scores == pytest.approx((0.005, 0.002))

    capsys.readouterr()
    assert main([*learn, str(tmp_path / "other"), "--score", "path"]) == 2
    assert "net speed only" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    ("table", "changed", "complaint"),
    [
        (TABLE, {"gait": "RPM_1,RPM_9"}, "no column 'RPM_9' (did you mean RPM_"),
        (TABLE, {"score": "Speed"}, "Speed"),
        (TABLE, {"gait": "RPM_1,RPM_1"}, "column 'RPM_1' is named twice"),
        (TABLE, {"gait": "RPM_1,Displacement_mm"}, "column 'Displacement_mm' is named twice"),
        (TABLE, {"duration": ""}, "--duration"),
        (TABLE.replace("600", "fast"), {}, "line 2: RPM_1 is 'fast'"),
        (TABLE.replace("40", "nan"), {}, "line 3: Displacement_mm is 'nan'"),
        (TABLE.replace("60,40", "60"), {}, "line 3: Displacement_mm is empty"),
        (TABLE.replace("600", "inf"), {}, "'inf'"),
        (TABLE.replace("100", "-100"), {}, "Displacement_mm is -100; allowed: 0 or more"),
        (TABLE.replace("2,120,0", "2,1,20,0"), {}, "line 3 has more cells than there are column names"),
        (TABLE.replace("600", "1e300"), {}, "line 2: RPM_1 is 1e+300, that is"),
        (TABLE.replace("600", "-1e6"), {}, "line 2: RPM_1 is -1e+06, that is -16666.7 Hz"),
        (
            TABLE.replace("0,100", "0,1.7e308"),
            {"score-unit": "m", "duration": "1e-3"},
            "line 2: Displacement_mm is 1.7e+308, that is inf m/s",
        ),
        (TABLE.splitlines()[0] + "\n", {}, "no trial"),
        ("", {}, "has nothing"),
        (b"\x89PNG\r\n\x1a\n\x00", {}, "is not a CSV file"),
        (TABLE.encode("utf-16"), {}, "save the table as CSV in UTF-8"),
        (TABLE.encode("utf-16-le"), {}, "save the table as CSV in UTF-8"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    table: str | bytes,
    changed: dict[str, str],
    complaint: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    status = imported(tmp_path, table, **changed)

    lines = capsys.readouterr().err.splitlines()
    assert status == 2
    assert len(lines) == 1 and complaint in lines[0]
    assert not (tmp_path / "lab").exists()


def test_a_full_disk_leaves_nothing_and_the_same_command_works_later(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        assert imported(tmp_path) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"--out {tmp_path / 'lab'} cannot be made: No space left" in line
    assert [path.name for path in tmp_path.iterdir()] == ["trials.csv"]

    assert imported(tmp_path) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lab", "trials.csv"]


def test_an_out_that_cannot_be_made_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("in the way")

    assert imported(tmp_path, out=str(tmp_path / "file" / "lab")) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert f"--out {tmp_path / 'file' / 'lab'} cannot be made" in line


def test_imported_trials_cannot_be_resumed_but_learned_from(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imported(tmp_path)
    capsys.readouterr()

    assert main(["learn", "--resume", str(tmp_path / "lab")]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert "lab has no run.toml, so it cannot be resumed" in line and "--source" in line


def test_the_example_of_the_readme_works_with_the_table_that_ships(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = Path(__file__).parents[3]
    (line,) = [line for line in (root / "README.md").read_text().splitlines() if line.startswith("vvvaltr import ")]
    words = line.partition("#")[0].split()[1:]
    words[words.index("--out") + 1] = str(tmp_path / "lab")
    monkeypatch.chdir(root)

    assert main(words) == 0
    assert len(read_run(tmp_path / "lab").trials) == 24


def test_imported_trials_can_be_viewed(tmp_path: Path) -> None:
    imported(tmp_path)

    assert main(["view", str(tmp_path / "lab"), "--save", str(tmp_path / "lab.rrd")]) == 0
    assert (tmp_path / "lab.rrd").stat().st_size > 0


@pytest.mark.parametrize(("option", "unit", "meant"), [("unit", "rmp", "rpm"), ("score-unit", "mm/sec", "mm/s")])
def test_an_unknown_unit_is_not_understood(
    option: str, unit: str, meant: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ending:
        imported(tmp_path, **{option: unit})

    assert ending.value.code == 2
    assert f"--{option}: unknown value {unit!r} (did you mean {meant}?)" in capsys.readouterr().err


HEAD = "RPM_1,RPM_2,RPM_3,Displacement_mm\n"


@pytest.mark.parametrize(
    "table",
    [
        "\ufeffRPM_1;RPM_2;RPM_3;Displacement_mm\n250,5;300;280;51,5\n260;310;0;40,2\n",
        "sep=;\nRPM_1;RPM_2;RPM_3;Displacement_mm\n250.5;300;280;51.5\n260;310;0;40.2\n",
        "sep=\t\nRPM_1\tRPM_2\tRPM_3\tDisplacement_mm\n250.5\t300\t280\t51.5\n260\t310\t0\t40.2\n",
        "RPM_1\tRPM_2\tRPM_3\tDisplacement_mm\n250,5\t300\t280\t51,5\n260\t310\t0\t40,2\n",
        "RPM_1, RPM_2 , RPM_3, Displacement_mm\n250.5, 300, 280, 51.5\n260, 310, 0, 40.2\n",
        HEAD + "250.5,300,280,51.5\n260,310,0,40.2\n,,,\n,,,\n",
        HEAD[:-1] + ",,\n250.5,300,280,51.5,,\n\n260,310,0,40.2,,,,\n",
        "# carpet\n" + HEAD + "250.5,300,280,51.5\n260,310,0,40.2\n# the battery was low, at the end\n",
        HEAD.replace("\n", "\r\n") + "250.5,300,280,51.5\r\n260,310,0,40.2\r\n",
    ],
)
def test_tables_of_spreadsheets_of_any_country_are_read(table: str, tmp_path: Path) -> None:
    assert imported(tmp_path, table) == 0

    trials = read_run(tmp_path / "lab").trials
    assert [logged.trial.gait.frequency_hz[0] for logged in trials] == pytest.approx([250.5 / 60.0, 260.0 / 60.0])
    assert [logged.score for logged in trials] == pytest.approx([51.5e-3 / 20.0, 40.2e-3 / 20.0])


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        (
            HEAD[:-1] + ",Displacement_mm\n1,2,3,51.5,3\n",
            "has 2 columns 'Displacement_mm': give each a name of its own",
        ),
        (HEAD + '1,2,3,"1,234"\n', "write decimals with a point"),
        (HEAD + "1,2,3,4\nMeasured on carpet,,,\n", "delete it or let it begin with #"),
        (HEAD + "1,2,3,1_000\n", "'1_000': give a number"),
        (HEAD.replace(",", ";") + "1;2;3;1.234,5\n", "no separators of thousands"),
        (HEAD + "1,2,3,0\n", "--zero keep if the robot stood still, or --zero drop"),
        (HEAD + "1,2,3,500000\n", "that is 25 m/s; allowed: up to 5"),
    ],
)
def test_what_a_table_leaves_open_is_asked(
    table: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert imported(tmp_path, table) == 2

    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "lab").exists()


@pytest.mark.parametrize(("zero", "scores"), [("keep", [0.0, 0.001]), ("drop", [0.001])])
def test_a_zero_is_what_the_person_says(zero: str, scores: list[float], tmp_path: Path) -> None:
    assert imported(tmp_path, HEAD + "1,2,3,0\n4,5,6,20\n", zero=zero) == 0

    assert [logged.score for logged in read_run(tmp_path / "lab").trials] == pytest.approx(scores)


def test_several_score_columns_are_repeats(tmp_path: Path) -> None:
    table = "a,b,first,second\n600,300,20,40\n60,30,60,\n"

    assert imported(tmp_path, table, gait="a,b", score="first,second") == 0

    trials = read_run(tmp_path / "lab").trials
    assert [(logged.trial.gait.frequency_hz[0], logged.score) for logged in trials] == [
        (10.0, pytest.approx(0.001)),
        (10.0, pytest.approx(0.002)),
        (1.0, pytest.approx(0.003)),
    ]


def test_a_movement_of_three_columns_is_kept_as_one(tmp_path: Path) -> None:
    more = {"gait": "a", "score": "", "movement": "dx,dy,yaw", "yaw-unit": "deg"}

    assert imported(tmp_path, "a,dx,dy,yaw\n600,30,-40,90\n", **more) == 0

    (logged,) = read_run(tmp_path / "lab").trials
    assert logged.score == pytest.approx(0.0025)
    assert logged.movement is not None
    moved = logged.movement.displacement
    assert (moved.forward_m, moved.left_m, moved.turn_rad) == pytest.approx((0.03, -0.04, 1.5707963))
