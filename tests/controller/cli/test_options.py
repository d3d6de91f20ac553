"""Arguments that several commands share."""

from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main


@pytest.mark.parametrize("text", ["+-5", "--5", "five", "1.5", "", "-3", "9" * 5000])
def test_what_is_no_whole_number_is_refused_as_such(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["learn", f"--trials={text}"])

    assert f"{text!r} is not a whole number of at least 1" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["learn", "trial 12 -14 9", "landscape", "repertoire"])
@pytest.mark.parametrize("text", ["1e-9", "0.09", "0", "nan", "3601"])
def test_a_trial_too_short_to_measure_anything_or_too_long_for_a_run_is_refused(
    command: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    with pytest.raises(SystemExit):
        main([*command.split(), "--duration", text])

    assert f"{text!r} is not a number of at least 0.1" in capsys.readouterr().err
