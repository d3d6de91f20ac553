"""Lost radio links and killed programs, in short; `python -m benchmarks.struts` is the long campaign."""

import pytest

from benchmarks.struts import WAYS, lose_links


@pytest.mark.flaky(reruns=2)  # in real time
def test_no_strut_with_our_firmware_is_left_on() -> None:
    losses = list(lose_links(repeats=len(WAYS), seed=1))

    assert [loss.way for loss in losses] == list(WAYS)
    assert all(loss.rest_s is not None and loss.was_noticed for loss in losses)
