"""The pictures of README and documents, made anew from real runs, so that they show what the program does now.

python -m benchmarks.pictures [NAME ...]      # all, or some of them; about five minutes

Needs Chromium and a Vulkan driver (Debian: chromium, mesa-vulkan-drivers).
"""

from __future__ import annotations

import argparse
import html
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

_DOCS = Path(__file__).parent.parent / "docs"
_BAR = 36  # height of Rerun's own bar at the top, which also tells of this machine's graphics
_TERMINAL = """<!doctype html><meta charset='utf-8'><style>body { margin: 0; background: #14171c; }
pre { margin: 0; padding: 18px 22px; font: 14px/1.4 'DejaVu Sans Mono', monospace; color: #d8dce2; }
b { color: #8fd0ff; font-weight: normal; }</style><pre>%s</pre>"""


def vvvaltr(*words: str | Path) -> str:
    """Run a command and return what it prints."""
    command = [sys.executable, "-m", "vvvaltr", *map(str, words)]
    environment = {**os.environ, "COLUMNS": "80"}
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=environment).stdout


def show_in_rerun(
    file: Path, picture: Path, size: tuple[int, int], at: tuple[str, float] | None = None, patience_s: float = 10.0
) -> None:
    """Open a recording or a log in Rerun without a screen, and write what it shows.

    Args:
        file: recording or log.
        picture: file to write, PNG.
        size: of the window.
        at: time line and place on it; None for what Rerun shows first.
        patience_s: time to load the file, and for Rerun's messages about the machine to fade.

    Raises:
        RuntimeError: Rerun ended, or does not answer.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    program = Path(str(import_module("rerun_cli").__file__)).with_name("rerun")
    window = ["--headless", "--hide-welcome-screen", "--window-size", "{}x{}".format(*size)]
    command = [str(program), *window, "--bind", "127.0.0.1", "--port", str(port), str(file)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as viewer:
        try:
            client = _connect(viewer, port)
            time.sleep(patience_s / 2)
            if at is not None:
                name, value = at
                client.set_time(name, **({"duration": value} if name == "time" else {"sequence": int(value)}))
            time.sleep(patience_s / 2)
            client.save_screenshot(str(picture.resolve()))
        finally:
            viewer.send_signal(signal.SIGTERM)


def _connect(viewer: subprocess.Popen[bytes], port: int) -> ViewerClient:
    from rerun.experimental import ViewerClient

    deadline_s = time.monotonic() + 30.0
    while True:
        try:
            return ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        except ConnectionError as error:
            if viewer.poll() is not None:
                raise RuntimeError("Rerun ended: is a Vulkan driver installed (mesa-vulkan-drivers)?") from error
            if time.monotonic() > deadline_s:
                raise RuntimeError("Rerun does not answer") from error
            time.sleep(0.2)


def show_in_chromium(page: Path, picture: Path, size: tuple[int, int]) -> None:
    """Write what Chromium shows of a page."""
    program = shutil.which("chromium") or "google-chrome"
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size={},{}".format(*size)]
    command = [program, *flags, f"--screenshot={picture}", page.as_uri()]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


class Studio:
    """Real runs in a temporary folder, made when the first picture needs them.

    Args:
        folder: where the runs are made.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def rerun(self) -> None:
        """Show a run in Rerun."""
        self._view("rerun", self._flat, at=("time", 198.0))

    def side_by_side(self) -> None:
        """Show source and target in Rerun."""
        self._view("side-by-side", self._flat, self._hills, at=("time", 145.0))

    def bare_log(self) -> None:
        """Show the log itself in Rerun."""
        show_in_rerun(self._flat / "trials.mcap", _DOCS / "bare-log.png", (1000, 600))
        _finish(_DOCS / "bare-log.png", crop_bar=True)

    def spatial(self) -> None:
        """Show the spatial twin on hills."""
        run = self._make("spatial", "trial", "45", "38", "-30", "--robot", "spatial", "--world", "hills")
        self._view("spatial", run, at=("time", 5.5), size=(1400, 900))

    def report(self) -> None:
        """Show the top of the report of a run."""
        page = self._folder / "report.html"
        vvvaltr("report", self._hills, "--out", page)
        show_in_chromium(page, _DOCS / "report.png", (1100, 1000))
        _finish(_DOCS / "report.png")

    def terminal(self) -> None:
        """Show a list of runs, and one of them, as in a terminal."""
        hills = self._hills
        parts = [
            ("vvvaltr runs", vvvaltr("runs", hills.parent)),
            ("vvvaltr show runs/hills", vvvaltr("show", hills).replace(f"{hills.parent}/", "runs/")),
        ]
        text = "\n".join(f"<b>$ {command}</b>\n{html.escape(output)}" for command, output in parts)
        page = self._folder / "terminal.html"
        page.write_text(_TERMINAL % text, encoding="utf-8")
        show_in_chromium(page, _DOCS / "terminal.png", (760, 20 * (text.count("\n") + 1) + 40))
        _finish(_DOCS / "terminal.png")

    def landscape(self) -> None:
        """Draw the speed over two motors."""
        picture = self._folder / "landscape.png"
        vvvaltr("landscape", "--robot", "planar", "--grid", "15", "--out", picture)
        shutil.copyfile(picture, _DOCS / "landscape.png")

    @property
    def _flat(self) -> Path:
        return self._make("flat", "learn", "--robot", "planar", "--trials", "40", "--seed", "1")

    @property
    def _hills(self) -> Path:
        more = ("--world", "hills", "--source", str(self._flat), "--trials", "30", "--seed", "2")
        return self._make("hills", "learn", "--robot", "planar", *more)

    def _make(self, name: str, *words: str) -> Path:
        run = self._folder / "runs" / name
        if not run.exists():
            print(f"  {name}: vvvaltr {' '.join(words)}", flush=True)
            vvvaltr(*words, "--quiet", "--out", run)
        return run

    def _view(self, name: str, *runs: Path, at: tuple[str, float], size: tuple[int, int] = (1600, 1000)) -> None:
        recording = self._folder / f"{name}.rrd"
        vvvaltr("view", *runs, "--save", recording)
        show_in_rerun(recording, _DOCS / f"{name}.png", size, at, patience_s=20.0)
        _finish(_DOCS / f"{name}.png", crop_bar=True)


def _finish(picture: Path, crop_bar: bool = False) -> None:
    """Crop and write a picture with few colours, which a repository can bear."""
    with Image.open(picture) as image:
        top = _BAR if crop_bar else 0
        shown = image.convert("RGB").crop((0, top, image.width, image.height))
    shown.quantize(256, dither=Image.Dither.NONE).save(picture, optimize=True)
    print(f"{picture.name}: {shown.width} x {shown.height}, {picture.stat().st_size // 1000} kB", flush=True)


def main() -> None:
    """Make the pictures."""
    names = ("rerun", "side_by_side", "bare_log", "spatial", "report", "terminal", "landscape")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "names", nargs="*", choices=[[], *names], metavar="NAME", help=f"{', '.join(names)} (default all)"
    )
    wanted = parser.parse_args().names or names
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(Path(folder))
        for name in wanted:
            make: Callable[[], None] = getattr(studio, name)
            make()


if __name__ == "__main__":
    main()
