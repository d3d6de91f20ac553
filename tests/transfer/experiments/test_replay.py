import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import replay
from benchmarks.replay import CHECKPOINTS, Emulator, read_source

TWIN_MADE = Path(replay.__file__).with_name("replay_twin.csv")


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr(sys, "argv", ["replay", *arguments])
    replay.main()


def test_a_replay_tells_the_best_candidate_and_what_each_method_has_of_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run(monkeypatch, str(TWIN_MADE), "--methods", "plain,random", "--replays", "2", "--json")
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert found["best"] == round(Emulator.of([TWIN_MADE]).best_mm(), 1)
    assert list(found["methods"]) == ["plain", "random"]
    for percents in found["methods"].values():
        assert list(percents) == list(map(str, CHECKPOINTS))
        assert all(0.0 < percent < 130.0 for percent in percents.values())


def test_a_trial_is_one_of_the_four_nearest_and_the_truth_the_mean_of_the_six_nearest() -> None:
    emulator = Emulator.of([TWIN_MADE])
    place = np.full(3, 0.7)
    order = np.argsort(np.linalg.norm(emulator.x - place, axis=1))
    rng = np.random.default_rng(0)
    drawn = {emulator.draw_mm(place, rng) for _ in range(100)}
    assert drawn == set(emulator.scores_mm[order[:4]])
    assert emulator.true_mm(place[None, :])[0] == pytest.approx(emulator.scores_mm[order[:6]].mean())


def test_pooled_tables_of_200_trials_average_twelve() -> None:
    emulator = Emulator.of([TWIN_MADE, TWIN_MADE])  # every trial twice
    alone = Emulator.of([TWIN_MADE])
    place = np.full((1, 3), 0.7)
    assert len(emulator.scores_mm) == 200
    assert emulator.true_mm(place)[0] == pytest.approx(alone.true_mm(place)[0])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("RPM_1,Displacement_mm\n900,fast\n", "could not convert"), ("a,b\n1,2\n", "Displacement_mm"), ("", "RPM_1")],
)
def test_a_table_that_cannot_be_used_is_named_with_the_cure(tmp_path: Path, text: str, complaint: str) -> None:
    table = tmp_path / "trials.csv"
    table.write_text(text)
    with pytest.raises(SystemExit, match=rf"trials.csv: .*{complaint}"):
        Emulator.of([table])


def test_a_source_is_the_trials_of_another_table() -> None:
    source = read_source(TWIN_MADE)
    rows = replay.read_table(TWIN_MADE)
    assert source.name == "replay_twin"
    assert source.scores == tuple(rows[:, -1])
    assert source.gaits[0].frequency_hz == pytest.approx(tuple(rows[0, :-1] / 60.0))
