"""Names that people mistype: one line that says what was probably meant, and what there is."""

from __future__ import annotations

from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[object]) -> str:
    """Return ``" (did you mean planar?)"`` for the known name most like ``word``; empty where none is like it."""
    from difflib import get_close_matches  # here, because only a misspelt word needs it

    by_letters = {str(name).lstrip("-").lower(): str(name) for name in known}
    close = get_close_matches(word.lstrip("-").lower(), by_letters, n=1)
    return f" (did you mean {by_letters[close[0]]}?)" if close else ""


def unknown(what: str, word: str, known: Iterable[object]) -> str:
    """Return ``"unknown method 'plian' (did you mean plain?); choose one of plain, guarded"``."""
    names = [str(name) for name in known]
    return f"unknown {what} {word!r}{did_you_mean(word, names)}; choose one of {', '.join(names)}"
