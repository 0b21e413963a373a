"""Make docs/stability.png, and print the numbers of docs/stability.md.

python scripts/stability.py
"""

from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.control.stability.plane import gain_plane
from armdyn.show.plots import save_figure
from armdyn.show.regions import plot_regions
from armdyn.studies.paper.printed.examples import example

DOCS = Path(__file__).parents[1] / "docs"
ARMS, PAYLOADS, FORMS = ("r", "rr", "rrr"), (0.0, 0.1006, 0.5, 1.0), ("torque", "acceleration")
POINTS = 90


def arm(name, mass):
    """A paper arm and the goal of its PID example."""
    robot = ad.Robot.from_spec(ad.ArmSpec.paper(name), ad.Payload(mass=mass) if mass else None)
    return robot, example(name, "pid").q_goal


def tables():
    """Routh's table of R, factors, rates and margins."""
    robot, goal = arm("r", 0.1006)
    region = ad.GainRegion.of(robot, goal, "torque")
    print(f"R, 100.6 g, torque: {region}")
    print(ad.routh_table(region.polynomial(ad.PAPER_GAINS.kp, ad.PAPER_GAINS.ki, ad.PAPER_GAINS.kd)).markdown())
    for name in ARMS:
        factors = [ad.least_stable_factor(*arm(name, mass), ad.PAPER_GAINS, "acceleration") for mass in PAYLOADS]
        print(f"{name}: least stable factor, acceleration: {', '.join(f'{factor:.3f}' for factor in factors)}")
    for name in ARMS:
        robot, goal = arm(name, 0.1006)
        for controller in (ad.Pid(ad.PAPER_GAINS, "torque"), ad.Lqr()):
            kind = type(controller).__name__
            print(f"{name}, {kind}: {ad.sampled_stability(robot, goal, controller, ad.Loop()).message}")
            for velocity in ("exact", "filtered"):
                rates = [
                    ad.slowest_stable_rate(robot, goal, controller, delay, loop=ad.Loop(velocity=velocity))
                    for delay in (0, 1)
                ]
                print(f"  {velocity}: slowest rate, 0 and 1 tick: {', '.join(f'{rate:.0f} Hz' for rate in rates)}")
            loop = ad.sampled_loop(robot, goal, controller, ad.Loop())
            for one in ad.loop_margins(loop) if loop.radius < 1 else ():
                print(f"  {one}")


def planes(name, form):
    """The plane of each payload."""
    kp, kd = np.geomspace(0.3, 3000, POINTS), np.geomspace(0.003, 1000, POINTS)
    goals = {f"{1e3 * mass:g} g": arm(name, mass) for mass in PAYLOADS if mass != 0.5}
    return {label: gain_plane(*both, kp=kp, kd=kd, ki=50.0, form=form) for label, both in goals.items()}


if __name__ == "__main__":
    tables()
    panels = {f"{name.upper()}, {form}": planes(name, form) for form in FORMS for name in ARMS}
    figure = plot_regions(
        panels,
        mark=(30.0, 10.0),
        marked="the paper's gains",
        title="Stable PID gains at the goal, ki = 50; sampled at 1 kHz",
    )
    print(save_figure(figure, DOCS / "stability.png"))
