"""Learns a gait on the planar twin: ask, run, score, tell. Takes about two seconds."""

import vvvaltr

with vvvaltr.open_robot("planar", seed=1) as robot:
    optimizer = vvvaltr.make_optimizer("drive", robot.space, seed=1)
    for logged in vvvaltr.learn(robot, optimizer, trials=20):
        if logged.score is not None:  # a trial that failed has none
            print(f"trial {logged.trial.number:2}: {logged.trial.gait}: {1000 * logged.score:.1f} mm/s")
    best = optimizer.recommend()
print(f"best gait: {best.gait}, {1000 * best.estimate.mean:.1f} mm/s expected")
