"""Driving by hand as a run, so that what is driven counts as trials do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec

from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.loop.jog import Keyboard, PacedClock, choose_movements, jog
from vvvaltr.controller.loop.staying import Staying
from vvvaltr.controller.robot.opening import Rig, choose_robot, open_rig
from vvvaltr.controller.studies.going import check_fit, usable_repertoire
from vvvaltr.controller.studies.steering_run import SteeringRun, steering_config
from vvvaltr.transfer.steering.repertoire import Repertoire

METHOD = "jog"


class JogRun:
    """A robot under the keys of a person: robot and log are open."""

    def __init__(self, run: SteeringRun, rig: Rig, repertoire: Repertoire) -> None:
        self.run = run
        self._rig = rig
        self._gaits = choose_movements(repertoire)

    @classmethod
    def create(cls, path: Path, asked: dict[str, Any], seed: int, sources: Sequence[Path]) -> JogRun:
        """Begin in a new folder.

        Raises:
            UserError: something asked for is impossible, or ``path`` exists; nothing has been written.
            DeviceError: the robot cannot be opened.
        """
        choice = choose_robot(asked)
        repertoire = usable_repertoire(choice, sources)
        rig = open_rig(choice, seed)
        try:
            check_fit(repertoire, rig, sources)
            config = steering_config(choice, rig, METHOD, seed, 1, rig.settings.duration_s)
            config = msgspec.structs.replace(config, sources=tuple(map(str, sources)))
            return cls(SteeringRun.create(path, config, Run(rig.robot.structure), repertoire), rig, repertoire)
        except BaseException:
            rig.robot.close()
            raise

    @property
    def keys(self) -> tuple[str, ...]:
        """What the arrow keys can do with these movements."""
        return tuple(self._gaits)

    def jog(self, keyboard: Keyboard) -> Iterator[LoggedTrial]:
        """Drive until somebody quits; yields each held key once it is recorded. See ``jog`` for what is raised."""
        robot = self._rig.robot
        robot.place(1)
        staying = Staying(robot, PacedClock(robot.clock) if self.run.config.robot.is_twin else None)
        yield from jog(staying, self._gaits, keyboard, self._rig.settings, self.run.record)

    def summarise(self) -> dict[str, Any]:
        """Write `summary.json` and return what is in it."""
        driven_s = sum(logged.trial.duration_s for logged in self.run.trials)
        result = {"run": str(self.run.path), "trials": len(self.run.trials), "duration_s": driven_s}
        self.run.summarise(result)
        return result

    def close(self) -> None:
        """Stop the motors, let go of the robot and close the log."""
        with closing(self.run), closing(self._rig.robot):
            pass
