"""A campaign whose files were cut, emptied or changed by hand: one line with the file and the cure."""

from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import UserError
from vvvaltr.transfer.experiments.campaign import plan_units
from vvvaltr.transfer.experiments.store import Store
from vvvaltr.transfer.experiments.thesis import find_pairs
from vvvaltr.transfer.experiments.unit import Result, Settings, Step, Truth

SETTINGS = Settings(duration_s=0.5, starts=2, most_trials=5)
UNIT = plan_units(find_pairs("planar", "1b")[0], SETTINGS, 1, ()).plain[0]
STEP = Step((9.0, 9.0, 9.0), 0.1, (9.0, 9.0, 9.0), 0.1, 0.05, 0.15)
WHOLE = Result((STEP,) * 5, (Truth(5, (0.1, 0.2)),))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store.begin(tmp_path / "campaign", SETTINGS)
    store.save(UNIT, WHOLE)
    return store


def test_what_was_saved_is_loaded(store: Store) -> None:
    assert Store.open(store.folder).load(UNIT) == WHOLE


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (None, "", "is missing"),
        ("most_trials = 5\n", "", "most_trials is missing"),
        ('"planar"', '"x"', "robot is 'x'; allowed: planar, spatial"),
        ("duration_s = 0.5", "duration_s = -1.0", "duration_s is -1; allowed: 0.1 to 3600"),
        ("duration_s = 0.5", "duration_s = nan", "duration_s is nan"),
        ("seed = 0", "seed = -1", "seed is -1; allowed: 0 or more"),
        ("starts = 2", "starts = 0", "starts is 0; allowed: 1 or more"),
        ("= inf", "= nan", "heading_limit_rad is nan; allowed: above 0"),
        ('"careful"', '"x"', "unknown scatter 'x'; choose one of careful"),
    ],
)
def test_damaged_settings_are_to_be_restored(
    store: Store, old: str | None, new: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = store.folder / "campaign.toml"
    text = path.read_text()
    assert old is None or text.count(old) == 1
    path.write_text(text.replace(old, new) if old else new)

    assert main(["report", str(store.folder), "--markdown"]) == 1
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1
    assert err.startswith(f"vvvaltr: {path}: ")
    assert said in err
    assert err.endswith("; restore the file as the campaign wrote it\n")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: "", "0 trials instead of 5"),
        (lambda text: text * 2, "10 trials instead of 5"),
        (lambda text: text.split("\n", 1)[1], "4 trials instead of 5"),
        (lambda text: text.rstrip("\n").rsplit("\n", 1)[0], "true speeds after trials 5"),
        (lambda text: text.replace("[0.1,0.2]", "[]"), "true speeds after trials 5"),
        (lambda text: text[:-20], "truncated"),
        (lambda text: text.replace("[9.0,9.0,9.0]", "[9.0,9.0]", 1), "a gait that no twin has"),
        (lambda text: text.replace("[9.0,9.0,9.0]", "[9.0,9.0,1e300]", 1), "a gait that no twin has"),
        (lambda text: text.replace("[0.1,0.2]", "[1e308,1e308]"), "a speed that no robot has"),
    ],
    ids=[
        "empty",
        "doubled",
        "without its first line",
        "without its last line",
        "no speeds",
        "torn",
        "two motors",
        "fast",
        "absurd",
    ],
)
def test_a_result_that_is_not_whole_is_to_be_made_again(store: Store, change: object, said: str) -> None:
    path = next(store.folder.rglob("*.jsonl"))
    text = path.read_text()
    assert callable(change)
    path.write_text(change(text))
    assert path.read_text() != text

    with pytest.raises(UserError, match=said) as refused:
        store.load(UNIT)
    assert str(refused.value).startswith(f"{path}: ")
    assert str(refused.value).endswith("delete the file and run the experiment again")


def test_another_campaign_is_told_by_the_option_that_was_typed(store: Store) -> None:
    with pytest.raises(UserError, match=r"^--trials: the campaign in .* has 5, but 6 was asked for"):
        Store.begin(store.folder, Settings(duration_s=0.5, starts=2, most_trials=6))


@pytest.mark.parametrize(("duration", "said"), [("1e-9", "0.1"), ("1e9", "--duration is 1e+09")])
def test_a_trial_of_no_time_or_of_years_is_not_understood(
    duration: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["experiment", "1", "--duration", duration, "--out", str(tmp_path / "new")]
    try:
        ended = main(arguments)
    except SystemExit as usage:
        ended = int(usage.code or 0)

    assert ended == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
