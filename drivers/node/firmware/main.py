"""What the board runs at start; see README.md. Hold GP22 to ground at start to stay out of it."""

from machine import Pin

if Pin(22, Pin.IN, Pin.PULL_UP).value():
    from firmware.pico import run

    run()
