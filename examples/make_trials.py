"""Makes a table as a laboratory writes one, trials.csv: 24 random gaits of 20 s each on the planar twin."""

import csv
import math

import vvvaltr

DURATION_S = 20.0

with vvvaltr.open_robot("planar", seed=7) as robot, open("trials.csv", "w", newline="", encoding="utf-8") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(["RPM_1", "RPM_2", "RPM_3", "Displacement_mm"])
    gaits = vvvaltr.make_optimizer("random", robot.space, seed=7)
    for logged in vvvaltr.learn(robot, gaits, trials=24, duration_s=DURATION_S):
        first, last = logged.trial.poses[0].position_m, logged.trial.poses[-1].position_m
        moved_mm = 1000.0 * math.dist(first[:2], last[:2])
        table.writerow([*(round(60.0 * hz) for hz in logged.trial.gait.frequency_hz), round(moved_mm, 1)])
