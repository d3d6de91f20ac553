"""Poses on their way from a mock to a tracker: thinned out, or changed."""

import json
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from vvvaltr.drivers.trackers.stream.tracker import find_free_port

Change = Callable[[int, dict], dict | None]


@contextmanager
def relayed(robot_file: Path, copy: Path, change: Change, *keys: str) -> Iterator[str]:
    """Relay the poses of a mock's stream to the tracker of a copied robot's file.

    Args:
        robot_file: the mock's.
        copy: where to write the file whose tracker hears the changed poses.
        change: returns the message in place of the given one, whose number is counted from 0; None for no message.
        keys: lines of the tracker's table, in place of those that it has.
    """
    text = robot_file.read_text(encoding="utf-8")
    head, tracker = text.split("[tracker]")
    theirs, ours = int(tracker.split("port = ")[1].split()[0]), find_free_port()
    for line in (f"port = {ours}", *keys):
        tracker = re.sub(rf"(?m)^{line.split()[0]} = .*$", line, tracker, count=1)
    copy.write_text(f"{head}[tracker]{tracker}", encoding="utf-8")
    ended = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox:
        inbox.bind(("127.0.0.1", theirs))
        inbox.settimeout(0.2)
        thread = threading.Thread(target=_relay, args=(inbox, ("127.0.0.1", ours), change, ended))
        thread.start()
        try:
            yield str(copy)
        finally:
            ended.set()
            thread.join()


def _relay(inbox: socket.socket, to: tuple[str, int], change: Change, ended: threading.Event) -> None:
    number = 0
    while not ended.is_set():
        try:
            message = json.loads(inbox.recv(65536))
        except TimeoutError:
            continue
        if (changed := change(number, message)) is not None:
            inbox.sendto(json.dumps(changed).encode(), to)
        number += 1
