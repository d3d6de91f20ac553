"""`vvvaltr camera`: print the tags, calibrate the lens, and look at what the camera sees."""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import number, whole, write_file
from vvvaltr.controller.cli.telling import say
from vvvaltr.controller.core.errors import NotUnderstood, UserError

if TYPE_CHECKING:
    from cv2.typing import MatLike

    from vvvaltr.controller.robot.robot_file import RobotFile
    from vvvaltr.drivers.trackers.camera.sight import Sight, Sighting
    from vvvaltr.drivers.trackers.camera.source import Source
    from vvvaltr.drivers.trackers.camera.table import CameraTable
    from vvvaltr.drivers.trackers.camera.tags import Picture

_FLOOR_MM = 60.0
_LOOK_S = 5.0  # for the robot
_LIVE_PORT = 9877
_VIEWS_S = 180.0  # to show the board from all sides


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("robot", metavar="ROBOT", type=Path, help='the robot\'s file, with [tracker] kind = "camera"')
    parser.add_argument(
        "action",
        choices=("print-tag", "calibrate", "show"),
        help="print-tag: draw the tags for printing; calibrate: measure the lens and save it in the robot's file; "
        "show: draw what the camera sees",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="PATH",
        help="name of what is written: .svg and .png of print-tag, .png of show (default tag, board or camera)",
    )
    printing = parser.add_argument_group("print-tag")
    printing.add_argument("--board", action="store_true", help="the board for calibrate instead of the tags")
    printing.add_argument(
        "--floor-size",
        type=number(above=0),
        metavar="MM",
        default=_FLOOR_MM,
        help="side of the floor's tags, in mm (default 60)",
    )
    views = parser.add_argument_group("calibrate")
    views.add_argument(
        "--views", type=whole(6), default=15, metavar="N", help="number of different views of the board (default 15)"
    )
    showing = parser.add_argument_group("show")
    showing.add_argument(
        "--live", action="store_true", help="show it in Rerun, until interrupted, and write the last picture"
    )


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.robot.robot_file import load_robot_file
    from vvvaltr.drivers.trackers.camera.table import CameraTable
    from vvvaltr.drivers.trackers.camera.tracker import require_opencv, silence_opencv

    robot = load_robot_file(arguments.robot)
    table = robot.tracker
    if not isinstance(table, CameraTable):
        raise NotUnderstood(
            f'{arguments.robot}: tracker.kind is {table.__struct_config__.tag!r}; set it to "camera": docs/camera.md'
        )
    require_opencv()
    silence_opencv()
    actions = {"print-tag": _print_tags, "calibrate": _calibrate, "show": _show}
    return actions[arguments.action](arguments, robot, table)


def _print_tags(arguments: Namespace, robot: RobotFile, table: CameraTable) -> Answer:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.drivers.trackers.camera.printing import board_page, png, svg, tag_pages

    tags = [(table.tag.id, 1000.0 * table.tag.size_m, "robot, its right points forward")]
    tags += [(each.id, arguments.floor_size, "floor") for each in table.floor]
    with one_line_errors():
        pages = [board_page()] if arguments.board else tag_pages(tags)
    stem = _named(arguments, "board" if arguments.board else "tag", "")
    files = []
    for sheet, page in enumerate(pages, start=1):
        name = f"{stem}-{sheet}" if len(pages) > 1 else str(stem)
        write_file(Path(f"{name}.svg"), svg(page))
        write_file(Path(f"{name}.png"), png(page))
        files += [f"{name}.svg", f"{name}.png"]
    prose = f"wrote {', '.join(files)}: print at 100 %, and measure the ruler"
    return Answer(prose, {"files": files, "tags": [] if arguments.board else [tag[0] for tag in tags]})


def _named(arguments: Namespace, usual: str, suffix: str) -> Path:
    """Return the name of what is written. Raises NotUnderstood for the name of a folder."""
    path: Path = arguments.out or Path(usual)
    if arguments.out is not None and path.is_dir():
        raise NotUnderstood(f"--out {path} names no file: give {path / usual}, for example")
    return path.with_suffix(suffix)


def _calibrate(arguments: Namespace, robot: RobotFile, table: CameraTable) -> Answer:
    import msgspec

    from vvvaltr.controller.robot.commissioning.lens import save_lens
    from vvvaltr.drivers.trackers.camera.board import calibrated
    from vvvaltr.drivers.trackers.camera.opening import open_source
    from vvvaltr.drivers.trackers.camera.table import lens_table

    with closing(open_source(table.source, table.wanted, in_real_time=False)) as source:
        found = calibrated(_board_views(arguments, source))
    lens = lens_table(found.lens, round(found.error_px, 4))
    plain = msgspec.to_builtins(lens)
    save_lens(arguments.robot, plain)
    prose = (
        f"focal length {lens.focal_px[0]:.1f} px, known to {100.0 * found.focal_doubt:.2f} %; corners within "
        f"{found.error_px:.2f} px; saved in {arguments.robot}"
    )
    return Answer(prose, {"robot": str(arguments.robot), "lens": plain, "focal_doubt": found.focal_doubt})


def _board_views(arguments: Namespace, source: Source) -> Any:
    from vvvaltr.drivers.trackers.camera.board import BoardViews
    from vvvaltr.drivers.trackers.camera.source import NoMorePictures

    say(arguments, "show the board near and far, tilted to all sides, and in every corner of the picture")
    views, ends_s = BoardViews(), time.monotonic() + _VIEWS_S
    try:
        while len(views.views) < arguments.views and time.monotonic() < ends_s:
            if views.add(source.newest().grey):
                say(arguments, f"view {len(views.views)} of {arguments.views}")
    except NoMorePictures as error:
        say(arguments, str(error))
    if len(views.views) < arguments.views:
        raise UserError(
            f"only {len(views.views)} different views of the board were seen, {arguments.views} are needed: print it "
            "with print-tag --board, hold it within 0.5 m, and show it from more sides"
        )
    return views


def _show(arguments: Namespace, robot: RobotFile, table: CameraTable) -> Answer:
    import cv2

    from vvvaltr.drivers.trackers.camera.opening import open_source

    path = _named(arguments, "camera", ".png")
    with closing(open_source(table.source, table.wanted, in_real_time=False)) as source:
        looks = _Looks(robot, table, source)
        if arguments.live:
            _show_live(arguments, looks)
        look = looks.first()
        write_file(path, cv2.imencode(".png", look.picture)[1].tobytes())
    if not look.data["pose"]:
        raise UserError(f"{look.data['problem']}; {path} shows what the camera sees")
    return Answer("\n".join([*look.lines, f"wrote {path}"]), {"picture": str(path), **look.data})


@dataclass(frozen=True, slots=True)
class _Look:
    """One picture: with the pose drawn in, in words, and for programs."""

    picture: MatLike
    lines: tuple[str, ...]
    data: dict[str, Any]


class _Looks:
    """Pictures of the camera, each with what was seen in it."""

    def __init__(self, robot: RobotFile, table: CameraTable, source: Source) -> None:
        from vvvaltr.drivers.trackers.camera.source import NoMorePictures
        from vvvaltr.drivers.trackers.camera.watcher import start_sight

        self._robot, self._table, self._source = robot, table, source
        self._sight: Sight | None = None
        self._problem = ""
        try:
            self._sight = start_sight(table, source)
        except (UserError, NoMorePictures) as error:  # then the picture tells why
            self._problem = str(error)

    def __iter__(self) -> Iterator[_Look]:
        from vvvaltr.drivers.trackers.camera.source import NoMorePictures

        try:
            while True:
                yield self._look(self._source.newest().grey)
        except NoMorePictures:
            return

    def first(self) -> _Look:
        """Return the first look that shows the robot, or the last one before patience ends. Raises UserError."""
        look, ends_s = None, time.monotonic() + _LOOK_S
        for look in self:
            if look.data["pose"] or self._problem or time.monotonic() > ends_s:
                break
        if look is None:
            raise UserError(f"{self._problem or 'the source has ended before the robot was seen'}")
        return look

    def _look(self, grey: Picture) -> _Look:
        from vvvaltr.drivers.trackers.camera.drawing import draw_floor, draw_robot, drawn, place_text
        from vvvaltr.drivers.trackers.camera.tags import all_tags
        from vvvaltr.drivers.trackers.camera.watcher import robot_place

        seen, problem = self._read(grey)
        place = robot_place(seen, self._table.tag) if seen else None
        lines = (place_text(place, seen) if place and seen else problem, *self._settings())
        picture = drawn(grey, all_tags(grey), self._table.tag.id, lines)
        if self._sight is not None:
            arena = self._robot.arena
            draw_floor(picture, self._sight.view, (arena.x_m, arena.y_m) if arena else None)
            if place is not None:
                draw_robot(picture, self._sight.view, self._sight.tag, place)
        return _Look(picture, lines, {"pose": self._pose(place, seen), "problem": problem, **self._applied()})

    def _read(self, grey: Picture) -> tuple[Sighting | None, str]:
        from vvvaltr.drivers.trackers.camera.sight import Unseen

        if self._sight is None:
            return None, self._problem
        try:
            return self._sight.read(grey), ""
        except Unseen as unseen:
            return None, str(unseen)

    def _pose(self, place: tuple[float, float, float] | None, seen: Sighting | None) -> dict[str, float] | None:
        if place is None or seen is None:
            return None
        return dict(zip(("x_m", "y_m", "yaw_rad"), place, strict=True)) | {"uncertainty_m": seen.uncertainty_m}

    def _settings(self) -> list[str]:
        data = self._applied()
        exposure = f"exposure {1000 * data['exposure_s']:g} ms" if data["exposure_s"] else "exposure not told"
        lines = [f"{data['width_px']} x {data['height_px']} at {data['rate_hz']:g} pictures/s, {exposure}"]
        if self._sight is not None:
            floor = f", floor tags within {1000 * data['floor_error_m']:.1f} mm" if self._table.floor else ""
            lines.append(f"camera {data['camera_height_m']:.3f} m above the ground{floor}")
        return lines

    def _applied(self) -> dict[str, Any]:
        import msgspec

        data: dict[str, Any] = msgspec.to_builtins(self._source.applied)
        if self._sight is not None:
            view = self._sight.view
            data |= {"camera_height_m": float(view.position_m[2]), "floor_error_m": view.error_m}
        return data


def _show_live(arguments: Namespace, looks: _Looks) -> None:
    from vvvaltr.controller.cli.rerun_extra import require_rerun

    require_rerun()
    import cv2
    import rerun as rr

    with rr.RecordingStream("vvvaltr camera") as recording:
        recording.set_sinks(rr.GrpcServerSink(bind_ip="127.0.0.1", port=_LIVE_PORT, server_memory_limit="100MB"))
        say(arguments, f"rerun rerun+http://127.0.0.1:{_LIVE_PORT}/proxy shows it; Ctrl-C ends")
        try:
            for look in looks:
                jpeg = cv2.imencode(".jpg", look.picture)[1].tobytes()
                recording.log("camera", rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))
        except KeyboardInterrupt:
            return


COMMAND = Subcommand(
    help="print an overhead camera's tags, calibrate its lens, show what it sees",
    example="vvvaltr camera robot.toml show",
    add_arguments=_add_arguments,
    execute=_execute,
)
