"""What the board runs at start; see README.md. Hold pin 0 to ground at start to stay out of it."""

from machine import Pin

if Pin(0, Pin.IN, Pin.PULL_UP).value():
    from firmware.radio import run

    run()
