"""The Pico's hardware as the firmware's README.md wires it, for MicroPython on a computer.

The motors turn the encoders; the UART is standard input and output.
"""

import select
import struct
import sys
import time

from firmware.simulated_board import SimulatedMotor

_MOTORS = [SimulatedMotor(20.0) for _ in range(3)]
_ENABLE = {6: _MOTORS[0], 8: _MOTORS[1], 10: _MOTORS[2]}
_PHASE = {7: _MOTORS[0], 9: _MOTORS[1], 11: _MOTORS[2]}
_ENCODER_A = {16: _MOTORS[0], 18: _MOTORS[1], 20: _MOTORS[2]}
_ENCODER_B = {17: _MOTORS[0], 19: _MOTORS[1], 21: _MOTORS[2]}
_listeners = []
_levels = {}


class Pin:
    """A pin: bridges and encoders know what it is wired to."""

    IN, OUT, PULL_UP, IRQ_RISING = 0, 1, 2, 4

    def __init__(self, number, direction=OUT, pull=None, value=0):
        self.number = number
        _levels[number] = value

    def value(self, level=None):
        if level is not None:
            _levels[self.number] = level
        if self.number in _ENCODER_B:
            return _ENCODER_B[self.number].frequency_hz >= 0
        return _levels[self.number]

    def irq(self, on_edge, trigger, hard):
        _listeners.append((_ENCODER_A[self.number], [0], on_edge))


class PWM:
    """The ENABLE input of a bridge."""

    def __init__(self, pin, freq, duty_u16):
        self._motor = _ENABLE[pin.number]
        self._phase = pin.number + 1

    def duty_u16(self, duty):
        output = duty * 1000 // 65535 if _levels.get(12) else 0  # the bridges sleep until GP12 wakes them
        self._motor.output = -output if _levels[self._phase] else output


class ADC:
    """A thermistor at 25 degrees, or the chip's own sensor at 27."""

    def __init__(self, number):
        self._raw = 14021 if number == 4 else 32768

    def read_u16(self):
        return self._raw


class I2C:
    """The current monitor and the accelerometer, lying flat."""

    def __init__(self, number, sda, scl, freq, timeout):
        pass

    def scan(self):
        return [0x40, 0x68]

    def writeto_mem(self, device, register, data):
        pass

    def readfrom_mem(self, device, register, size):
        if device == 0x68:
            return struct.pack(">hhh", 0, 0, 2048)
        return struct.pack(">h", _MOTORS[register // 2].current_ma() * 100 // 40 << 3)


class UART:
    """Standard input and output; looking at it lets the motors turn."""

    def __init__(self, number, baud, tx, rx, rxbuf, txbuf):
        self._poll = select.poll()
        self._poll.register(sys.stdin.buffer, select.POLLIN)
        self._now_us = time.ticks_us()

    def any(self):
        now_us = time.ticks_us()
        for motor, known, on_edge in _listeners:
            motor.step(now_us, now_us - self._now_us)
            while known[0] != motor.count:
                known[0] += 1 if motor.count > known[0] else -1
                on_edge(None)
        self._now_us = now_us
        return bool(self._poll.poll(1))

    def read(self):
        return sys.stdin.buffer.read(1)

    def write(self, data):
        sys.stdout.buffer.write(data)


class WDT:
    """A watchdog that never bites."""

    def __init__(self, timeout):
        pass

    def feed(self):
        pass


def disable_irq():
    """Do nothing: interrupts come from ``UART.any`` alone."""


def enable_irq(state):
    """Do nothing."""
