"""What to change for each strut, and for other motors. Every strut has a name of its own."""

NAME = "VVVALTR1"
# As the laboratory's boards have them, each its own pair, if their scripts are to find this one.
SERVICE = "8d5a0001-6f2b-4b52-9b0e-6d9d5c1c7a10"
CHARACTERISTIC = "8d5a0002-6f2b-4b52-9b0e-6d9d5c1c7a10"

# The motor at the full supply with nothing on the shaft, and how fast its set-point may rise
NO_LOAD_MHZ = 20000
RAMP_MHZ_S = 30000
PULSES_PER_TURN = 70

# Pins
ENABLE = 25  # of the bridge; with 10 kohm to GND, so that the motor stays off until the firmware runs
DIRECTION = 26
PULSE = 27
I2C_PINS = (21, 22)  # SDA, SCL
BATTERY = None  # the pin of the battery's divider, as 35; None where it is not wired
BATTERY_SHARE = 0.273  # of the battery's voltage at that pin
