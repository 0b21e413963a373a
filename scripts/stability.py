"""Make docs/stability.png, and print the numbers of docs/stability.md: python scripts/stability.py."""

from pathlib import Path

import numpy as np
from gain_regions import plot_regions

import armdyn as ad
from armdyn.control.loop.loop import VELOCITIES
from armdyn.control.stability.region import gain_plane
from armdyn.paper import GAINS, example
from armdyn.show.plots import save_figure

DOCS = Path(__file__).parents[1] / "docs"
ARMS, PAYLOADS, FORMS = ("r", "rr", "rrr"), (0.0, 0.1006, 0.5, 1.0), ("torque", "acceleration")
POINTS = 90
PAPER = (GAINS.kp, GAINS.ki, GAINS.kd)


def arm(name, mass=0.1006):
    """A paper arm and the goal of its PID example."""
    robot = ad.Robot.from_spec(ad.ArmSpec.paper(name), ad.Payload(mass=mass) if mass else None)
    return robot, example(name, "pid").q_goal


def continuous():
    """Routh's table of R, its condition against eigenvalues, and factors."""
    one_link = arm("r")
    region = ad.GainRegion.of(*one_link, "torque")
    print(f"R, 100.6 g, torque: {region}\n{ad.routh_table(region.polynomial(*PAPER)).markdown()}")
    random, wrong, stable = np.random.default_rng(0), 0, 0
    for gains in 10 ** random.uniform(-3, 3, (10_000, 3)):
        values = ad.closed_loop_eigenvalues(*one_link, ad.PidGains(*gains), "torque")
        wrong += bool(region.stable(*gains)) != (values[0].real < 0)
        stable += bool(region.stable(*gains))
    print(f"10000 random gains: {stable} stable, {wrong} disagreements with eigenvalues")
    for name in ARMS:
        factors = [ad.least_stable_factor(*arm(name, mass), GAINS, "acceleration") for mass in PAYLOADS]
        print(f"{name}: least stable factor, acceleration: {', '.join(f'{factor:.3f}' for factor in factors)}")


def sampled():
    """Verdicts at 1 kHz, slowest rates and margins."""
    for name in ARMS:
        for controller in (ad.Pid(GAINS, "torque"), ad.Lqr()):
            both = (*arm(name), controller)
            print(f"{name}, {type(controller).__name__}: {ad.sampled_stability(*both, ad.Loop()).message}")
            for velocity in VELOCITIES:
                rates = [ad.slowest_stable_rate(*both, delay, loop=ad.Loop(velocity=velocity)) for delay in (0, 1)]
                print(f"  {velocity}: from {rates[0]:.0f} Hz on without delay, {rates[1]:.0f} Hz with a tick")
            loop = ad.sampled_loop(*both, ad.Loop())
            for one in ad.loop_margins(loop) if loop.radius < 1 else ():
                low, high = np.ceil(1e3 * one.gain[0]) / 1e3, np.floor(1e2 * one.gain[1]) / 1e2
                phase, delay = np.floor(10 * np.rad2deg(one.phase)) / 10, np.floor(1e6 * one.delay) / 1e3
                print(f"  joint {one.joint + 1}: gain {low:g} to {high:g}, phase {phase:g}°, delay {delay:g} ms")


def planes(name, form):
    """The plane of each payload."""
    kp, kd = np.geomspace(0.3, 3000, POINTS), np.geomspace(0.003, 1000, POINTS)
    goals = {f"{1e3 * mass:g} g": arm(name, mass) for mass in PAYLOADS if mass != 0.5}
    return {label: gain_plane(*both, kp=kp, kd=kd, ki=50.0, form=form) for label, both in goals.items()}


if __name__ == "__main__":
    continuous()
    sampled()
    panels = {f"{name.upper()}, {form}": planes(name, form) for form in FORMS for name in ARMS}
    title = "Stable PID gains at the goal, ki = 50; sampled at 1 kHz"
    figure = plot_regions(panels, mark=(30.0, 10.0), marked="the paper's gains", title=title)
    print(save_figure(figure, DOCS / "stability.png"))
