"""A layout for Foxglove: the robot, its motors and the speeds of a log, where Foxglove would show an empty window."""

from __future__ import annotations

from typing import Any


def make_layout(motors: int) -> dict[str, Any]:
    """Return the layout, as Foxglove imports it, for a robot with so many motors."""
    curves = [("command.gait", "asked"), ("state", "applied")]
    frequencies = [
        _line(f"/motors/{topic}.frequency_hz[{motor}]", f"motor {motor + 1} {what}")
        for topic, what in curves
        for motor in range(motors)
    ]
    speeds = [
        _line("/trial.score_m_s", "measured", dots=True),
        _line("/trial.recommendation.estimate.mean_m_s", "best gait: mean"),
        _line("/trial.recommendation.estimate.low_m_s", "its 95 % interval, low"),
        _line("/trial.recommendation.estimate.high_m_s", "its 95 % interval, high"),
    ]
    panels = {
        "3D!robot": _robot(),
        "Plot!motors": _plot("Motor frequencies (Hz)", frequencies),
        "Plot!speed": _plot("Speed of each trial (m/s)", speeds),
        "Table!trial": {"foxglovePanelTitle": "Trial", "topicPath": "/trial"},
    }
    right = _split("column", "Plot!speed", _split("column", "Plot!motors", "Table!trial", 60), 40)
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", "3D!robot", right, 55),
    }


def _robot() -> dict[str, Any]:
    camera = {"distance": 0.8, "perspective": True, "phi": 70, "thetaOffset": 20, "fovy": 45, "near": 0.01, "far": 100}
    return {
        "foxglovePanelTitle": "Robot",
        "followMode": "follow-none",
        "followTf": "world",
        "cameraState": camera | {"target": [0, 0, 0], "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1]},
        "scene": {"transforms": {"showLabel": False, "axisScale": 0.05}},
        "topics": {topic: {"visible": True} for topic in ("/robot/scene", "/ground")}
        | {"/robot/points": {"visible": False}, "/robot/pose": {"visible": False}},
        "layers": {},
    }


def _plot(title: str, lines: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": lines,
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _line(path: str, label: str, dots: bool = False) -> dict[str, Any]:
    return {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime", "showLine": not dots}


def _split(direction: str, first: Any, second: Any, percentage: int) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
