"""The experiments as data: source, target, number of trials, and what the thesis found.

"Transfer Learning for Faster Discovery of Tensegrity Robot Gaits", Union College, 2018, chapter 7. Its engine's gravity
of -0.1 and -0.5 is 1.96 and 9.81 m/s2 here: the ratio of five is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

from vvvaltr.controller.core.spelling import unknown
from vvvaltr.twin.world import Hills, World


@dataclass(frozen=True, slots=True)
class Condition:
    """A body in a world, with its damage.

    Args:
        name: short name without spaces, part of file names.
        title: description in words.
        body: name of the twin's body.
        world: gravity, friction and ground.
        damage: what is broken, in the words of ``twin.body.apply_damage``.
    """

    name: str
    title: str
    body: str
    world: World
    damage: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Published:
    """What the thesis reports about Efficient-BO against Plain-BO.

    Args:
        gain_percent: gain in best observed speed.
        trials: trials until Efficient-BO converged.
        plain_trials: trials until Plain-BO converged.
        p: p of the gain, as printed.
    """

    gain_percent: float
    trials: int
    plain_trials: int
    p: str


@dataclass(frozen=True, slots=True)
class Pair:
    """One experiment: learn on the source, then on the target.

    Args:
        key: name on the command line.
        title: description in words.
        source: condition of the run to learn from.
        target: condition of the runs that are compared.
        trials: number of trials of each run.
        why: purpose of the experiment, in a sentence.
        inverted: whether the source's scores are turned upside down, which makes it the most misleading source.
        published: the thesis' figures, where the experiment is one of its three.
        shuffled: whether the source's scores are dealt out anew, the best one to the strongest gait and so on, so that
            all it says is that strong gaits are fast.
    """

    key: str
    title: str
    source: Condition
    target: Condition
    trials: int
    why: str
    inverted: bool = False
    published: Published | None = None
    shuffled: bool = False


BODIES = {"planar": ("prism3", "icosahedron6"), "spatial": ("icosahedron6", "prism3")}
"""The body of each twin, and the other body, which is the unrelated source."""

HILLS = {"planar": Hills(0.004, 0.2), "spatial": Hills(0.02, 0.3)}
"""Hills for each twin that disturb its robot and do not stop it."""

DAMAGE = {"planar": ("lighten:3:0.5", "snap:4,8"), "spatial": ("lighten:3:0.5", "snap:4,18")}
"""One lighter strut and two snapped springs."""

GROUPS = {
    "1": ("1", "1b"),
    "2": ("2", "2-friction"),
    "3": ("3",),
    "thesis": ("1", "1b", "2", "2-friction", "3"),
    "controls": ("unrelated", "inverted", "shuffled"),
    "all": ("1", "1b", "2", "2-friction", "3", "unrelated", "inverted", "shuffled"),
}
"""Names of groups of experiments, each with its experiments' keys."""


def list_pairs(robot: str) -> tuple[Pair, ...]:
    """Return all experiments on a twin, ``planar`` or ``spatial``."""
    body, other_body = BODIES[robot]
    moon = Condition("low-gravity", "a fifth of gravity, friction 0.5", body, World(1.96, 0.5))
    lighter = Condition("less-gravity", "two thirds of gravity, friction 0.5", body, World(6.54, 0.5))
    plain = Condition("plain", "plain ground, friction 0.5", body, World(9.81, 0.5))
    other = Condition("other-body", f"another body ({other_body}), friction 0.5", other_body, World(9.81, 0.5))
    rough = Condition("rough", "full gravity, friction 0.75", body, World(9.81, 0.75))
    hilly = Condition("hills", "hills, friction 0.75", body, World(9.81, 0.75, HILLS[robot]))
    damaged = Condition("damaged", "one lighter strut, two snapped springs", body, World(9.81, 0.5), DAMAGE[robot])
    return (
        Pair("1", "gravity times five, more friction", moon, rough, 40, "The thesis' first experiment.",
             published=Published(11.3, 17, 34, "< 0.05")),
        Pair("1b", "gravity times one and a half, more friction", lighter, rough, 40,
             "Experiment 1 with similar conditions: source and target share their good gaits."),
        Pair("2", "plain ground to hills, more friction", plain, hilly, 50, "The thesis' second experiment.",
             published=Published(12.1, 30, 43, "< 0.01")),
        Pair("2-friction", "more friction, no hills", plain, rough, 50,
             "The control of experiment 2: the effect of friction alone."),
        Pair("3", "intact to damaged", plain, damaged, 40, "The thesis' third experiment.",
             published=Published(4.31, 31, 35, "> 0.05")),
        Pair("unrelated", "a source of another body", other, rough, 40,
             "A control: the source has next to nothing to teach, and it should do no harm."),
        Pair("inverted", "a source turned upside down", lighter, rough, 40,
             "A control: the source of 1b with its best gaits as the worst, which should do no harm.", inverted=True),
        Pair("shuffled", "a source that only says that strong gaits are fast", lighter, rough, 40,
             "A control: the source of 1b with its scores dealt out by the strength of the gaits. What it gains is "
             "known without a source.", shuffled=True),
    )  # fmt: skip


def find_pairs(robot: str, asked: str) -> tuple[Pair, ...]:
    """Return the experiments of the group called ``asked``, or the one experiment with this key.

    Raises:
        ValueError: no group or experiment has this name.
    """
    known = {pair.key: pair for pair in list_pairs(robot)}
    keys = GROUPS.get(asked) or ((asked,) if asked in known else ())
    if not keys:
        raise ValueError(unknown("experiment", asked, dict.fromkeys((*GROUPS, *known))))
    return tuple(known[key] for key in keys)
