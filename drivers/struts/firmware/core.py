"""A radio strut without its hardware: texts and time in, texts and motor output out.

Runs under MicroPython and CPython. README.md tells what is said on the air, board.py what a board has to offer.
"""

from .control import TICKS, SpeedLoop, SpeedMeter

TYPE_CHECKING = False  # MicroPython has no typing; type checkers know the name
if TYPE_CHECKING:
    from .board import Board

REPORT_MS = 40
MAX_RPM = 1001  # as the laboratory's boards
PLAIN_HOLD_MS = 30000  # of a target without a hold: longer than a trial of the laboratory's scripts
LONGEST_HOLD_MS = 60000
UNKNOWN_MV = -1

_CONTROL_MS = 10
_MARK = "v1"
_AT_REST_MHZ = 1000  # a motor is not reversed while it turns faster
_DIGITS = b"0123456789"


class Strut:
    """A strut with one motor, whose speed comes from a single channel of pulses: the sense is that of the output.

    Args:
        board: the hardware.
        settings: ``no_load_mhz``, ``ramp_mhz_s``, ``pulses_per_turn`` and ``report_ms``.
        boot_id: 16 bits that differ from boot to boot.
        now_ms: the present.
    """

    def __init__(self, board: "Board", settings: dict[str, int], boot_id: int, now_ms: int) -> None:
        self.loop = SpeedLoop(settings["no_load_mhz"], settings["ramp_mhz_s"])
        self.meter = SpeedMeter(settings["pulses_per_turn"])
        self.target_rpm = 0
        self.is_expired = False  # a command has expired, and none came since
        self.is_stalled = False  # the motor did not turn, and no stop came since
        self.is_linked = False
        self._board = board
        self._report_ms = settings["report_ms"]
        self._boot_id = boot_id & 0xFFFF
        self._command = 0
        self._has_numbers = False
        self._expiries = self._stalls = self._reports = 0
        self._hold_ms = 0
        self._heard_ms = self._controlled_ms = self._reported_ms = now_ms
        self._sense = 1
        self._pulses = self._count = 0
        self._release()

    def on_connect(self) -> None:
        """Begin anew with a host: its numbers count from anywhere."""
        self._release()
        self.is_linked = True
        self.is_stalled = False
        self._has_numbers = False
        self._command = 0

    def on_disconnect(self) -> None:
        """Stop: nobody could stop the motor any more."""
        self._release()
        self.is_linked = False

    def on_text(self, text: bytes, now_ms: int) -> None:
        """Take a target, ``rpm`` or ``rpm,hold_ms,number``. What is neither stops the motor."""
        fields = bytes(text).strip(b" \t\r\n\0").split(b",")
        rpm = _number(fields[0])
        if len(fields) == 1:
            if not rpm:  # a host that begins anew, on a link that an earlier one has left
                self._has_numbers = False
                self._command = 0
            return self._aim(rpm or 0, PLAIN_HOLD_MS, now_ms)
        hold_ms = _number(fields[1])
        number = _number(fields[2]) if len(fields) == 3 else None
        if rpm is None or hold_ms is None or number is None or hold_ms < 1 or not 0 <= number <= 0xFFFF:
            return self._aim(0, 0, now_ms)
        is_late = self._has_numbers and (number - self._command) & 0xFFFF > 0x7FFF
        if not is_late:
            self._has_numbers = True
            self._command = number
        if rpm == 0 or not is_late:  # a stop is never too old
            self._aim(rpm, min(hold_ms, LONGEST_HOLD_MS), now_ms)
        return None

    def tick(self, now_ms: int, now_us: int) -> bytes:
        """Do what is due, at least every few milliseconds; return the report that is due, or nothing."""
        if self.target_rpm and (now_ms - self._heard_ms) & TICKS >= self._hold_ms:
            self._release()
            self.is_expired = True
            self._expiries = (self._expiries + 1) & 0xFFFF
        elapsed_ms = (now_ms - self._controlled_ms) & TICKS
        if elapsed_ms >= _CONTROL_MS:
            self._controlled_ms = now_ms
            self._control(min(elapsed_ms, 5 * _CONTROL_MS), now_us)
        if (now_ms - self._reported_ms) & TICKS < self._report_ms:
            return b""
        # From deadline to deadline, so that the rate is kept; but after a pause not one for each that was missed.
        self._reported_ms = (self._reported_ms + self._report_ms) & TICKS
        if (now_ms - self._reported_ms) & TICKS >= self._report_ms:
            self._reported_ms = now_ms
        return self._report(now_ms)

    def _aim(self, rpm: int, hold_ms: int, now_ms: int) -> None:
        if rpm == 0:
            self._release()
            self.is_stalled = False
        elif not self.is_stalled:
            self.target_rpm = max(-MAX_RPM, min(MAX_RPM, rpm))
            self._hold_ms = hold_ms
            self._heard_ms = now_ms
            self.is_expired = False

    def _control(self, elapsed_ms: int, now_us: int) -> None:
        pulses, edge_us = self._board.pulses()
        self._count += self._sense * (pulses - self._pulses)
        self._pulses = pulses
        self.meter.update(self._count, edge_us, now_us)
        self.loop.target_mhz = self._allowed_mhz()
        output = self.loop.regulate(self.meter.mhz, self.meter.is_news, elapsed_ms)
        if output * self._sense < 0:
            output = 0  # by this output the pulses would be counted in the wrong sense
        self._board.set_output(output)
        if self.loop.is_stalled(self.meter.edge_mhz, elapsed_ms):
            self._release()
            self.is_stalled = True
            self._stalls = (self._stalls + 1) & 0xFFFF

    def _allowed_mhz(self) -> int:
        """Return the target; 0 until a motor that is to be reversed has run down."""
        target_mhz = self.target_rpm * 1000 // 60
        if target_mhz * self._sense < 0:
            if abs(self.meter.mhz) > _AT_REST_MHZ:
                return 0
            self._sense = -self._sense
            self.loop.release()
        return target_mhz

    def _release(self) -> None:
        self.target_rpm = 0
        self.is_expired = False
        self.loop.release()
        self._board.set_output(0)

    def _report(self, now_ms: int) -> bytes:
        self._reports = (self._reports + 1) & 0xFFFF
        motion = self._board.motion()
        battery_mv = self._board.battery_mv()
        fields: list[object] = [f"{self.target_rpm}.00", _rpm(self.meter.mhz)]
        fields.extend(motion)
        fields += [_MARK, self._reports, now_ms & TICKS, self._boot_id, self._command, self._expiries, self._stalls]
        fields.append("" if battery_mv == UNKNOWN_MV else battery_mv)
        text = ",".join([str(field) for field in fields]).encode()
        return text + f",{sum(text) % 256:02x}".encode()


def _rpm(mhz: int) -> str:
    """Return a speed in turns a minute with two decimals."""
    hundredths = abs(mhz) * 6
    return f"{'-' if mhz < 0 else ''}{hundredths // 100}.{hundredths % 100:02d}"


def _number(field: bytes) -> "int | None":
    """Return a whole number of few digits; None for anything else."""
    field = field.strip(b" ")
    digits = field[1:] if field[:1] in (b"-", b"+") else field
    if not 0 < len(digits) <= 6 or any(digit not in _DIGITS for digit in digits):
        return None
    return int(field)
