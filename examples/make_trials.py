"""Makes a table as a laboratory writes one, trials.csv: 24 random gaits of 20 s each on the planar twin."""

import csv

import vvvaltr

with vvvaltr.open_robot("planar", seed=7) as robot, open("trials.csv", "w", newline="", encoding="utf-8") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(["RPM_1", "RPM_2", "RPM_3", "Displacement_mm"])
    gaits = vvvaltr.make_optimizer("random", robot.space, seed=7)
    for logged in vvvaltr.learn(robot, gaits, trials=24, duration_s=20.0):
        if logged.score is not None:  # a trial that failed has none
            rpm = [round(60.0 * hz) for hz in logged.trial.gait.frequency_hz]
            table.writerow([*rpm, round(1000.0 * logged.score * logged.trial.duration_s, 1)])
