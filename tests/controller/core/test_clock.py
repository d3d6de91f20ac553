import time

from vvvaltr.controller.core.clock import WallClock


def test_lateness_does_not_add_up() -> None:
    clock = WallClock()
    clock.sleep(0.01)
    start_s = clock.now_s()

    for _ in range(10):
        time.sleep(0.004)  # work between two ticks
        clock.sleep(0.01)

    assert 0.095 <= clock.now_s() - start_s < 0.14


def test_a_long_pause_starts_a_new_rhythm_instead_of_a_burst() -> None:
    clock = WallClock()
    time.sleep(0.05)
    start_s = clock.now_s()

    clock.sleep(0.01)

    assert clock.now_s() - start_s >= 0.0099
