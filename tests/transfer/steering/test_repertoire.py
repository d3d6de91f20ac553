"""What is learned of movements: the robot's own, apart from the floor's drift, and how sure that is."""

import numpy as np
import pytest
from gliding import GAITS, TABLE, GlidingRobot, relative_drive, tried

from vvvaltr.controller.core.values import Outcome, Pose
from vvvaltr.transfer.steering import repertoire
from vvvaltr.transfer.steering.belief import Belief
from vvvaltr.transfer.steering.hypotheses import Knowledge
from vvvaltr.transfer.steering.passage import passage
from vvvaltr.transfer.steering.repertoire import Repertoire, learn_repertoire

TRUTH = np.array(list(TABLE.values()))


def test_a_movement_is_the_velocity_in_the_frame_that_the_robot_has_at_each_moment() -> None:
    repertoire = learn_repertoire([tried(GlidingRobot(), repeats=3)])

    assert repertoire.gaits == GAITS
    assert repertoire.velocities[:, :2] == pytest.approx(TRUTH[:, :2], abs=0.0012)
    assert repertoire.velocities[:, 2] == pytest.approx(TRUTH[:, 2], abs=0.02)
    assert [movement.trials for movement in repertoire.movements] == [3] * 5


def test_the_floors_drift_is_told_from_the_robots_own_walk() -> None:
    repertoire = learn_repertoire([tried(GlidingRobot(drift_m_s=(-0.006, 0.003)), repeats=4)])

    assert repertoire.drift_m_s == pytest.approx((-0.006, 0.003), abs=0.0015)
    assert repertoire.velocities[:, :2] == pytest.approx(TRUTH[:, :2], abs=0.003)


def test_each_run_has_a_floor_of_its_own() -> None:
    level, inclined = tried(GlidingRobot(), 3), tried(GlidingRobot(drift_m_s=(0.008, 0.0)), 3)

    repertoire = learn_repertoire([inclined, level])

    assert np.hypot(*repertoire.drift_m_s) < 0.0015
    assert repertoire.velocities[:, :2] == pytest.approx(TRUTH[:, :2], abs=0.002)


def test_in_parts_the_same_is_learned_as_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    base = learn_repertoire([tried(GlidingRobot(), 2)[:2]])
    runs = [tried(GlidingRobot(drift_m_s=drift), 2) for drift in ((0.008, 0.0), (0.0, -0.003))]
    at_once = learn_repertoire([runs[0][:6], runs[1]], base)
    monkeypatch.setattr(repertoire, "_MORE", 1)

    in_parts = learn_repertoire([runs[0][:6], runs[1]], base)

    assert in_parts.gaits == at_once.gaits
    assert in_parts.velocities == pytest.approx(at_once.velocities)
    for one, other in zip(in_parts.movements, at_once.movements, strict=True):
        assert one.covariance == pytest.approx(other.covariance)
    assert in_parts.drift_m_s == pytest.approx(at_once.drift_m_s)


def test_repeats_make_a_movement_surer() -> None:
    once, often = (learn_repertoire([tried(GlidingRobot(), repeats)]) for repeats in (1, 4))

    assert (often.movements[0].deviation[:2] < 0.5 * once.movements[0].deviation[:2]).all()


def test_what_measured_nothing_is_no_observation() -> None:
    from dataclasses import replace

    lost = [replace(trial, outcome=Outcome.TRACKING_LOST) for trial in tried(GlidingRobot())]

    assert learn_repertoire([lost]) == Repertoire()


def test_a_heading_that_jumps_by_a_full_turn_is_no_turning() -> None:
    poses = [Pose(0.1 * step, (0.0, 0.0, 0.0), 3.1 if step % 2 else 3.1 - 2 * np.pi) for step in range(30)]

    seen = passage(poses)

    assert seen is not None
    assert seen.turned_rad == pytest.approx(0.0, abs=1e-9)


def test_a_path_of_an_hour_is_seen_in_no_more_pieces_than_one_of_a_minute() -> None:
    seen = passage([Pose(float(t_s), (0.01 * t_s, 0.0, 0.0), 0.001 * t_s) for t_s in range(3601)])

    assert seen is not None
    assert len(seen.duration_s) == 60
    assert seen.total_s == pytest.approx(3598.0)
    assert seen.moved_m[:, 0].sum() == pytest.approx(35.98)


def test_a_path_that_is_too_short_or_no_number_says_nothing() -> None:
    short = [Pose(0.1 * step, (0.0, 0.0, 0.0)) for step in range(7)]
    spoilt = [Pose(0.1 * step, (float("nan"), 0.0, 0.0)) for step in range(50)]

    assert passage(short) is None
    assert passage(spoilt) is None


def test_two_repertoires_with_the_same_gait_are_surer_than_each() -> None:
    one = learn_repertoire([tried(GlidingRobot())])
    other = learn_repertoire([tried(GlidingRobot(drift_m_s=(0.001, 0.0)))])

    both = one.joined(other)

    assert both.gaits == GAITS
    assert (both.movements[2].deviation < one.movements[2].deviation).all()
    assert both.movements[2].trials == 2


def test_the_same_knowledge_counts_once() -> None:
    one = learn_repertoire([tried(GlidingRobot())])

    assert one.joined(one).movements[2].trials == 1


def drive(knowledge: Knowledge, robot: GlidingRobot, rounds: int) -> Belief:
    for trial in tried(robot, rounds):
        seen = passage(trial.poses)
        assert seen is not None
        knowledge.observe(GAITS.index(trial.gait), seen)
    return knowledge.likely


def test_on_the_same_floor_the_repertoire_is_taken_for_what_it_is() -> None:
    knowledge = Knowledge(learn_repertoire([tried(GlidingRobot(), 3)]))

    drive(knowledge, GlidingRobot(), 2)

    assert knowledge.likely_name == "alike"


def test_on_a_slope_the_drift_is_learned_and_the_movements_are_kept() -> None:
    knowledge = Knowledge(learn_repertoire([tried(GlidingRobot(), 3)]))

    belief = drive(knowledge, GlidingRobot(drift_m_s=(-0.01, 0.0)), 2)

    assert belief.drift_m_s == pytest.approx((-0.01, 0.0), abs=0.003)
    assert belief.movements[:, :2] == pytest.approx(TRUTH[:, :2], abs=0.004)


def test_another_body_is_learned_from_a_drive_or_two_of_each_movement() -> None:
    damaged = {gait: (-v[1], 0.6 * v[0], -0.8 * v[2]) for gait, v in TABLE.items()}
    knowledge = Knowledge(learn_repertoire([tried(GlidingRobot(), 3)]))

    belief = drive(knowledge, GlidingRobot(damaged), 2)

    assert belief.movements == pytest.approx(np.array(list(damaged.values())), abs=0.03)
    assert belief.movements[:, :2] == pytest.approx(np.array(list(damaged.values()))[:, :2], abs=0.004)


def test_one_bad_trial_does_no_harm() -> None:
    knowledge = Knowledge(learn_repertoire([tried(GlidingRobot(), 3)]))
    drive(knowledge, GlidingRobot(), 2)

    drive(knowledge, GlidingRobot({GAITS[0]: (0.0005, 0.0, 0.0)}), 1)

    assert knowledge.likely.movements[0, 0] > 0.6 * TABLE[GAITS[0]][0]


def test_the_floor_carries_a_weakly_driven_movement_less() -> None:
    belief = learn_repertoire([tried(GlidingRobot(drift_m_s=(-0.01, 0.0)), repeats=4)]).belief()

    drift_m_s = [belief.floor[movement, 2] for movement in range(len(GAITS))]

    assert drift_m_s == pytest.approx([-0.01 * relative_drive(gait) for gait in GAITS], abs=0.002)


def test_a_turn_that_depends_on_the_heading_is_learned_while_going() -> None:
    class Tilted(GlidingRobot):
        """A robot that its first movement turns the more, the more it heads along y."""

        def _glide(self, duration_s: float) -> None:
            super()._glide(duration_s)
            if self.is_running and self.gait == GAITS[0]:
                self.yaw_rad += 0.2 * np.sin(self.yaw_rad) * duration_s

        def place(self, trial: int) -> None:
            super().place(trial)
            self.yaw_rad = 0.5 * trial

    knowledge = Knowledge(learn_repertoire([tried(GlidingRobot(), 3)]))

    belief = drive(knowledge, Tilted(drift_m_s=(-0.01, 0.0)), 5)

    assert belief.floor[0, :2] == pytest.approx([0.0, 0.2], abs=0.06)
    assert belief.movements[0, 2] == pytest.approx(0.02, abs=0.06)
