"""Pages that need nothing else: HTML with its style and its pictures inside, for screen, telephone and paper."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 140

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 1150px; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-top: 1px solid #ccc; padding-top: 1rem; }
figure { margin: 1.2rem 0; break-inside: avoid; } figure img { max-width: 100%; height: auto; }
figcaption, caption { color: #555; font-size: 0.9em; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 30rem), 1fr)); gap: 0 2rem; }
caption { text-align: left; padding-bottom: 0.3em; } .wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.85em; margin: 1rem 0; }
th, td { padding: 0.3em 0.7em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
tbody th { white-space: nowrap; } td { font-variant-numeric: tabular-nums; }
code { background: #f0f2f4; padding: 0.1em 0.3em; border-radius: 3px; overflow-wrap: anywhere; user-select: all; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: #f0f2f4; padding: 0.6em 0.8em; border-radius: 6px; user-select: all; }
.key { background: #f3f6f9; padding: 0.8em 1em; border-radius: 6px; } .key b { font-size: 1.2em; }
@media print { body { max-width: none; margin: 0; font-size: 11pt; } h2 { break-after: avoid; } a { color: inherit; } }
""".strip()  # noqa: E501


def write_page(title: str, body: str) -> str:
    """Return a whole page; ``body`` is HTML."""
    return (
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>{escape(title)}</title>\n"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>\n"
        # An icon of no bytes, or a browser would ask a server for one.
        f"<link rel='icon' href='data:,'><style>{_STYLE}</style></head>\n"
        f"<body>{body}</body></html>\n"
    )


def to_png(figure: Figure) -> bytes:
    """Return a figure as a picture."""
    picture = BytesIO()
    figure.savefig(picture, dpi=_DPI, format="png")
    return picture.getvalue()


def to_svg(figure: Figure) -> bytes:
    """Return a figure as lines, which stay sharp; the same figure gives the same bytes."""
    from matplotlib import rc_context

    drawing = BytesIO()
    with rc_context({"svg.hashsalt": "vvvaltr"}):
        figure.savefig(drawing, format="svg", metadata={"Date": None})
    return drawing.getvalue()


def write_figure(picture: bytes, caption: str, alternative: str = "") -> str:
    """Return a picture, PNG or SVG, with its caption.

    ``alternative`` says what is to be seen to those who cannot see it; the caption, where it is empty.
    """
    data = base64.b64encode(picture).decode()
    kind = "png" if picture.startswith(b"\x89PNG") else "svg+xml"
    return (
        f"<figure><img src='data:image/{kind};base64,{data}' alt='{escape(alternative or caption, quote=True)}'>"
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def write_table(caption: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of text; the first cell of each row is its name."""
    head = "".join(f"<th scope='col'>{escape(name)}</th>" for name in columns)
    body = "".join(
        f"<tr><th scope='row'>{escape(name)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for name, *cells in rows
    )
    return (
        f"<div class='wide'><table><caption>{escape(caption)}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
