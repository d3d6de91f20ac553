"""What `import vvvaltr` offers, and that the names of others do not get into its way."""

import ast
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy
import pytest

import vvvaltr
from vvvaltr.drivers.mocking.process import MockProcess

FOREIGN = "Robot = 'of another project'\n"


def python(*arguments: str, cwd: Path, path: str = "") -> str:
    environment = {**os.environ, "PYTHONPATH": path}
    answer = subprocess.run([sys.executable, *arguments], cwd=cwd, env=environment, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def test_importing_is_light(tmp_path: Path) -> None:
    code = "import vvvaltr, sys; print(vvvaltr.__version__, 'numpy' in sys.modules)"

    assert python("-c", code, cwd=tmp_path).split() == [vvvaltr.__version__, "False"]


def test_every_public_name_is_there_and_documented() -> None:
    for name in vvvaltr.__all__:
        assert getattr(vvvaltr, name).__doc__, name
        assert name in dir(vvvaltr)


def test_type_checkers_see_the_names_that_exist_at_run_time() -> None:
    module = ast.parse(Path(vvvaltr.__file__).read_text())
    block = next(node for node in module.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: node.module for node in imports for alias in node.names}

    assert seen == {name: f"vvvaltr.{room}" for name, room in vvvaltr._HOMES.items()}
    assert sorted(seen) == sorted(vvvaltr.__all__)


def test_a_name_that_does_not_exist_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Gate'"):
        vvvaltr.Gate  # noqa: B018


def test_a_planar_robot_needs_no_argument() -> None:
    trial = vvvaltr.run_trial(vvvaltr.planar_robot(), vvvaltr.Gait((9.0, 9.0, 9.0)), vvvaltr.TrialSettings(1.0))

    assert trial.outcome is vvvaltr.Outcome.COMPLETED


def test_an_open_robot_is_guarded() -> None:
    with vvvaltr.open_robot() as robot, pytest.raises(ValueError, match="motor 2: 99 Hz is outside its limits"):
        robot.motors.drive(vvvaltr.Gait((9.0, 99.0, 9.0)), 0.2)


def test_a_twin_opens_in_the_condition_asked_for() -> None:
    gait = vvvaltr.Gait((12.0, 14.0, 9.0))
    ends = []
    for damage in ([], ["disable:2"]):
        with vvvaltr.open_robot("planar", seed=3, damage=damage, friction=0.8) as robot:
            ends.append(vvvaltr.run_trial(robot, gait, robot.settings).states[-1].frequency_hz)

    assert min(ends[0]) > 1.0
    assert ends[1].count(0.0) == 1


def test_a_real_robot_opens_from_its_file_with_its_own_settings(qik: MockProcess) -> None:
    with vvvaltr.open_robot(qik.greeting.robot_file) as robot:
        trial = vvvaltr.run_trial(robot, vvvaltr.Gait((9.0, -8.0, 7.0)), vvvaltr.TrialSettings(duration_s=0.5))

    assert trial.outcome is vvvaltr.Outcome.COMPLETED
    assert len(trial.states[-1].frequency_hz) == robot.space.motor_count == 3


def test_an_unknown_robot_is_refused_in_one_line() -> None:
    with pytest.raises(vvvaltr.UserError, match="planer") as refusal:
        vvvaltr.open_robot("planer")

    assert "\n" not in str(refusal.value)


def learned(**options: object) -> list[vvvaltr.LoggedTrial]:
    with vvvaltr.open_robot("planar", seed=1) as robot:
        optimizer = vvvaltr.make_optimizer("plain", robot.space, seed=1)
        return list(vvvaltr.learn(robot, optimizer, **options))  # type: ignore[arg-type]


def test_learning_makes_as_many_trials_as_asked_for_and_knows_a_best_gait() -> None:
    logged = learned(trials=6, duration_s=1.0)

    assert [each.trial.number for each in logged] == [1, 2, 3, 4, 5, 6]
    assert all(math.isclose(each.trial.duration_s, 1.0) for each in logged)
    assert logged[-1].recommendation is not None


def test_learning_scores_as_asked_for() -> None:
    net, path = (learned(trials=1, duration_s=2.0, score=score)[0].score for score in ("net", "path"))

    assert net is not None and path is not None
    assert path > net


def test_learning_keeps_its_trials_in_a_folder(tmp_path: Path) -> None:
    logged = learned(trials=3, duration_s=1.0, out=tmp_path / "new" / "run")

    kept = vvvaltr.read_run(tmp_path / "new" / "run")

    assert [each.score for each in kept.trials] == [each.score for each in logged]
    assert kept.structure is not None


def test_a_folder_that_cannot_be_made_is_named_before_anything_moves(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(vvvaltr.UserError, match=r"file/run cannot be made: .*; choose another place"):
        learned(trials=2, duration_s=1.0, out=tmp_path / "file" / "run")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"score": "nett"}, "no score 'nett'"),
        ({"out": "."}, "exists"),
        ({"trials": 0}, "trials is 0"),
        ({"trials": math.nan}, "trials is nan"),
        ({"trials": 12, "confirm": (-3, 4)}, r"confirm is \(-3, 4\)"),
        ({"duration_s": 0.0}, "duration_s is 0: give a time"),
        ({"duration_s": math.nan}, "duration_s is nan"),
        ({"duration_s": math.inf}, "duration_s is inf"),
        ({"trials": 12, "confirm": (3, 4)}, "confirm 3x4 leaves no trial"),
    ],
)
def test_bad_wishes_are_refused_before_anything_moves(options: dict[str, object], words: str) -> None:
    with (
        vvvaltr.open_robot("planar") as robot,
        pytest.raises(vvvaltr.UserError, match=words),
    ):
        vvvaltr.learn(robot, vvvaltr.make_optimizer("plain", robot.space, 1), **options)  # type: ignore[arg-type]


class Middle:
    """Asks for the middle of the space, and forgets what it is told."""

    def __init__(self, space: vvvaltr.GaitSpace) -> None:
        self.gait = space.from_unit(numpy.full(space.dimension, 0.5))

    def ask(self) -> vvvaltr.Suggestion:
        return vvvaltr.Suggestion(self.gait, "the middle")

    def tell(self, gait: vvvaltr.Gait, score: float) -> None:
        pass


def test_ask_and_tell_suffice_for_an_optimiser() -> None:
    with vvvaltr.open_robot("planar", seed=1) as robot:
        middle = Middle(robot.space)
        logged = list(vvvaltr.learn(robot, middle, trials=5, duration_s=1.0, confirm=(1, 3)))

    assert [each.suggestion.origin for each in logged] == ["the middle"] * 2 + ["confirmation"] * 3
    assert logged[-1].recommendation is not None
    assert logged[-1].recommendation.gait == middle.gait


def test_a_kept_run_is_a_source(tmp_path: Path) -> None:
    logged = learned(trials=3, duration_s=1.0, out=tmp_path / "run")

    source = vvvaltr.read_source(tmp_path / "run", score="path")

    assert source.gaits == tuple(each.trial.gait for each in logged)
    with vvvaltr.open_robot("planar", friction=0.7) as robot:
        optimizer = vvvaltr.make_optimizer("guarded", robot.space, seed=1, sources=[source])
        assert len(list(vvvaltr.learn(robot, optimizer, trials=2, duration_s=1.0, score="path"))) == 2


def test_a_run_that_is_broken_off_keeps_its_trials(tmp_path: Path) -> None:
    with vvvaltr.open_robot("planar", seed=1) as robot:
        optimizer = vvvaltr.make_optimizer("plain", robot.space, seed=1)
        for logged in vvvaltr.learn(robot, optimizer, trials=9, duration_s=1.0, out=tmp_path / "run"):
            if logged.trial.number == 2:
                break

    assert len(vvvaltr.read_run(tmp_path / "run").trials) == 2


def test_learning_guards_a_bare_twin() -> None:
    twin = vvvaltr.planar_robot()
    too_fast = vvvaltr.make_optimizer("random", vvvaltr.GaitSpace.over(3, 90.0, 99.0), seed=1)

    with pytest.raises(vvvaltr.TrialCrashed, match="outside its limits"):
        list(vvvaltr.learn(twin, too_fast))


def test_learning_refuses_motors_without_a_guard() -> None:
    class Bare:
        def __init__(self) -> None:
            twin = vvvaltr.planar_robot()
            self.motors, self.tracker, self.clock, self.structure = twin.motors, twin.tracker, twin.clock, None
            self.place, self.close = twin.place, twin.close

    optimizer = vvvaltr.make_optimizer("random", vvvaltr.GaitSpace.over(3, 4.0, 16.0), seed=1)

    with pytest.raises(vvvaltr.UserError, match="no guard: use open_robot"):
        vvvaltr.learn(Bare(), optimizer)


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A folder with packages of others that are called as the rooms are."""
    for name in ("controller", "drivers", "twin", "transfer", "library"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(FOREIGN)
    return tmp_path


@pytest.fixture(params=["first on the path", "in the working folder"])
def place(request: pytest.FixtureRequest, foreign: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The working folder and PYTHONPATH."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    return (elsewhere, str(foreign)) if request.param == "first on the path" else (foreign, "")


def test_the_names_of_others_stay_theirs(place: tuple[Path, str]) -> None:
    cwd, path = place

    assert python("-c", "from controller import Robot; print(Robot)", cwd=cwd, path=path).strip() == FOREIGN[9:-2]


def test_the_names_of_others_do_not_break_the_import(place: tuple[Path, str]) -> None:
    cwd, path = place
    code = "import vvvaltr, controller; print([getattr(vvvaltr, name) for name in vvvaltr.__all__] and vvvaltr.learn)"

    assert "learn" in python("-c", code, cwd=cwd, path=path)


def test_the_names_of_others_do_not_break_the_command(place: tuple[Path, str]) -> None:
    cwd, path = place
    command = str(Path(sys.executable).with_name("vvvaltr"))
    learn = ["learn", "--robot", "planar", "--trials", "2", "--duration", "1", "--no-recording", "--json"]

    trial = ["trial", "9", "9", "9", "--robot", "planar", "--duration", "1", "--json"]

    for way in ([command], ["-m", "vvvaltr"]):
        assert python(*way, "--version", cwd=cwd, path=path).strip() == f"vvvaltr {vvvaltr.__version__}"
        assert '"trials": 2' in python(*way, *learn, cwd=cwd, path=path)
        assert '"completed"' in python(*way, *trial, cwd=cwd, path=path)
