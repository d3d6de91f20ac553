"""Mutated packets into every decoder of poses, in short; `python -m benchmarks.fuzz_poses` feeds a million to each."""

from contextlib import closing

import pytest

from benchmarks.fuzz_poses import fuzzed, natnet_decoder, qtm_decoder, stream_decoder

MAKERS = {
    "stream": stream_decoder,
    "qtm": qtm_decoder,
    **{f"natnet {major}.{minor}": lambda version=(major, minor): natnet_decoder(version)
       for major, minor in ((3, 0), (4, 0), (4, 1), (4, 2))},
}  # fmt: skip


@pytest.mark.parametrize("name", MAKERS)
def test_no_pose_is_made_up_of_mutated_packets(name):
    with closing(MAKERS[name]()) as decoder:
        found = fuzzed(decoder, count=4000, seed=7)
    assert found["understood"] > 100  # or nothing has been tested
