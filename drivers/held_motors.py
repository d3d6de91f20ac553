"""Set-points kept alive: one I/O thread per line, and the motor driver that all devices share.

What holds for every device is here, once: a set-point is repeated until its ``hold_s`` has expired and no longer; after
that, and after any fault, the motors are told to stop again and again; a silent device, a lost line and a fault are
remembered until the line is opened again.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.following import Follower, SlewLimit
from vvvaltr.drivers.motor_line import MotorLine, Patience, Unhurried

_log = logging.getLogger(__name__)

_REOPEN_PERIOD_S, _LOOK_S = 0.2, 0.002
_LATE_S = 0.2  # between two set-points: less than any device's watchdog
# A motor with a sensor has time to start. Once it rotates it may lag no longer than a device takes to report the fault
# that may be the cause; when the motor is being stopped, there is no time left to wait for that report.
_LAG_AT_STOP_S = 0.05
_PRIORITY = 10


class HeldMotors:
    """A motor driver over a line: satisfies ``MotorDriver``.

    Two threads send: the runner's (``drive``, ``stop``) and the I/O thread, which repeats. The lock ``_sending`` guards
    the set-point, its expiry and ramp, what each motor should do, and every call of the line's ``send``, ``repeat`` and
    ``rest``, so that no repeat of an old set-point follows a stop. It is never held while waiting for the device.
    ``_problem`` is a single reference, written by the I/O thread and read by both.

    Args:
        open_line: opens the line, finds the device on it, arms its watchdog and clears old faults; DeviceError if not.
        ramp_hz_s: (motors,) the fastest change of each frequency; 0 for no limit. Empty for no limit on any.

    Raises:
        DeviceError: the line could not be opened.
    """

    def __init__(self, open_line: Callable[[], MotorLine], ramp_hz_s: Sequence[float] = ()) -> None:
        self._open_line = open_line
        self._slew = SlewLimit(ramp_hz_s)
        self._sending = threading.Lock()
        self._gait: Gait | None = None
        self._until_s = self._told_s = self._stopped_s = 0.0
        self._problem: DeviceError | None = None
        self._open()

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self._line.motor_count

    @property
    def quantities(self) -> frozenset[Quantity]:
        """What of a gait the device can apply."""
        return self._line.quantities

    @property
    def settle_s(self) -> float:
        """How long a motor takes until its measured frequency is that of the set-point."""
        return self._patience.settle_s

    def ramp_s(self, gait: Gait) -> float:
        """Return how long the set-points take from rest to ``gait``."""
        return self._slew.duration_s(gait)

    def check(self, gait: Gait) -> None:
        """Raise ValueError if the device cannot apply the frequencies of ``gait``. Sends nothing."""
        self._line.check(gait)

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Send ``gait`` now and repeat it for ``hold_s``, then stop. Raises as ``MotorLine`` and ``state`` do."""
        self.check(gait)
        with self._sending:
            self._raise_problem()
            now_s = time.monotonic()
            self._gait, self._until_s, self._told_s = gait, now_s + hold_s, now_s
            step = self._slew.towards(gait, now_s)
            self._follow(step, now_s)
            self._line.send(step)

    def state(self) -> MotorState:
        """Return what the device applies. Raises DeviceError for a fault, a lost line, or a silent device."""
        self._raise_problem()
        self._check_heard(time.monotonic())
        return self._line.state()

    def stop(self) -> None:
        """Stop all motors now, and wait for the device's next message. Idempotent.

        Raises:
            DeviceError: the device cannot be told, has had a fault meanwhile, or is silent.
        """
        self.send_stop()
        self.await_message()

    def send_stop(self) -> None:
        """Do the first half of ``stop``: send it, unless the line has been closed. Raises LinkLost."""
        with self._sending:
            self._gait = None
            if isinstance(self._problem, LinkLost):
                raise self._problem
            if not self._closing.is_set():
                try:
                    self._problem = self._problem or self._stall(_LAG_AT_STOP_S)
                finally:
                    self._rest()
                    self._stopped_s = time.monotonic()

    def await_message(self) -> None:
        """Do the second half of ``stop``: what went wrong since the runner last looked must not be missed."""
        while not self._closing.is_set() and self._line.heard_s <= self._stopped_s:
            self._raise_problem()
            self._check_heard(time.monotonic())
            time.sleep(_LOOK_S)
        if not self._closing.is_set():
            self._raise_problem()

    def ready(self, patience_s: float = 0.0) -> None:
        """Make the motors ready for a trial: after any fault, open the line again. For use between trials only.

        Args:
            patience_s: how long to go on trying, for a device that is still starting.

        Raises:
            DeviceError: the line could not be opened.
        """
        deadline_s = time.monotonic() + patience_s
        while self._problem is not None:
            _log.info("%s: opening the line again after: %s", self._line.name, self._problem)
            self._shut()
            try:
                self._open()
            except DeviceError as error:
                if time.monotonic() > deadline_s:
                    raise
                _log.info("the line does not open yet, trying again: %s", error)
                time.sleep(_REOPEN_PERIOD_S)

    def park(self) -> None:
        """Stop the motors and release the line, until ``ready`` opens it again."""
        self._shut()
        self._problem = LinkLost(f"{self._line.name}: let go during a pause")

    def close(self) -> None:
        """Stop the motors, then release the line. Idempotent."""
        self._shut()

    def _open(self) -> None:
        self._line = self._open_line()
        self._patience = self._line.patience if isinstance(self._line, Unhurried) else Patience()
        self._gait = None
        self._problem = None
        self._followers = [Follower(number) for number in range(1, self._line.motor_count + 1)]
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"motors on {self._line.name}", daemon=True)
        self._thread.start()

    def _shut(self) -> None:
        """Stop the motors and close the line; where the line is lost, the device's watchdog stops the motors."""
        try:
            with suppress(LinkLost):
                self.send_stop()
        finally:  # an interrupt, too, leaves neither the thread nor the line behind
            self._closing.set()
            self._thread.join()
            self._line.close()

    def _run(self) -> None:
        with suppress(OSError):  # where the system allows it, nothing else in the process delays this thread
            os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(_PRIORITY))
        try:
            self._keep_alive()
        except BaseException as error:  # a defect: the motors rest, and the runner is told before the thread ends
            self._give_up(DeviceFault("defect", f"{self._line.name}: {type(error).__name__}: {error}"))
            raise

    def _keep_alive(self) -> None:
        deadline_s = time.monotonic()
        while not self._closing.is_set():
            deadline_s = max(deadline_s + self._line.period_s, time.monotonic())
            try:
                self._tell()
                # The device is judged by what had come before the line was read: this thread may be held up itself.
                listening_s = time.monotonic()
                self._line.listen(deadline_s)
                self._check_heard(listening_s)
                self._check_stalls()
            except LinkLost as error:
                self._lose(error)
                return
            except DeviceError as error:
                self._give_up(error)
                time.sleep(max(0.0, deadline_s - time.monotonic()))  # what fails at once will do so again

    def _tell(self) -> None:
        """Repeat the set-point while it holds, else rest."""
        with self._sending:
            now_s = time.monotonic()
            late_s, self._told_s = now_s - self._told_s, now_s
            if self._gait is None or now_s >= self._until_s:
                self._rest()
            elif late_s > _LATE_S:
                raise DeviceTimeout(
                    f"{self._line.name}: set-points were {late_s:.2f} s apart: this computer is too busy; "
                    "end other programs"
                )
            else:
                step = self._slew.towards(self._gait, now_s)
                self._follow(step, now_s)
                self._line.repeat(step)

    def _rest(self) -> None:
        self._gait = None
        self._slew.restart()
        self._follow(Gait((0.0,) * self.motor_count), time.monotonic())
        self._line.rest()

    def _follow(self, step: Gait, now_s: float) -> None:
        for follower, frequency_hz in zip(self._followers, step.frequency_hz, strict=True):
            follower.want(frequency_hz, now_s)

    def _check_stalls(self) -> None:
        with self._sending:  # else the runner might change the set-points in the middle of the comparison
            if (stall := self._stall(self._patience.lag_s)) is not None:
                raise stall

    def _stall(self, patience_s: float) -> DeviceFault | None:
        """Return the fault of a motor that has lagged its set-point for ``patience_s``; None if all follow."""
        state = self._line.state()
        for follower, frequency_hz in zip(self._followers, state.frequency_hz, strict=True):
            if state.measured and follower.has_stalled(frequency_hz, state.t_s, self._patience.start_s, patience_s):
                return DeviceFault(
                    "stall",
                    f"{self._line.name}: motor {follower.number} of the line turns at {frequency_hz:.2g} Hz "
                    f"instead of {follower.wanted_hz:g} Hz; free it, or check its supply and wiring",
                )
        return None

    def _lose(self, problem: LinkLost) -> None:
        """Close a lost line at once: without a watchdog, closing it is what looks for the motor that runs on."""
        with self._sending:  # nobody sends from here on
            self._problem = problem
        self._line.close()

    def _give_up(self, problem: DeviceError) -> None:
        """Keep the first problem, and stop the motors until the line is opened again."""
        with self._sending, suppress(LinkLost):
            self._problem = self._problem or problem
            self._rest()

    def _check_heard(self, now_s: float) -> None:
        silence_s = now_s - self._line.heard_s
        if silence_s > self._patience.stale_s:
            raise DeviceTimeout(
                f"{self._line.name}: no message from the device for {silence_s:.2f} s; check its power and wiring"
            )

    def _raise_problem(self) -> None:
        if self._problem is not None:
            raise self._problem
