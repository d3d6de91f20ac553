"""A run as a table and a plot: what each trial scored, and what the best gait was believed to score after it."""

from pathlib import Path

import matplotlib.pyplot as plt

import vvvaltr

RUN = Path("runs/example")

if not RUN.exists():
    with vvvaltr.open_robot("planar", seed=2) as robot:
        optimizer = vvvaltr.make_optimizer("drive", robot.space, seed=2)
        for _ in vvvaltr.learn(robot, optimizer, trials=25, out=RUN):
            pass

table = vvvaltr.read_run(RUN).table()  # a numpy structured array, which pandas.DataFrame takes as it is
print(table.dtype.names)

plt.plot(table["number"], 1000 * table["score_m_s"], "o", label="trial")
plt.plot(table["number"], 1000 * table["recommended_mean_m_s"], label="gait believed best, mean")
plt.fill_between(
    table["number"],
    1000 * table["recommended_low_m_s"],
    1000 * table["recommended_high_m_s"],
    alpha=0.2,
    label="its 95 % interval",
)
plt.xlabel("trial")
plt.ylabel("speed in mm/s")
plt.ylim(0, 3000 * table["score_m_s"].max())  # the first intervals are wide
plt.legend()
plt.savefig("run.png")
