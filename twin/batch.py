"""Many trials at once, with exactly the results of running them one by one."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from queue import SimpleQueue
from typing import TypeVar

from vvvaltr.controller.core.processes import processes
from vvvaltr.twin.robot import TwinRobot
from vvvaltr.twin.spatial.engine import SpatialEngine

Result = TypeVar("Result")
Task = Callable[[TwinRobot], Result]

CHUNKS_PER_PROCESS = 8
"""Chunks that each process gets: fewer leave processes idle at the end, more make a robot too often."""


def run_all(
    make_robot: Callable[[], TwinRobot], tasks: Sequence[Task[Result]], jobs: int = 1
) -> Generator[Result, None, None]:
    """Run each task with a robot to itself, ``jobs`` of them at a time, and yield the results in order.

    Every task places its robot anew, so the results do not depend on ``jobs``. The spatial twin runs in threads: MuJoCo
    releases Python for all steps between two commands, and threads need no start-up and no copies. The planar twin runs
    in processes: each of its steps is a call from Python, and threads would only wait for each other. Closing the
    generator cancels the tasks that are left: processes end at once, threads when their task ends.

    Args:
        make_robot: makes a robot. For the planar twin it must be picklable, and so must tasks and results.
        tasks: tasks of placing and driving a robot, each a function of the robot.
        jobs: number of threads or processes.

    Raises:
        Exception: whatever a task raises.
    """
    robot = make_robot()
    if jobs == 1:
        yield from (task(robot) for task in tasks)
    elif isinstance(robot.engine, SpatialEngine):
        yield from _over_threads([robot, *(make_robot() for _ in range(jobs - 1))], tasks)
    else:
        yield from _over_processes(make_robot, tasks, jobs)


def _over_threads(robots: Sequence[TwinRobot], tasks: Sequence[Task[Result]]) -> Iterator[Result]:
    free: SimpleQueue[TwinRobot] = SimpleQueue()
    for robot in robots:
        free.put(robot)

    def run(task: Task[Result]) -> Result:
        robot = free.get()
        try:
            return task(robot)
        finally:
            free.put(robot)

    with ThreadPoolExecutor(len(robots)) as pool:
        yield from pool.map(run, tasks)


def _over_processes(make_robot: Callable[[], TwinRobot], tasks: Sequence[Task[Result]], jobs: int) -> Iterator[Result]:
    size = max(1, len(tasks) // (CHUNKS_PER_PROCESS * jobs))
    chunks = [tasks[first : first + size] for first in range(0, len(tasks), size)]
    with processes(jobs) as pool:
        for results in pool.map(partial(_one_by_one, make_robot), chunks):
            yield from results


def _one_by_one(make_robot: Callable[[], TwinRobot], tasks: Sequence[Task[Result]]) -> list[Result]:
    robot = make_robot()
    return [task(robot) for task in tasks]
