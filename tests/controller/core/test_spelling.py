import pytest

from vvvaltr.controller.core.spelling import did_you_mean, unknown

METHODS = ("plain", "efficient", "guarded")


@pytest.mark.parametrize("word", ["plian", "Plain", "pain", "--plain"])
def test_the_name_that_was_probably_meant_is_proposed(word: str) -> None:
    assert did_you_mean(word, METHODS) == " (did you mean plain?)"


@pytest.mark.parametrize("word", ["magic", "", "x"])
def test_nothing_is_proposed_for_what_is_like_nothing(word: str) -> None:
    assert did_you_mean(word, METHODS) == ""


def test_an_option_is_proposed_with_its_dashes() -> None:
    assert did_you_mean("--trails", ("--trials", "--duration")) == " (did you mean --trials?)"


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    assert unknown("method", "gaurded", METHODS) == (
        "unknown method 'gaurded' (did you mean guarded?); choose one of plain, efficient, guarded"
    )
