"""``learn`` on a mock that a camera sees: the displacement of each trial beside the twin's own."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.camera.feed import make_feed

_MOCK = """
import sys
from benchmarks.camera_learning import note_truth
from vvvaltr.controller.cli.main import main
note_truth(sys.argv[1])
sys.exit(main(["mock", "qik", "--tracker", "camera", "--link", sys.argv[2]]))
"""


def note_truth(path: str) -> None:
    """Make the mock of this process write down each pose that it shows to the camera: time, x and y."""
    import vvvaltr.drivers.trackers.camera as camera
    from vvvaltr.drivers.trackers.registry import MockFeed

    file = Path(path).open("w", buffering=1, encoding="utf-8")  # noqa: SIM115  as long as the process lives

    def teed() -> MockFeed:
        mock = make_feed()
        send = mock.feed.send

        def noted(pose: Pose) -> None:
            file.write(f"{pose.t_s!r} {pose.position_m[0]!r} {pose.position_m[1]!r}\n")
            send(pose)

        mock.feed.send = noted  # type: ignore[method-assign]
        return mock

    camera.TRACKER = replace(camera.TRACKER, make_feed=teed)


def learning(trials: int = 8) -> dict[str, Any]:
    """Run ``vvvaltr learn`` on a mock that is seen by the camera, and compare each displacement with the twin's."""
    with tempfile.TemporaryDirectory() as folder:
        truth, link, run = (str(Path(folder, name)) for name in ("truth", "qik", "run"))
        mock = subprocess.Popen(
            [sys.executable, "-c", _MOCK, truth, link], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL
        )
        assert mock.stdout is not None
        mock.stdout.readline()
        reader = threading.Thread(target=mock.stdout.read, daemon=True)
        reader.start()
        try:
            command = [
                "learn",
                "--robot",
                f"{link}.toml",
                "--trials",
                str(trials),
                "--out",
                run,
                "--no-recording",
                "--json",
            ]
            program = "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main(sys.argv[1:]))"
            subprocess.run([sys.executable, "-c", program, *command], check=True, stdout=subprocess.DEVNULL)
        finally:
            mock.terminate()
            mock.wait()
        return _compared(Path(run), np.loadtxt(truth))


def _compared(run: Path, truth: Any) -> dict[str, Any]:
    from vvvaltr.controller.runs.log import read_run

    offset_s = time.time() - time.monotonic()
    pairs = []
    for logged in read_run(run).trials:
        poses = [pose for pose in logged.trial.poses if pose.t_s >= 0.0]
        if not logged.trial.outcome.is_valid:
            continue
        rows = _matched(truth, np.array([pose.t_s for pose in poses]), logged.trial.started_unix_s - offset_s)
        seen = np.subtract(poses[-1].position_m[:2], poses[0].position_m[:2])
        pairs.append(
            (
                float(np.hypot(*seen)),
                float(np.hypot(*(rows[-1] - rows[0]))),
                float(np.hypot(*(seen - rows[-1] + rows[0]))),
            )
        )
    good = sum(abs(seen - true) <= max(0.001, 0.03 * true) for seen, true, _ in pairs)
    shown = [
        {"seen_mm": round(1e3 * seen, 2), "true_mm": round(1e3 * true, 2), "off_mm": round(1e3 * off, 2)}
        for seen, true, off in pairs
    ]
    return {"valid_trials": len(pairs), "within_1_mm_or_3_percent": good, "displacements": shown}


def _matched(truth: Any, times_s: Any, began_s: float) -> Any:
    """Return the true places at a trial's poses: a log keeps their distances in time, to the microsecond.

    A picture that the camera took while the mock told nothing shows what was told last: its time is not in the truth.
    """
    best, most = None, 0
    for start in np.flatnonzero(np.abs(truth[:, 0] - began_s) < 2.0):
        wanted = truth[start, 0] + times_s - times_s[0]
        rows = np.clip(np.searchsorted(truth[:, 0], wanted + 1e-4) - 1, 0, len(truth) - 1)
        matching = int(np.sum(np.abs(truth[rows, 0] - wanted) < 1e-5))
        if matching > most:
            best, most = truth[rows, 1:], matching
    if best is None or most < 0.5 * len(times_s):
        raise ValueError(f"the poses of a trial are not those that were shown: only {most} of {len(times_s)} are")
    return best
