"""The motor node on a Raspberry Pi Pico: pins, sensors, UART. README.md tells the wiring."""

import math
import os
import struct
import time

from machine import ADC, I2C, PWM, UART, WDT, Pin, disable_irq, enable_irq

from .core import ACCELEROMETER, BOARD_TEMPERATURE, CURRENT, MOTOR_TEMPERATURE, UNKNOWN, Node

# What to change for other motors
MAX_MHZ = 16700
NO_LOAD_MHZ = 20000  # at the full supply, with nothing on the shaft
RAMP_MHZ_S = 100000
COUNTS_PER_TURN = 12  # rising edges of encoder channel A in one turn of the shaft

_MOTORS = (  # ENABLE and PHASE of the bridge, A and B of the encoder, thermistor
    (6, 7, 16, 17, 26),
    (8, 9, 18, 19, 27),
    (10, 11, 20, 21, 28),
)
_SLEEP = 12
_PWM_HZ = 20000
_BAUD = 460800
_HANG_MS = 500  # a firmware that hangs for longer is started afresh, motors off
_INA3221 = 0x40
_MPU6050 = 0x68


class _Encoder:
    """Counts the rising edges of one channel, up or down by the other."""

    def __init__(self, pin_a, pin_b):
        self._count = 0
        self._edge_us = 0
        self._b = Pin(pin_b, Pin.IN, Pin.PULL_UP)
        self._a = Pin(pin_a, Pin.IN, Pin.PULL_UP)
        self._a.irq(self._on_edge, Pin.IRQ_RISING, hard=True)

    def read(self):
        state = disable_irq()  # count and time of one and the same edge
        count, edge_us = self._count, self._edge_us
        enable_irq(state)
        return count, edge_us

    def _on_edge(self, _):
        self._count += 1 if self._b.value() else -1
        self._edge_us = time.ticks_us()


class PicoBoard:
    """The board that README.md describes. Its sensors may be left out."""

    def __init__(self):
        self._enable = [PWM(Pin(pins[0]), freq=_PWM_HZ, duty_u16=0) for pins in _MOTORS]
        self._phase = [Pin(pins[1], Pin.OUT, value=0) for pins in _MOTORS]
        self._encoders = [_Encoder(pins[2], pins[3]) for pins in _MOTORS]
        self._thermistors = [ADC(pins[4]) for pins in _MOTORS]
        self._core = ADC(4)
        self._i2c = I2C(0, sda=Pin(4), scl=Pin(5), freq=400000, timeout=1000)
        self._found = self._i2c.scan()
        if _MPU6050 in self._found:
            self._i2c.writeto_mem(_MPU6050, 0x6B, b"\x00")  # awake
            self._i2c.writeto_mem(_MPU6050, 0x1C, b"\x18")  # 16 g full scale
        Pin(_SLEEP, Pin.OUT, value=1)

    def sensors(self):
        """Return which sensors answer."""
        sensors = BOARD_TEMPERATURE
        if _INA3221 in self._found:
            sensors |= CURRENT
        if _MPU6050 in self._found:
            sensors |= ACCELEROMETER
        if all(self.temperature_dc(motor) != UNKNOWN for motor in range(len(_MOTORS))):
            sensors |= MOTOR_TEMPERATURE
        return sensors

    def encoder(self, motor):
        """Return the count and the time of the last edge."""
        return self._encoders[motor].read()

    def set_output(self, motor, output):
        """Set a motor's voltage; 0 brakes."""
        self._phase[motor].value(output < 0)
        self._enable[motor].duty_u16(abs(output) * 65535 // 1000)

    def current_ma(self, motor):
        """Return the current from the bridge's supply: 40 uV a step over 0.1 ohm, in the upper 13 bits."""
        data = self._read(_INA3221, 1 + 2 * motor, 2)
        return UNKNOWN if data is None else (struct.unpack(">h", data)[0] >> 3) * 40 // 100

    def temperature_dc(self, motor):
        """Return the temperature of a 10 kohm thermistor (B = 3950 K) below 10 kohm to the supply."""
        raw = self._thermistors[motor].read_u16()
        if not 1000 < raw < 64500:
            return UNKNOWN  # short-circuited, or not there
        ratio = raw / (65535 - raw)
        return int(10.0 / (1.0 / 298.15 + math.log(ratio) / 3950.0) - 2731.5)

    def board_temperature_dc(self):
        """Return the chip's temperature by the formula of its data sheet."""
        volts = self._core.read_u16() * 3.3 / 65535
        return int(270.0 - (volts - 0.706) / 0.0001721)

    def acceleration_mg(self):
        """Return the acceleration: 2048 steps a g."""
        data = self._read(_MPU6050, 0x3B, 6)
        if data is None:
            return UNKNOWN, UNKNOWN, UNKNOWN
        return tuple(value * 1000 // 2048 for value in struct.unpack(">hhh", data))

    def _read(self, device, register, size):
        """Return what a sensor says, or None."""
        if device not in self._found:
            return None
        try:
            return self._i2c.readfrom_mem(device, register, size)
        except OSError:
            return None


def run():
    """Be a motor node, for ever."""
    board = PicoBoard()
    settings = {
        "motors": len(_MOTORS),
        "max_mhz": MAX_MHZ,
        "no_load_mhz": NO_LOAD_MHZ,
        "ramp_mhz_s": RAMP_MHZ_S,
        "counts_per_turn": COUNTS_PER_TURN,
        "sensors": board.sensors(),
    }
    uart = UART(0, _BAUD, tx=Pin(0), rx=Pin(1), rxbuf=512, txbuf=512)
    node = Node(board, settings, int.from_bytes(os.urandom(4), "little"), time.ticks_ms())
    watchdog = WDT(timeout=_HANG_MS)
    while True:
        if uart.any():
            uart.write(node.on_bytes(uart.read(), time.ticks_ms()))
        telemetry = node.tick(time.ticks_ms(), time.ticks_us())
        if telemetry:
            uart.write(telemetry)
        watchdog.feed()
