from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import Displacement, LoggedTrial, Movement
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Outcome, Suggestion, Trial
from vvvaltr.controller.view.run_findings import describe_start_drift


def started_at(number: int, x_m: float, yaw_rad: float) -> LoggedTrial:
    gait, start = Gait((1.0,)), RestingPose((x_m, 0.0, 0.0), yaw_rad, 0.0, 0.0)
    trial = Trial(number, gait, Outcome.COMPLETED, "", 0.0, 1.0)
    return LoggedTrial(Suggestion(gait, "x"), trial, 0.0, None, Movement(start, start, Displacement(0.0, 0.0, 0.0)))


def test_the_drift_of_start_poses_is_told_also_across_half_a_turn() -> None:
    trials = [started_at(number, 0.01 * number, 3.1 + 0.02 * number) for number in range(6)]

    told = describe_start_drift(trials)

    assert "by 40 mm (x +40, y +0) and +5 degrees" in told
    assert describe_start_drift(trials[:5]) == ""
