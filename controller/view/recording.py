"""A run in Rerun: as a recording, in a window or the browser, or live while it learns.

Rerun is imported where it is needed and never during a trial: the import takes a second and 100 MB.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.disk import write_whole
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import Event, LoggedTrial, Run
from vvvaltr.controller.view.scene import Scene, write_result
from vvvaltr.controller.view.speed_maps import MAP_X, MAP_Y, Learned, Pair, map_path, send_maps

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

_APPLICATION = "vvvaltr"
_LOCAL = "127.0.0.1"  # nothing is shown to other computers


def save_recording(run: Run, path: Path, title: str, learned: Learned | None = None) -> None:
    """Write a run as a Rerun recording. An existing file is replaced.

    Args:
        run: the run.
        path: file to write, ``.rrd``.
        title: name of the recording in the viewer.
        learned: what the run has learned, for the maps of expected speed; None for no maps.

    Raises:
        UserError: the file cannot be written.
    """
    import rerun as rr

    # Through memory: on a full disk Rerun's own writer waits for ever, and no signal ends it.
    with rr.RecordingStream(_APPLICATION) as recording:
        memory = recording.memory_recording()
        recording.send_blueprint(_blueprint(run, learned), make_active=False)
        recording.send_recording_name(title)
        Scene(recording, run.structure).add(run.trials)
        _send_result(recording, run.trials, learned)
        written = memory.drain_as_bytes()
        recording.disconnect()
    _write(written, path)


def _write(recording: bytes, path: Path) -> None:
    """Write the whole file or nothing of it."""
    try:
        write_whole(path, recording)
    except OSError as error:
        raise UserError(
            f"{path} cannot be written: {error.strerror}; free some space, or choose another place"
        ) from error


def show(run: Run, title: str, learned: Learned | None = None, web: bool = False) -> None:
    """Open a run in the Rerun viewer, or with ``web`` in the browser, and return when the viewer is closed.

    Raises:
        UserError: there is no screen, or the viewer failed.
    """
    if not web:
        _require_screen()
    with tempfile.TemporaryDirectory(prefix="vvvaltr-") as folder:
        recording = Path(folder) / "run.rrd"
        save_recording(run, recording, title, learned)
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
        learned: what the run learns, for the maps, which are drawn anew after each trial; None for no maps.

    Attributes:
        url: address for a viewer to connect to.

    Raises:
        UserError: no network port is free.
    """

    def __init__(self, run: Run, title: str, learned: Learned | None = None) -> None:
        import rerun as rr

        port = _free_port(9876)
        self.url = f"rerun+http://{_LOCAL}:{port}/proxy"
        self._learned = learned
        self._recording = rr.RecordingStream(_APPLICATION)
        server = rr.GrpcServerSink(bind_ip=_LOCAL, port=port)
        self._recording.set_sinks(server, default_blueprint=_blueprint(run, learned, following=True))
        self._recording.send_recording_name(title)
        self._scene = Scene(self._recording, run.structure)
        self._scene.add(run.trials)
        _send_result(self._recording, run.trials, learned=None)  # a resumed run has yet to tell it its trials

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
        self._scene.add([logged])
        _send_result(self._recording, self._scene.trials, self._learned)

    def on_event(self, event: Event) -> None:
        """Do nothing: the view shows trials."""

    def close(self) -> None:
        """Send what is left and stop serving. Idempotent."""
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


def _send_result(recording: rr.RecordingStream, trials: Sequence[LoggedTrial], learned: Learned | None) -> None:
    """Send the result of the run so far, for all points of the time line."""
    import rerun as rr

    text = write_result(trials)
    if learned is not None:
        text += (
            "\n\nMaps: speed expected over two motors, the others as in the best gait. White: trials; red: best gait."
        )
        send_maps(recording, learned, trials)
    recording.log("result", rr.TextDocument(text, media_type="text/markdown"), static=True)


def _blueprint(run: Run, learned: Learned | None, following: bool = False) -> rrb.Blueprint:
    """Return the layout: the robot and its motors on the left, the result and the learned maps on the right."""
    import rerun.blueprint as rrb

    result = rrb.TextDocumentView(origin="result", name="Result")
    right: list[rrb.View | rrb.Container] = [rrb.Horizontal(result, _trials_view()), _speed_view()]
    if learned is not None and learned.pairs:
        right.append(rrb.Grid(*map(_map_view, learned.pairs), grid_columns=3))
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(_robot_view(run), _motor_view(), row_shares=[3, 2]), rrb.Vertical(*right)),
        rrb.TimePanel(timeline="time", state="collapsed", play_state="following" if following else None),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _robot_view(run: Run) -> rrb.Spatial3DView:
    """Return a view of everywhere the robot went, from the front and a little above."""
    import rerun.blueprint as rrb

    trails = [pose.position_m for logged in run.trials for pose in logged.trial.poses if pose.is_finite]
    lowest, highest = (bound(trails or [(0.0, 0.0, 0.05)], axis=0) for bound in (np.min, np.max))
    centre, extent_m = (lowest + highest) / 2, max(0.2, float(np.max(highest - lowest)))
    eye = rrb.EyeControls3D(
        position=centre + (0.15 + 0.6 * extent_m) * np.array([0.2, -1.0, 0.3]),
        look_target=centre,
        eye_up=(0.0, 0.0, 1.0),
    )
    has_ground = run.structure is not None and run.structure.terrain is not None
    return rrb.Spatial3DView(origin="world", name="Robot", eye_controls=eye, line_grid=not has_ground)


def _motor_view() -> rrb.TimeSeriesView:
    """Return a view of the ten seconds around the cursor: a whole run would show as nothing but stripes."""
    import rerun.blueprint as rrb

    begin, end = (rrb.TimeRangeBoundary.cursor_relative(seconds=seconds) for seconds in (-5, 5))
    return rrb.TimeSeriesView(
        origin="motors",
        name="Motor frequencies (Hz): dark as commanded, bright as applied",
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(begin, end)),
    )


def _speed_view() -> rrb.TimeSeriesView:
    import rerun.blueprint as rrb

    whole = rrb.TimeRange(rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin="speed",
        name="Speed of each trial (mm/s)",
        axis_x=rrb.TimeAxis(view_range=whole),
        plot_legend=rrb.Corner2D.RightBottom,
    )


def _trials_view() -> rrb.TextLogView:
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn, TimelineColumn

    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn("time", visible=False), TimelineColumn("trial", visible=False)],
        text_log_columns=[TextLogColumn("Body")],
    )
    return rrb.TextLogView(origin="trials", name="Trials", columns=columns)


def _map_view(pair: Pair) -> rrb.Spatial2DView:
    import rerun.blueprint as rrb

    return rrb.Spatial2DView(
        origin=map_path(pair),
        name=f"Learned: motors {pair[0].motor + 1}, {pair[1].motor + 1}",
        visual_bounds=rrb.VisualBounds2D(x_range=MAP_X, y_range=MAP_Y),
    )
