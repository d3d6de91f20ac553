"""A run in Rerun: as a recording, in a window or the browser, or live while it learns.

Rerun is imported where it is needed and never during a trial: the import takes a second and 100 MB.
"""

from __future__ import annotations

import gc
import logging
import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.core.disk import write_whole
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import Event, LoggedTrial, Run
from vvvaltr.controller.view.canvas import Canvas, drawable
from vvvaltr.controller.view.layout import lay_out, lay_out_side_by_side
from vvvaltr.controller.view.scene import Scene
from vvvaltr.controller.view.speed_maps import Belief, Predict
from vvvaltr.controller.view.watching import Moment, WatchedRobot
from vvvaltr.controller.view.words import write_about

if TYPE_CHECKING:
    import rerun.blueprint as rrb

_APPLICATION = "vvvaltr"
_FRAME_S = 0.1
_LOGGER = logging.getLogger(__name__)
_LOCAL = "127.0.0.1"  # nothing is shown to other computers


@dataclass(frozen=True, slots=True)
class Shown:
    """A run to be shown.

    Args:
        run: the run.
        title: its name for people.
        space: gaits that it searches, for the maps of expected speed; None for no maps.
        beliefs: what it believed after some of its trials, in their order.
        trial: number of the only trial to show, with what was known after it; None for all.
    """

    run: Run
    title: str
    space: GaitSpace | None = None
    beliefs: Iterable[Belief] = ()
    trial: int | None = None

    def __post_init__(self) -> None:
        _ = self.trials  # refused before anything is recorded, for Rerun complains of a recording that is left

    @property
    def name(self) -> str:
        """The title as Rerun can draw it."""
        return drawable(self.title)

    @property
    def trials(self) -> Sequence[LoggedTrial]:
        """The trials to show. Raises UserError where the only one is not in the run."""
        if self.trial is None:
            return self.run.trials
        found = [logged for logged in self.run.trials if logged.trial.number == self.trial]
        if not found:
            count = len(self.run.trials)
            raise UserError(f"{self.title} has no trial {self.trial}: it has {count}, counted from 1")
        return found


@contextmanager
def without_collection() -> Iterator[None]:
    """Around what makes millions of objects that all stay: to look for garbage among them takes a fifth of the time.

    Nor are they looked at afterwards.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if was_enabled:
            gc.enable()


def save_recording(path: Path, *shown: Shown) -> None:
    """Write a run as a Rerun recording, or several side by side. An existing file is replaced.

    Args:
        path: file to write, ``.rrd``.
        shown: the runs.

    Raises:
        UserError: the file cannot be written, or the only trial to show does not exist.
    """
    import rerun as rr

    roots = [""] if len(shown) == 1 else _make_roots([it.name for it in shown])
    # Through memory: on a full disk Rerun's own writer waits for ever, and no signal ends it.
    with without_collection(), rr.RecordingStream(_APPLICATION) as recording:
        memory = recording.memory_recording()
        recording.send_blueprint(_blueprint(shown, roots), make_active=False)
        recording.send_recording_name(" and ".join(it.name for it in shown))
        for it, root in zip(shown, roots, strict=True):
            _send(it, Canvas(recording, root))
        written = memory.drain_as_bytes()
        recording.disconnect()
    _write(written, path)


def _blueprint(shown: Sequence[Shown], roots: Sequence[str]) -> rrb.Blueprint:
    if len(shown) == 1:
        return lay_out(shown[0].run, shown[0].trials, shown[0].space)
    return lay_out_side_by_side([(it.name, it.run, it.space) for it in shown], roots)


def _make_roots(titles: Sequence[str]) -> list[str]:
    """Return a path for each run, named after it, as Rerun writes paths; runs of the same name are numbered."""
    import rerun as rr

    names = [title.replace("/", "_") or "run" for title in titles]
    unique = [name if names.count(name) == 1 else f"{name} ({place})" for place, name in enumerate(names, 1)]
    return [f"/{rr.escape_entity_path_part(name)}" for name in unique]


def _send(shown: Shown, canvas: Canvas) -> None:
    scene = Scene(canvas, shown.run.structure, about=write_about(shown.run, shown.space is not None))
    scene.remember(
        logged for logged in shown.run.trials if shown.trial is not None and logged.trial.number < shown.trial
    )
    scene.add(shown.trials)
    for belief in shown.beliefs:
        if shown.trial is None or belief.trial == shown.trial:
            scene.add_belief(belief)


def _write(recording: bytes, path: Path) -> None:
    """Write the whole file or nothing of it."""
    try:
        write_whole(path, recording)
    except OSError as error:
        raise UserError(
            f"{path} cannot be written: {error.strerror}; free some space, or choose another place"
        ) from error


def show(*shown: Shown, web: bool = False) -> None:
    """Open runs in the Rerun viewer, or with ``web`` in the browser, and return when the viewer is closed.

    Raises:
        UserError: there is no screen, or the viewer failed.
    """
    if not web:
        _require_screen()
    with tempfile.TemporaryDirectory(prefix="vvvaltr-") as folder:
        recording = Path(folder) / "run.rrd"
        save_recording(recording, *shown)
        ports = ("--port", str(_free_port(9876)), "--web-viewer-port", str(_free_port(9090)))
        how = ("--web-viewer", *ports) if web else ("--new",)
        status = subprocess.run(_viewer(str(recording), *how), check=False).returncode
    if status != 0:
        raise UserError(f"the Rerun viewer failed with status {status}: --save writes the recording to a file instead")


class LiveView:
    """Shows a run while it learns, to every viewer on this computer that connects to ``url``.

    It is an ``Observer`` of the run. It never waits for a viewer, and a late viewer receives everything sent before.

    Args:
        run: the run so far.
        title: name of the recording in the viewer.
        space: gaits that are searched, for the maps; None for no maps.
        predict: returns what is believed of gaits at present, for the maps, which are drawn anew after each trial.
        planned: number of trials that the run is to make; 0 where that is unknown.

    Attributes:
        url: address for a viewer to connect to.
        frames: number of times that a running trial was shown.

    Raises:
        UserError: no network port is free.
    """

    def __init__(
        self, run: Run, title: str, space: GaitSpace | None = None, predict: Predict | None = None, planned: int = 0
    ) -> None:
        import rerun as rr

        port = _free_port(9876)
        self.url = f"rerun+http://{_LOCAL}:{port}/proxy"
        self._space, self._predict = space, predict
        self._recording = rr.RecordingStream(_APPLICATION)
        server = rr.GrpcServerSink(bind_ip=_LOCAL, port=port)
        self._recording.set_sinks(server, default_blueprint=lay_out(run, run.trials, space, following=True))
        self._recording.send_recording_name(drawable(title))
        self.frames = 0
        self._is_over, self._lock = threading.Event(), threading.Lock()
        self._thread: threading.Thread | None = None
        self._scene = Scene(Canvas(self._recording), run.structure, planned, write_about(run, space is not None))
        self._scene.add(run.trials)

    def watch(self, robot: Robot) -> Robot:
        """Return the robot with a watch around it, so that it is shown ten times a second while a trial runs."""
        watched = WatchedRobot(robot)
        self._thread = threading.Thread(target=self._follow, args=(watched,), name="live view", daemon=True)
        self._thread.start()
        return watched

    def _follow(self, robot: WatchedRobot) -> None:
        shown: Moment | None = None
        while not self._is_over.wait(_FRAME_S):
            moment = robot.moment
            if moment is None or moment is shown:
                continue
            try:
                with self._lock:
                    self._scene.show_moment(moment)
            except Exception as error:  # whatever it is, it must not end the run, as with any observer
                _LOGGER.warning(
                    "the live view shows trials only when they are over: %s: %s", type(error).__name__, error
                )
                return
            shown = moment
            self.frames += 1

    def open_window(self) -> None:
        """Open a viewer, which stays open when the run ends. Raises UserError where there is no screen."""
        _require_screen()
        quiet = subprocess.DEVNULL
        # In a session of its own, an interrupt of the run does not reach it.
        self._window = subprocess.Popen(
            _viewer("--connect", self.url), stdout=quiet, stderr=quiet, start_new_session=True
        )

    def on_trial(self, logged: LoggedTrial) -> None:
        """Show one more trial."""
        with self._lock:
            self._show(logged)

    def _show(self, logged: LoggedTrial) -> None:
        self._scene.add([logged])
        if self._space is not None and self._predict is not None and logged.score is not None:
            self._scene.add_belief(Belief(logged.trial.number, self._space, self._predict))

    def on_event(self, event: Event) -> None:
        """Do nothing: the view shows trials."""

    def close(self) -> None:
        """Send what is left and stop serving. Idempotent."""
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
        with suppress(RuntimeError):  # the server is gone, and with it every viewer
            self._recording.flush()
        self._recording.disconnect()


def _viewer(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "rerun", "--bind", _LOCAL, *arguments]


def _require_screen() -> None:
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UserError("there is no screen for a window: --web shows it in the browser, --save writes it to a file")


def _free_port(preferred: int) -> int:
    """Return the port ``preferred``, or any free one where it is taken. Raises UserError where none is free."""
    for port in (preferred, 0):
        with socket.socket() as listener, suppress(OSError):
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((_LOCAL, port))
            return int(listener.getsockname()[1])
    raise UserError("no network port is free on this computer: close some programs")
