"""Radio struts that speak text: the laboratory's boards as they are, and boards with our own firmware."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from contextlib import suppress

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.links.curve import to_commands
from vvvaltr.drivers.links.gatt import GattLink, Word, in_words
from vvvaltr.drivers.motor_line import MotorLine, Patience, arm_or_close
from vvvaltr.drivers.struts.linked import LinkedStruts
from vvvaltr.drivers.struts.opening import open_links, wanted_of
from vvvaltr.drivers.struts.protocol import SEQUENCES, decode, encode_target, to_rpm
from vvvaltr.drivers.struts.strut import HOLD_S, LaboratoryStrut, OwnStrut, Strut
from vvvaltr.drivers.struts.table import NO_WATCHDOG_CURE, StrutsLineTable

_log = logging.getLogger(__name__)

_FIRST_S = 2.5  # the slowest builds report every 0.8 s
_ANSWER_S = 1.0  # time for a strut to acknowledge a stop
_LATE_STOP_S = 0.2  # the radio's 50 ms there and back, and both once more: later, the motor has run on


def open_line(table: StrutsLineTable) -> MotorLine:
    """Find all struts, connect to them together, and return their motors at rest, reports coming in.

    Raises:
        UserError: what Bluetooth needs is not installed, or a motor must be calibrated first.
        DeviceError: there is no Bluetooth; a strut is missing, is there twice, says nothing or the wrong thing.
        DeviceFault: a strut has no watchdog, and the robot's file does not allow that.
    """
    from vvvaltr.drivers.struts.rfduino import RfduinoLine, check_curves

    wanted = wanted_of(table)
    if table.is_rfduino:
        table.check()
        check_curves(table)
        return arm_or_close(RfduinoLine(open_links(table.adapter, wanted, reports=False), table))
    return arm_or_close(StrutsLine(open_links(table.adapter, wanted, reports=True), table))


class StrutsLine(LinkedStruts):
    """The motors of several struts: satisfies ``vvvaltr.drivers.motor_line.MotorLine``."""

    def __init__(self, link: GattLink, table: StrutsLineTable) -> None:
        super().__init__(link, table, encode_target(0), reports=True)
        self._curves = tuple(motor.calibration for motor in table.motor)
        self._struts: tuple[Strut, ...] = ()
        self._sequence = 0
        self._stop_s: list[float | None] = [None] * len(self._names)  # since when a stop is not acknowledged
        self._garbled = [0] * len(self._names)

    @property
    def watchdog_s(self) -> float:
        """The hold of a target; infinite where a strut has no watchdog."""
        return HOLD_S if all(strut.has_watchdog for strut in self._struts) else math.inf

    @property
    def patience(self) -> Patience:
        """As the slowest strut needs it."""
        each = [strut.patience(self._table.spin_up_s) for strut in self._struts]
        return Patience(
            max(patience.stale_s for patience in each),
            max(patience.start_s for patience in each),
            max(patience.lag_s for patience in each),
            max(patience.settle_s for patience in each),
        )

    @property
    def heard_s(self) -> float:
        """When the strut that has been silent for longest sent its last report, or was told to stop without a word."""
        stops_s = (math.inf if since_s is None else since_s for since_s in self._stop_s)
        return min(*(strut.heard_s for strut in self._struts), *stops_s)

    def check(self, gait: Gait) -> None:
        """Raise ValueError for a frequency beyond a calibration curve."""
        self._targets_rpm(gait)

    def send(self, gait: Gait) -> None:
        """Send each strut its target."""
        self._tell(self._targets_rpm(gait))

    repeat = send

    def rest(self) -> None:
        """Send each strut the target 0, to be acknowledged; as long as it is not, again and again."""
        self._tell((0,) * self.motor_count)

    def listen(self, until_s: float) -> None:
        """Receive reports and acknowledgements. Raises as ``MotorLine.listen`` does."""
        super().listen(until_s)
        self._check_stops(time.monotonic())

    def state(self) -> MotorState:
        """Return what the struts measured last, with the time of the oldest news."""
        return MotorState(
            min(strut.measured_s for strut in self._struts), tuple(strut.frequency_hz for strut in self._struts)
        )

    def arm(self) -> None:
        """Stop the motors, and wait for a report of each strut. Raises as ``open_line`` does."""
        for number in range(self.motor_count):
            self._link.write(number, encode_target(0), is_acknowledged=True)
        known: list[Strut | None] = [None] * self.motor_count
        end_s = time.monotonic() + _FIRST_S
        while not all(strut is not None and strut.is_ready for strut in known) and time.monotonic() < end_s:
            word = self._link.read(max(0.0, end_s - time.monotonic()))
            if word is not None and not word.acknowledges:
                known[word.strut] = self._meet(known[word.strut], word)
        self._struts = tuple(self._checked(strut, number) for number, strut in enumerate(known))
        self._garbled = [0] * self.motor_count
        self._check_watchdogs()

    def _meet(self, strut: Strut | None, word: Word) -> Strut | None:
        """Take one of the first reports of a strut, and return what is known of it."""
        try:
            report = decode(word.text)
        except ValueError as error:
            self._garbled[word.strut] += 1
            _log.debug("strut %s: %r: %s", self._names[word.strut], word.text, error)
            return strut
        if strut is None or (strut.has_watchdog and not strut.is_ready):
            kind = LaboratoryStrut if report.added is None else OwnStrut
            return kind(self._names[word.strut], report, word.heard_s)
        with suppress(DeviceFault):  # it may not have received the stop yet
            strut.take(report, word.heard_s)
        return strut

    def _checked(self, strut: Strut | None, number: int) -> Strut:
        """Return a strut that may be driven. Raises DeviceError if it may not."""
        name = f"strut {self._names[number]}"
        if strut is None and self._garbled[number]:
            raise DeviceFault(
                "text", f"{name}: what it reports makes no sense or is cut short; flash its firmware, or choose another"
            )
        if strut is None:
            raise DeviceTimeout(
                f"{name} lets itself be connected, but reports nothing; switch it off and on, and check its inertial "
                "sensor, without which the laboratory's firmware hangs"
            )
        if not strut.is_ready and (strut.has_watchdog or self._table.allow_no_watchdog):
            raise DeviceFault("stop", f"{name} does not obey a stop, or reports too seldom; switch it off")
        return strut

    def _check_watchdogs(self) -> None:
        """Say which struts have no watchdog. Raises DeviceFault unless the robot's file allows that."""
        without = [strut.name.removeprefix("strut ") for strut in self._struts if not strut.has_watchdog]
        if not without:
            return
        danger = (
            f"no watchdog in {in_words(without)}, which have the laboratory's firmware: a motor runs on when the "
            "radio link is lost or this program is killed"
        )
        if not self._table.allow_no_watchdog:
            raise DeviceFault("no_watchdog", f"{danger}; {NO_WATCHDOG_CURE}")
        self._warn(danger)

    def _targets_rpm(self, gait: Gait) -> tuple[int, ...]:
        return tuple(map(to_rpm, to_commands(self._curves, gait.frequency_hz, self.name)))

    def _tell(self, targets_rpm: Sequence[int]) -> None:
        now_s = time.monotonic()
        self._sequence = (self._sequence + 1) % SEQUENCES
        lost: LinkLost | None = None
        for number, (strut, rpm) in enumerate(zip(self._struts, targets_rpm, strict=True)):
            if (text := strut.tell(rpm, self._sequence, now_s)) is None:
                continue
            if rpm:
                self._stop_s[number] = None
            elif self._stop_s[number] is None:
                self._stop_s[number] = now_s
            try:
                self._link.write(number, text, is_acknowledged=rpm == 0)
            except LinkLost as error:
                lost = error  # the others are told all the same
        if lost is not None:
            self._stop_reachable()
            raise lost

    def _take(self, word: Word) -> None:
        name = self._names[word.strut]
        if word.acknowledges:
            since_s, self._stop_s[word.strut] = self._stop_s[word.strut], None
            if since_s is not None and word.heard_s - since_s > _LATE_STOP_S:
                raise DeviceTimeout(
                    f"strut {name} took {word.heard_s - since_s:.2f} s to stop, so its motor ran on; bring it nearer"
                )
            return
        try:
            report = decode(word.text)
        except ValueError as error:
            self._garbled[word.strut] += 1
            _log.debug("strut %s: %r: %s", name, word.text, error)
            return
        strut = self._struts[word.strut]
        strut.take(report, word.heard_s)
        if strut.battery_v is not None and strut.battery_v < self._table.least_battery_v:
            raise DeviceFault(
                "battery", f"strut {name}: its battery is down to {strut.battery_v:.2f} V; charge or change it"
            )

    def _has_watchdog(self, number: int) -> bool:
        return self._struts[number].has_watchdog

    def _check_stops(self, now_s: float) -> None:
        for name, since_s in zip(self._names, self._stop_s, strict=True):
            if since_s is not None and now_s - since_s > _ANSWER_S:
                raise DeviceTimeout(
                    f"strut {name} has not acknowledged a stop for {now_s - since_s:.1f} s; switch it off"
                )
