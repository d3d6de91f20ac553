"""A body of one's own on the planar twin: the prism with stiffer springs on one side and two motors only."""

from dataclasses import replace

import vvvaltr
from vvvaltr.twin.bodies import prism3
from vvvaltr.twin.planar.engine import PlanarEngine
from vvvaltr.twin.presets import PLANAR_PARTS
from vvvaltr.twin.robot import TwinRobot
from vvvaltr.twin.scatter import Scatter
from vvvaltr.twin.world import World

prism = prism3(PLANAR_PARTS)
stiff = tuple(replace(spring, stiffness_n_m=1.5 * spring.stiffness_n_m) for spring in prism.springs[:3])
body = replace(prism, name="two-motor prism", springs=(*stiff, *prism.springs[3:]), motors=prism.motors[:2])

twin = TwinRobot(PlanarEngine(body, World(friction=0.7)), (4.0, 16.7), seed=1, scatter=Scatter())
robot = vvvaltr.GuardedRobot(twin, vvvaltr.Limits(twin.max_hz))
optimizer = vvvaltr.make_optimizer("drive", vvvaltr.GaitSpace.over(2, 4.0, 16.7), seed=1)
for logged in vvvaltr.learn(robot, optimizer, trials=12, duration_s=3.0):
    if logged.score is not None:  # a trial that failed has none
        print(f"trial {logged.trial.number:2}: {logged.trial.gait}: {1000 * logged.score:.1f} mm/s")
print(f"best gait: {optimizer.recommend().gait}")
