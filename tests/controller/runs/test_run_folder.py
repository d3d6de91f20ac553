"""The folder of a run: what happens when it goes, and that nothing is written through a link that lies in it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.runs.log import LOG_NAME, read_run
from vvvaltr.controller.runs.run import RunDirectory

SECRET = "of the reader's"
ASKED = {"trials": 5, "duration_s": 0.3}


@pytest.mark.parametrize(
    "take_away",
    [lambda path: path.rename(path.with_name("moved")), shutil.rmtree],
    ids=["moved", "deleted"],
)
def test_a_run_whose_folder_goes_makes_no_further_trial(tmp_path: Path, take_away: Callable[[Path], object]) -> None:
    path = tmp_path / "run"
    with closing(RunDirectory.create(path, ASKED)) as run:
        trials = iter(run.learn())
        next(trials)
        next(trials)

        take_away(path)

        with pytest.raises(UserError, match=r"run was moved or deleted: the run ends here; continue it by --resume"):
            next(trials)
        assert len(run.trials) == 2
        assert list(trials) == []
    assert not path.exists()  # nothing has made it anew


def test_a_run_whose_folder_was_moved_goes_on_where_it_is_now(tmp_path: Path) -> None:
    with closing(RunDirectory.create(tmp_path / "run", ASKED)) as run:
        next(iter(run.learn()))
        (tmp_path / "run").rename(tmp_path / "moved")

    with closing(RunDirectory.resume(tmp_path / "moved", {})) as run:
        assert [logged.trial.number for logged in run.learn()] == [2, 3, 4, 5]


def test_resuming_and_reporting_write_through_no_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with closing(RunDirectory.create(tmp_path / "other", {**ASKED, "trials": 2})) as run:
        assert len(list(run.learn())) == 2
    other = (tmp_path / "other" / LOG_NAME).read_bytes()
    secret, folder = tmp_path / "secret", tmp_path / "run"
    secret.write_text(SECRET)
    folder.mkdir()
    for name in ("run.toml", LOG_NAME):  # what is read may lie elsewhere
        (folder / name).symlink_to(tmp_path / "other" / name)
    toml = (tmp_path / "other" / "run.toml").read_text()
    written = ["summary.json", "report.html", *(f"{name}.new" for name in ("run.toml", "summary.json", "report.html"))]
    for name in (*written, f"{LOG_NAME}.new", f"{LOG_NAME}.torn"):
        (folder / name).symlink_to(secret)

    assert main(["learn", "--resume", str(folder), "--trials", "3", "--no-recording", "--quiet"]) == 0
    assert main(["report", str(folder)]) == 0

    assert secret.read_text() == SECRET
    assert (tmp_path / "other" / LOG_NAME).read_bytes() == other
    assert (tmp_path / "other" / "run.toml").read_text() == toml
    assert len(read_run(folder).trials) == 3
    for name in (LOG_NAME, "run.toml", "summary.json", "report.html"):
        assert not (folder / name).is_symlink()
    capsys.readouterr()
