"""An ESP32's hardware as the firmware's README.md wires it, for MicroPython on a computer."""

import struct

OUTPUT = {"duty": 0, "is_back": False}
IRQ = []
FED = [0]
HAS_SENSOR = [True]


class Pin:
    IN, OUT, PULL_UP, IRQ_RISING = 0, 1, 2, 4

    def __init__(self, number, direction=IN, pull=None, value=0):
        self.number = number

    def value(self, level=None):
        if level is not None and self.number == 26:
            OUTPUT["is_back"] = bool(level)
        return 1

    def irq(self, on_edge, trigger):
        IRQ.append(on_edge)


class PWM:
    def __init__(self, pin, freq, duty_u16):
        assert pin.number == 25

    def duty_u16(self, duty):
        OUTPUT["duty"] = duty


class ADC:
    ATTN_11DB = 3

    def __init__(self, pin, atten):
        pass

    def read_uv(self):
        return 1010000


class I2C:
    def __init__(self, bus, sda, scl, freq):
        if not HAS_SENSOR[0]:
            raise OSError(19)

    def writeto_mem(self, device, register, data):
        assert (device, register) == (0x68, 0x6B)

    def readfrom_mem(self, device, register, size):
        return struct.pack(">7h", 1, -2, 16384, 999, 3, -4, 5)


class WDT:
    def __init__(self, timeout):
        assert timeout == 500

    def feed(self):
        FED[0] += 1
