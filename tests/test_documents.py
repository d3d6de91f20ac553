"""The documents point at what exists."""

import re
import tomllib
from pathlib import Path

import pytest

import vvvaltr
from vvvaltr.controller.robot.robot_file import robot_file_from
from vvvaltr.drivers.trackers.registry import TRACKERS

ROOT = Path(__file__).parent.parent
FRONT_DOOR = {"entry", "library"}  # modules of vvvaltr, which is drawn as a whole
DOCUMENTS = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("drivers/**/*.md")]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(document: Path) -> None:
    targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", document.read_text())

    assert not [target for target in targets if not (document.parent / target).exists()]


def test_the_drawing_of_the_rooms_has_every_room_of_the_import_contract() -> None:
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]
    rooms = {room for floor in contract["layers"] for room in re.split(r"\s*[|:]\s*", floor)} - FRONT_DOOR
    drawn = re.findall(r"monospace\">([\w/]+)<", (ROOT / "docs" / "rooms.svg").read_text())

    assert set(drawn) == {room.replace(".", "/") for room in rooms} | {"vvvaltr"}


def test_every_decision_is_in_the_index() -> None:
    folder = ROOT / "docs" / "decisions"
    index = (folder / "README.md").read_text()

    assert [path.name for path in folder.glob("[0-9]*.md") if f"({path.name})" not in index] == []


def test_the_robot_files_of_the_documents_are_understood_with_each_kind_of_tracker() -> None:
    blocks = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "hardware.md").read_text(), re.DOTALL)
    example, *others = [tomllib.loads(block) for block in blocks if "[tracker]" in block]

    robots = [robot_file_from({**example, **other}, "hardware.md") for other in [{}, *others]]

    assert {type(robot.tracker) for robot in robots} == {TRACKERS.named(name).table for name in TRACKERS.built_in}


def test_the_citation_names_the_version() -> None:
    assert f"\nversion: {vvvaltr.__version__}\n" in (ROOT / "CITATION.cff").read_text()
