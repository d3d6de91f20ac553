import subprocess
import sys

import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.methods.registry import METHODS, make_optimizer

SPACE = GaitSpace.over(3, -20.0, 20.0)
SOURCE = Source("runs/flat", (Gait((1.0, 2.0, 3.0)), Gait((4.0, 5.0, 6.0))), (0.1, 0.2))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_asks_learns_and_recommends(name: str) -> None:
    method = METHODS[name]
    optimizer = make_optimizer(name, SPACE, 0, [SOURCE] if method.uses_sources else [])
    for score in (0.01, 0.02, 0.01):
        optimizer.tell(optimizer.ask().gait, score)
    recommended = optimizer.recommend()
    assert recommended.estimate.low < recommended.estimate.mean < recommended.estimate.high
    assert len(optimizer.predict([recommended.gait, SOURCE.gaits[0]])) == 2
    assert method.description and "\n" not in method.description


@pytest.mark.parametrize(
    ("name", "sources", "message"),
    [
        ("magic", [], "unknown method 'magic'; choose one of drive, plain"),
        ("efficient", [], "method 'efficient' learns from an earlier run: give it a source"),
        ("plain", [SOURCE], "method 'plain' takes no source: leave the source out, or choose one of efficient"),
        (
            "efficient",
            [Source("runs/two", (Gait((1.0, 2.0)),), (0.1,))],
            "source runs/two is of 2 motors, the robot has 3",
        ),
    ],
)
def test_a_choice_that_does_not_fit_is_refused_in_one_line(name: str, sources: list[Source], message: str) -> None:
    with pytest.raises(ValueError) as refused:
        make_optimizer(name, SPACE, 0, sources)
    assert str(refused.value).startswith(message)
    assert "\n" not in str(refused.value)


def test_the_methods_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        METHODS["mine"] = METHODS["plain"]  # type: ignore[index]


def test_a_suggestion_needs_no_scipy() -> None:
    program = (
        "import sys\n"
        "from vvvaltr.controller.core.gaits import GaitSpace\n"
        "from vvvaltr.transfer.methods.registry import make_optimizer\n"
        "optimizer = make_optimizer('plain', GaitSpace.over(3, 0.0, 20.0), 0)\n"
        "for _ in range(10):\n"
        "    optimizer.tell(optimizer.ask().gait, 0.1)\n"
        "optimizer.recommend()\n"
        "sys.exit('scipy' in sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
