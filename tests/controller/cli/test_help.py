"""The help: every command with an example, methods and scores with a line each, nothing wider than a terminal."""

import subprocess
import sys

import pytest

from vvvaltr.controller.cli.main import COMMANDS, main
from vvvaltr.controller.cli.options import TWIN_RANGE, TWINS
from vvvaltr.controller.loop.scoring import SCORES
from vvvaltr.transfer.methods.registry import METHODS
from vvvaltr.twin import presets


def help_of(*command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ending:
        main([*command, "--help"])
    assert ending.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_a_help_fits_a_terminal_of_80_columns_and_ends_with_an_example(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")

    text = help_of(*command.split(), capsys=capsys)

    assert max(map(len, text.splitlines())) <= 80
    assert text.rpartition("example:\n")[2].startswith(f"  vvvaltr {command}")


@pytest.mark.parametrize("columns", ["1", "12", "nonsense"])
def test_a_help_is_shown_however_narrow_the_terminal_says_that_it_is(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)

    assert "example:" in help_of("learn", capsys=capsys)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_argument_is_explained(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    from vvvaltr.controller.cli.main import make_parser

    parsers = make_parser()._subparsers
    assert parsers is not None
    actions = parsers._group_actions[0].choices[command]._actions  # type: ignore[call-overload, index]
    assert [action.dest for action in actions if not action.help] == []


def test_methods_and_scores_are_explained_where_they_can_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    words = " ".join(help_of("learn", capsys=capsys).split())

    for name, method in METHODS.items():
        assert f"{name} {method.description}" in words
    for name, score in SCORES.items():
        assert f"{name} {score.description}" in words


def test_the_twins_that_can_be_typed_are_those_that_there_are() -> None:
    assert set(TWINS) == set(presets.TWINS)


def test_the_ranges_that_are_told_are_those_of_the_twins() -> None:
    ranges = {name: twin.drives["eccentric"].range_hz for name, twin in presets.TWINS.items()}
    told = ", ".join(f"{low:g} to {high:g} on {name}" for name, (low, high) in ranges.items())
    assert f"default {told}" == TWIN_RANGE


@pytest.mark.parametrize("arguments", [("--version",), ("completion", "bash")])
def test_what_only_prints_imports_no_numerical_library(arguments: tuple[str, ...]) -> None:
    code = (
        "import sys; from vvvaltr.controller.cli.main import main\n"
        f"try: main({arguments!r})\nexcept SystemExit: pass\n"
        "assert not {'numpy', 'msgspec', 'tqdm'} & set(sys.modules)"
    )

    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_the_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    from vvvaltr import __version__

    with pytest.raises(SystemExit):
        main(["--version"])

    assert capsys.readouterr().out == f"vvvaltr {__version__}\n"


@pytest.mark.parametrize(
    ("words", "completed"),
    [("vvvaltr lea", "learn"), ("vvvaltr learn --tri", "--trials"), ("vvvaltr trial 1 2 3 --score n", "net")],
)
def test_tab_completes_commands_options_and_choices(words: str, completed: str) -> None:
    script = (
        'eval "$("$0" -m vvvaltr completion bash)"\n'
        f"COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))\n"
        "_shtab_vvvaltr vvvaltr; echo ${COMPREPLY[@]}"
    )

    found = subprocess.run(["bash", "-c", script, sys.executable], capture_output=True, text=True, check=True)

    assert completed in found.stdout.split(), found.stderr
