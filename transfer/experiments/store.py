"""A campaign on disk: its settings in `campaign.toml`, and one file of JSON lines per unit of work below `runs/`.

A file appears whole or not at all, so that a campaign which was interrupted is left with whole units and can continue.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import tomli_w

from vvvaltr.controller.core.conditions import GREATEST_SPEED_M_S
from vvvaltr.controller.core.disk import make_own_folder, read_bytes, read_text, write_whole
from vvvaltr.controller.core.document import parse_toml
from vvvaltr.controller.core.errors import UserError
from vvvaltr.transfer.experiments.unit import Result, Settings, Step, Truth, Unit

_OPTIONS = {"duration_s": "--duration", "most_trials": "--trials", "heading_limit_rad": "--heading-limit"}
_FORMER = {"scatter": "frequency", "heading_limit_rad": 1.0}  # of campaigns that do not name theirs
_MOTORS, _GREATEST_HZ = 3, 1e5  # of the experiments' bodies
_ENCODER = msgspec.json.Encoder()
_DECODER = msgspec.json.Decoder(Step | Truth)


class Store:
    """The results of one campaign."""

    def __init__(self, folder: Path, settings: Settings) -> None:
        self.folder = folder
        self.settings = settings

    @classmethod
    def open(cls, folder: Path) -> Store:
        """Open the campaign in ``folder``. Raises UserError where there is none or it cannot be read."""
        path = folder / "campaign.toml"
        try:
            content = {**_FORMER, **parse_toml(read_text(path))}
            if missing := set(Settings.__struct_fields__) - set(content):
                raise ValueError(f"{min(missing)} is missing")
            return cls(folder, msgspec.convert(content, Settings))
        except FileNotFoundError:
            raise UserError(f"{folder} is not a campaign: name the directory that vvvaltr experiment wrote") from None
        except OSError as error:
            raise UserError(f"{path}: {error.strerror}; restore the file as the campaign wrote it") from None
        except ValueError as error:  # of TOML, UTF-8 and the settings alike
            raise UserError(f"{path}: {error}; restore the file as the campaign wrote it") from None

    @classmethod
    def begin(cls, folder: Path, settings: Settings) -> Store:
        """Open the campaign in ``folder`` to continue it, or begin one there.

        Raises:
            UserError: the folder holds a campaign with other settings, or something else, or cannot be made.
        """
        if (folder / "campaign.toml").exists():
            store = cls.open(folder)
            for key in Settings.__struct_fields__:
                has, asked = getattr(store.settings, key), getattr(settings, key)
                if has != asked:
                    raise UserError(
                        f"{_OPTIONS.get(key, f'--{key}')}: the campaign in {folder} has {has}, but {asked} was asked "
                        "for; choose another --out"
                    )
            return store
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise UserError(f"{folder} exists and is not a campaign: choose another --out")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_whole(folder / "campaign.toml", tomli_w.dumps(msgspec.to_builtins(settings)))
        except OSError as error:
            raise UserError(f"{folder} cannot be made: {error.strerror}; choose another --out, or make room") from error
        return cls(folder, settings)

    def has(self, unit: Unit) -> bool:
        """Return whether the unit is done."""
        return self._path(unit).exists()

    def save(self, unit: Unit, result: Result) -> None:
        """Store the result of a unit. Raises OSError where the file cannot be written."""
        path = self._path(unit)
        make_own_folder(self.folder / "runs")
        make_own_folder(path.parent)
        write_whole(path, _ENCODER.encode_lines([*result.steps, *result.truths]))

    def load(self, unit: Unit) -> Result:
        """Return the result of a unit that is done. Raises UserError where its file is damaged."""
        path = self._path(unit)
        try:
            lines = _DECODER.decode_lines(read_bytes(path))
            steps = tuple(line for line in lines if isinstance(line, Step))
            result = Result(steps, tuple(line for line in lines if isinstance(line, Truth)))
            _check_whole(result, unit)
        except OSError as error:
            raise UserError(f"{path}: {error.strerror}; delete it and run the experiment again") from None
        except (ValueError, RecursionError) as error:  # of JSON and UTF-8 as well
            raise UserError(f"{path}: {error}; delete the file and run the experiment again") from None
        return result

    def _path(self, unit: Unit) -> Path:
        return self.folder / "runs" / f"{unit.name}.jsonl"


def _check_whole(result: Result, unit: Unit) -> None:
    """Raise ValueError if this is less than ``unit`` finds, or more."""
    if len(result.steps) != unit.trials:
        raise ValueError(f"it holds {len(result.steps)} trials instead of {unit.trials}")
    if tuple(truth.after for truth in result.truths) != unit.checkpoints or not all(
        truth.speeds_m_s for truth in result.truths
    ):
        raise ValueError(f"it does not hold the true speeds after trials {', '.join(map(str, unit.checkpoints))}")
    gaits = [gait_hz for step in result.steps for gait_hz in (step.gait_hz, step.recommended_hz)]
    if any(len(gait_hz) != _MOTORS or max(map(abs, gait_hz)) > _GREATEST_HZ for gait_hz in gaits):
        raise ValueError("it holds a gait that no twin has")
    speeds_m_s = [step.score_m_s for step in result.steps] + [it for true in result.truths for it in true.speeds_m_s]
    if any(abs(speed_m_s) > GREATEST_SPEED_M_S for speed_m_s in speeds_m_s):
        raise ValueError("it holds a speed that no robot has")
