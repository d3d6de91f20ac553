"""A radio strut on an ESP32: Bluetooth, pins, inertial sensor, battery. README.md tells the wiring."""

import os
import struct
import time

import bluetooth
from machine import ADC, I2C, PWM, WDT, Pin
from micropython import const, schedule

from .core import REPORT_MS, UNKNOWN_MV, Strut
from .settings import (
    BATTERY,
    BATTERY_SHARE,
    CHARACTERISTIC,
    DIRECTION,
    ENABLE,
    I2C_PINS,
    NAME,
    NO_LOAD_MHZ,
    PULSE,
    PULSES_PER_TURN,
    RAMP_MHZ_S,
    SERVICE,
)

_CONNECT, _DISCONNECT, _WRITE = const(1), const(2), const(3)  # events of the radio
_ADVERTISE_US = 100000
_MTU = const(247)
_PWM_HZ = 20000
_HANG_MS = 500  # a firmware that hangs for longer is started afresh, motor off
_BATTERY_MS = 1000
_MPU6050 = const(0x68)
_LOOP_MS = 2


class EspBoard:
    """The board that README.md describes. Inertial sensor and battery may be left out."""

    def __init__(self):
        self._enable = PWM(Pin(ENABLE), freq=_PWM_HZ, duty_u16=0)
        self._direction = Pin(DIRECTION, Pin.OUT, value=0)
        self._count = 0
        self._edge_us = 0
        self._pulse = Pin(PULSE, Pin.IN, Pin.PULL_UP)
        self._pulse.irq(self._on_pulse, Pin.IRQ_RISING)
        self._battery = ADC(Pin(BATTERY), atten=ADC.ATTN_11DB) if BATTERY is not None else None
        self._battery_mv = UNKNOWN_MV
        self._battery_ms = time.ticks_add(time.ticks_ms(), -_BATTERY_MS)
        self._i2c = None
        try:
            i2c = I2C(0, sda=Pin(I2C_PINS[0]), scl=Pin(I2C_PINS[1]), freq=400000)
            i2c.writeto_mem(_MPU6050, 0x6B, b"\x00")  # awake; 2 g and 250 degrees/s are its own choice
            self._i2c = i2c
        except OSError:
            pass  # without the sensor its numbers are 0, and the motor turns all the same

    def pulses(self):
        """Return how many pulses were counted, and the time of the last one."""
        while True:  # count and time of one and the same pulse
            count, edge_us = self._count, self._edge_us
            if count == self._count:
                return count, edge_us

    def set_output(self, output):
        """Set the motor's voltage; 0 brakes."""
        self._direction.value(output < 0)
        self._enable.duty_u16(abs(output) * 65535 // 1000)

    def motion(self):
        """Return acceleration and rotation."""
        if self._i2c is None:
            return 0, 0, 0, 0, 0, 0
        try:
            numbers = struct.unpack(">7h", self._i2c.readfrom_mem(_MPU6050, 0x3B, 14))
        except OSError:
            return 0, 0, 0, 0, 0, 0
        return numbers[:3] + numbers[4:]  # a temperature is between them

    def battery_mv(self):
        """Return the battery's voltage, measured once a second."""
        if self._battery is None:
            return UNKNOWN_MV
        now_ms = time.ticks_ms()
        if time.ticks_diff(now_ms, self._battery_ms) >= _BATTERY_MS:
            self._battery_ms = now_ms
            self._battery_mv = int(self._battery.read_uv() // 1000 / BATTERY_SHARE)
        return self._battery_mv

    def _on_pulse(self, _):
        self._count += 1
        self._edge_us = time.ticks_us()


class Radio:
    """One service with one characteristic; one host at a time."""

    def __init__(self, strut):
        self._strut = strut
        self._host = None
        self._ble = bluetooth.BLE()
        self._ble.active(True)
        self._ble.config(gap_name=NAME, mtu=_MTU)
        self._ble.irq(self._on_event)
        flags = bluetooth.FLAG_READ | bluetooth.FLAG_WRITE | bluetooth.FLAG_WRITE_NO_RESPONSE | bluetooth.FLAG_NOTIFY
        service = (bluetooth.UUID(SERVICE), ((bluetooth.UUID(CHARACTERISTIC), flags),))
        ((self._value,),) = self._ble.gatts_register_services((service,))
        self._ble.gatts_set_buffer(self._value, _MTU)
        self._advertise()

    def report(self, text):
        """Send a report, if a host is there."""
        if self._host is None:
            return
        try:  # noqa: SIM105 - MicroPython has no contextlib
            self._ble.gatts_notify(self._host, self._value, text)
        except OSError:
            pass  # the link is being lost, or busy: the next report follows soon

    def _on_event(self, event, data):
        if event == _CONNECT:
            self._host = data[0]
            self._strut.on_connect()
        elif event == _DISCONNECT:
            self._strut.on_disconnect()  # at once, within the event
            self._host = None
            schedule(self._advertise, None)
        elif event == _WRITE and data[1] == self._value:
            self._strut.on_text(self._ble.gatts_read(self._value), time.ticks_ms())

    def _advertise(self, _=None):
        name = NAME.encode()
        self._ble.gap_advertise(_ADVERTISE_US, b"\x02\x01\x06" + bytes([len(name) + 1, 0x09]) + name)


def run():
    """Be a strut, for ever."""
    board = EspBoard()
    settings = {
        "no_load_mhz": NO_LOAD_MHZ,
        "ramp_mhz_s": RAMP_MHZ_S,
        "pulses_per_turn": PULSES_PER_TURN,
        "report_ms": REPORT_MS,
    }
    strut = Strut(board, settings, int.from_bytes(os.urandom(2), "little"), time.ticks_ms())
    radio = Radio(strut)
    watchdog = WDT(timeout=_HANG_MS)
    while True:
        report = strut.tick(time.ticks_ms(), time.ticks_us())
        if report:
            radio.report(report)
        watchdog.feed()
        time.sleep_ms(_LOOP_MS)
