"""The firmware's shell on a stand-in for the ESP32: what it does with the radio's events, printed."""

import time

import bluetooth
import machine
from firmware import radio, settings
from firmware.core import Strut

RADIO, OUTPUT = bluetooth.RADIO, machine.OUTPUT


def write(text):
    RADIO["value"] = text
    RADIO["on_event"](3, (64, 7))


def run(strut, shell, duration_ms):
    """Turn the motor as the output says, and let the strut run."""
    for _ in range(duration_ms // 5):
        for _ in range(OUTPUT["duty"] // 10000):
            machine.IRQ[-1](None)
        said = strut.tick(time.ticks_ms(), time.ticks_us())
        if said:
            shell.report(said)
        time.sleep_ms(5)


def main():
    settings.BATTERY = radio.BATTERY = 35
    board = radio.EspBoard()
    options = {"no_load_mhz": 20000, "ramp_mhz_s": 200000, "pulses_per_turn": 70, "report_ms": 40}
    strut = Strut(board, options, 77, time.ticks_ms())
    shell = radio.Radio(strut)
    print("advertises", b"VVVALTR1" in RADIO["advertised"][-1], RADIO["config"]["mtu"])  # noqa: T201
    RADIO["on_event"](1, (64, 0, b""))
    write(b"-600,300,1")
    run(strut, shell, 200)
    print("turns", OUTPUT["duty"] > 0, OUTPUT["is_back"], strut.meter.mhz < 0)  # noqa: T201
    print("reports", len(RADIO["sent"]) >= 3, RADIO["sent"][-1][:2])  # noqa: T201
    print(RADIO["sent"][-1][2].split(b",")[2:9], RADIO["sent"][-1][2].split(b",")[15])  # noqa: T201
    RADIO["is_busy"] = True
    run(strut, shell, 250)
    print("expired", OUTPUT["duty"], strut.is_expired)  # noqa: T201
    RADIO["is_busy"] = False
    write(b"600")
    run(strut, shell, 100)
    print("on", OUTPUT["duty"] > 0)  # noqa: T201
    RADIO["on_event"](2, (64, 0, b""))
    print("off", OUTPUT["duty"])  # noqa: T201
    time.sleep_ms(5)
    print("advertises again", len(RADIO["advertised"]))  # noqa: T201
    machine.HAS_SENSOR[0] = False
    print("no sensor", radio.EspBoard().motion())  # noqa: T201


main()
