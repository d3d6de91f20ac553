"""The layout for Foxglove names topics and fields that a log has."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from google.protobuf.descriptor import Descriptor

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.runs import log
from vvvaltr.controller.view.foxglove import make_layout


def leaves(layout: object) -> list[str]:
    return [layout] if isinstance(layout, str) else [*leaves(layout["first"]), *leaves(layout["second"])]


def has_field(kind: Descriptor, path: str) -> bool:
    name, _, rest = path.partition(".")
    field = kind.fields_by_name.get(name.partition("[")[0])
    return field is not None and (not rest or has_field(field.message_type, rest))


def test_every_panel_has_a_place_and_every_place_a_panel() -> None:
    layout = make_layout(3)
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


@pytest.mark.parametrize("panel", ["Plot!motors", "Plot!speed"])
def test_every_curve_is_a_field_of_the_log(panel: str) -> None:
    for curve in make_layout(3)["configById"][panel]["paths"]:
        topic, _, path = curve["value"].partition(".")
        assert has_field(log._KINDS[topic].DESCRIPTOR, path), curve["value"]


def test_every_topic_that_is_drawn_is_in_the_log() -> None:
    assert set(make_layout(3)["configById"]["3D!robot"]["topics"]) <= set(log._KINDS)


def test_the_command_writes_curves_for_each_motor(tmp_path: Path) -> None:
    assert main(["foxglove-layout", str(tmp_path / "layout.json"), "--motors", "6", "--quiet"]) == 0
    panels = json.loads((tmp_path / "layout.json").read_text())["configById"]
    assert len(panels["Plot!motors"]["paths"]) == 12
