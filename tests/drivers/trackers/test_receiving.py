"""What a tracker's constructor hears of its thread, and what is left of a thread that fails."""

import pytest

from vvvaltr.controller.core.errors import LinkLost, TrackingLost, UserError
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.newest import NewestPose
from vvvaltr.drivers.trackers.receiving import Opening


@pytest.fixture
def newest() -> NewestPose:
    newest = NewestPose(60.0, "no frame yet")
    newest.take(1, 0.0, Pose(0.0, (0.0, 0.0, 0.0)), 0.0)
    return newest


def test_a_constructor_waits_for_the_servers_consent(newest: NewestPose) -> None:
    opening = Opening(newest)
    with pytest.raises(TimeoutError):
        opening.wait(0.01)
    opening.succeed()
    opening.succeed()
    opening.wait(0.01)


def test_a_refusal_is_the_constructors_and_later_only_the_reason_for_no_pose(newest: NewestPose) -> None:
    opening = Opening(newest)
    assert opening.fail(UserError("no such body"))
    with pytest.raises(UserError, match="no such body"):
        opening.wait()

    agreed = Opening(newest)
    agreed.succeed()
    assert not agreed.fail(LinkLost("silent for 2 s"))
    agreed.wait()
    with pytest.raises(TrackingLost, match="silent for 2 s"):
        newest.pose()


@pytest.mark.parametrize("has_agreed", [False, True])
def test_a_defect_in_the_thread_leaves_no_pose_and_nobody_who_waits(newest: NewestPose, has_agreed: bool) -> None:
    opening = Opening(newest)
    if has_agreed:
        opening.succeed()
    with pytest.raises(ZeroDivisionError), opening.told_of_defects():
        1 / 0  # noqa: B018
    with pytest.raises(TrackingLost, match=r"thread has ended: ZeroDivisionError.*please report this"):
        newest.pose()
    if not has_agreed:
        with pytest.raises(ZeroDivisionError):
            opening.wait(0.01)
