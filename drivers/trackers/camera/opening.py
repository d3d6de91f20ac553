"""Where pictures come from: a camera of this computer, a film, a folder of pictures, or another program."""

from __future__ import annotations

import time
from pathlib import Path

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.device import DeviceSource
from vvvaltr.drivers.trackers.camera.frames import FrameReader
from vvvaltr.drivers.trackers.camera.recorded import FilmSource, FolderSource
from vvvaltr.drivers.trackers.camera.source import FRAMES, Frame, NoPictureNow, Source, Wanted

_DEVICES = Path("/dev")
_LOOK_S = 0.002  # between two looks for a picture of another program
_GONE_S, _GONE_PERIODS = 5.0, 5.0  # without a picture, after which another program is taken to have ended


def open_source(source: int | str, wanted: Wanted, in_real_time: bool = True) -> Source:
    """Open a source of pictures.

    Args:
        source: a camera's number or path below /dev, a film, a folder of pictures, or ``frames:PATH``.
        wanted: what a camera is asked for; of a folder's pictures the rate.
        in_real_time: whether a film or folder is shown at its rate, without late pictures; else each picture in turn.

    Raises:
        UserError: there is no such source, or it cannot be opened: says why, and the cure.
    """
    path = _DEVICES / f"video{source}" if isinstance(source, int) else Path(source)
    if isinstance(source, str) and source.startswith(FRAMES):
        return SharedSource(Path(source.removeprefix(FRAMES)))
    if path.is_relative_to(_DEVICES):
        return DeviceSource(path, wanted)
    if path.is_dir():
        return FolderSource(path, wanted.rate_hz, in_real_time)
    return FilmSource(path, in_real_time)


class SharedSource:
    """Pictures of another program on this computer; see ``frames``. Raises UserError."""

    def __init__(self, path: Path) -> None:
        try:
            self._reader = FrameReader(path)
        except OSError as error:
            raise UserError(
                f"tracker.source: {path}: {error.strerror}; is the program that writes it running?"
            ) from None
        except ValueError as error:
            raise UserError(f"tracker.source: {path}: {error}") from None
        self.applied = Wanted(self._reader.width_px, self._reader.height_px, self._reader.rate_hz)
        self._path = path
        self._shown, self._given_s = -1, time.monotonic()

    def newest(self) -> Frame:
        """Wait for the next picture and return the newest one. Raises NoPictureNow."""
        patience_s = max(_GONE_S, _GONE_PERIODS / self.applied.rate_hz)
        while (found := self._reader.newest(self._shown)) is None:
            if time.monotonic() - self._given_s > patience_s:
                raise NoPictureNow(
                    f"no new picture in {self._path} for {patience_s:g} s; is the program that writes it running?"
                )
            time.sleep(_LOOK_S)
        self._given_s = time.monotonic()
        self._shown, t_s, grey = found
        if not t_s <= self._given_s:  # such a picture would never grow old, however long ago it was taken
            raise NoPictureNow(f"a picture in {self._path} is from the future; give it the time of time.monotonic()")
        return Frame(t_s, grey)

    def close(self) -> None:
        """Let go of the file. Idempotent."""
        self._reader.close()
