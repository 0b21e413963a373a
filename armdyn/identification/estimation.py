"""Identification of an arm: from logs to the robot that moved in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arguments import Checked, checked, each, expect, number, one_of, several
from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.errors import LogError, ProblemError
from armdyn.identification.assembly import assembled
from armdyn.identification.checks import MOVED, check_log
from armdyn.identification.equations import WHAT, Equations, What, means_of
from armdyn.identification.estimate import Estimate, Judged
from armdyn.identification.fitting import Fit, FitOptions, fit, own_covariance
from armdyn.identification.log import Log, Signals
from armdyn.identification.residuals import FALSE_ALARMS, Pattern, patterns
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.reprs import brief

_EXPLAINED = 0.8
"""Torque residuals with all links identified, as a part of those without, below which the robot's inertias are wrong:
at least 0.89 on simulated logs of 4 and 10 s where they are right; below 0.8 on 19 of 24 where masses and inertias are
up to 10 % wrong."""
_SIGNIFICANT = 1e-3
"""Torque residuals of a joint, as a part of its torque limit, below which they are no evidence of wrong inertias: the
samples of a simulated log without noise leave up to 3e-4, measured torques several times 1e-3."""
_LARGE, _SMALL, _WORSE = 0.5, 0.05, 1.2
"""Torque errors on held-out data, as a part of the torques, above which a fit is useless; below which it is good; and
as a multiple of the given robot's, above which it is worse. Simulated logs with 1 % of noise leave 0.01 at most, random
torques 0.8."""
_PULLED = 1.1
"""Torque residuals as a multiple of those without the prior from which it determines what the logs tell otherwise: at
most 1.02 in 60 fits of payloads of 0.3 and 3 kg at and 0.5 m off the tips of five arms where the mass is within 5 %, at
least 1.26 where it is not. On other logs, with other masses and places (0.5 and 2 kg, six arms), on which it was not
chosen: 1.023 and 1.45."""
_FAR = "the load differs too much from the robot's; give the robot a payload near the true one, with its centre of mass"

_LEAST_MEANS = 25
"""Least number of averaged torques: of fewer the intervals are far too narrow, as their autocorrelation is not seen.
The twelve of a Z1's 0.34 s made 0.284 kg ± 0.0013 kg of 0.3 kg."""


@brief
@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(Checked):
    """Options of `identify`.

    Attributes:
        smoothing: standard deviation of the Gaussian filter of all signals and their derivatives [s]: 5 ms pass 26 Hz.
        step: torques and regressors are averaged over this time [s]: the same filter on both sides of the equations.
        held_out: part of each log, its end, on which a fit of its beginning is judged; the estimate itself is of all
            the data. 0: no judgement.
        widths: of the smoothed jump of Coulomb friction that are tried [rad/s or m/s], where the robot has none. One is
            chosen for all joints; a joint whose residuals another one makes clearly less has that one.
        fit: numbers of the robust fit.

    Raises:
        ProblemError: one is out of range.
    """

    smoothing: float = checked(number, 0.005, unit="s", sign="positive")
    step: float = checked(number, 0.02, unit="s", sign="positive")
    held_out: float = checked(number, 0.25, least=0.0, most=0.9)
    widths: tuple[float, ...] = checked(each, (0.01, 0.02, 0.05, 0.1), of=number, unit="rad/s or m/s", sign="positive")
    fit: FitOptions = checked(expect, FitOptions(), kind=FitOptions)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.widths:
            raise ProblemError("widths is empty; give one width at least")


def identify(
    robot: Robot, logs: Log | Iterable[Log], what: What = "all", options: IdentifyOptions | None = None
) -> Estimate:
    """Identify inertias, friction or payload of an arm from logs of its motions.

    The joint torques are linear in the inertial parameters, the armatures, viscous and Coulomb friction and the
    sensors' offsets. Their robust least squares, weighted by each joint's noise, is regularised by the entropic
    divergence of the pseudo-inertias from the robot's: every estimate is a physical arm, and parameters that the logs
    do not determine keep their prior values. See docs/identify.md.

    Args:
        robot: the arm as its file describes it: the prior.
        logs: one or several, of the same arm with the same payload.
        what: "all": inertias and armatures of all joints, friction; "payload": ten parameters of a body at the tip, and
            friction; "friction" alone.
        options: of the filter and the fit.

    Raises:
        LogError: a log does not fit this arm.
        UrdfError: the arm has no inertias to begin with, see `Robot.expect_dynamics`.
        ProblemError: an argument is wrong.
    """
    expect_robot(robot).expect_dynamics()
    one_of(what, WHAT, "what")
    options = expect(IdentifyOptions() if options is None else options, IdentifyOptions, "options")
    given = (logs,) if isinstance(logs, Log) else several(logs, "logs")
    if not given:
        raise LogError("logs is empty: no log is given")
    ordered = [expect(log, Log, "logs", "use Log(t=…, q=…, tau=…)").in_order(robot) for log in given]
    signals = [Signals.of(log, options.smoothing) for log in ordered]
    for log, own in zip(ordered, signals, strict=True):
        check_log(robot, log, own, what)
    kept = 1 - options.held_out
    first = [one.part(0, int(kept * one.t.size)) for one in signals]
    widths = (robot.friction.width,) if np.any(robot.friction.coulomb) else options.widths
    systems = _systems(robot, what, first, signals, widths, options.step)
    _check_length(ordered, systems[0].begun(kept), options)
    unmoved = tuple(
        joint for j, joint in enumerate(robot.joint_names) if all(np.ptp(one.q[:, j]) < MOVED for one in signals)
    )
    judged = None
    if options.held_out:
        rest = [one.part(int(kept * one.t.size), one.t.size) for one in signals]
        begun = _estimate(robot, [one.begun(kept) for one in systems], options, [])
        judged = _judged(robot, begun, rest, options.step)
    estimate = replace(_estimate(robot, systems, options, signals), judged=judged, unmoved=unmoved)
    if unfit := _unfit(estimate) or estimate.unfit:
        return replace(estimate, unfit=unfit)
    links = () if what == "all" else _warnings(robot, estimate, signals, options)
    return replace(estimate, warnings=(*estimate.warnings, *links))


def _estimate(robot: Robot, systems: list[_System], options: IdentifyOptions, signals: list[Signals]) -> Estimate:
    """The estimate of the best of the systems; its residuals are tested on the signals, if there are any."""
    try:
        best = _best(systems)
        found, (columns, torque) = best.fit(options.fit), best.joined
        means = [(one, one.samples_in(options.step)) for one in signals]
        seen = list(patterns(best.equations, found, columns, torque, means)) if signals else []
        columns = np.concatenate([columns, *(one.columns for one in seen)], axis=2)
        covariance = own_covariance(found, best.equations.own_precision, columns, torque)
        first: dict[int, Pattern] = {}  # of each joint the one that makes the fit useless, or the most significant
        for one in sorted((one for one in seen if one.words), key=lambda one: not one.unfit):
            first.setdefault(one.joint, one)
        words = {one: f"joint {robot.joint_names[j]}: {one.words}" for j, one in first.items()}
        unfit = "; ".join(said for one, said in words.items() if one.unfit)
        return replace(assembled(robot, best.equations, found, covariance), unfit=unfit, warnings=tuple(words.values()))
    except np.linalg.LinAlgError:  # unknowns next to the border of physical bodies, a thousand times the prior
        raise LogError(f"the logs cannot be fitted: {_FAR}") from None


def _unfit(estimate: Estimate) -> str:
    """Why the result should not be used: the motion does not explain the torques, or the prior contradicts them."""
    judged = estimate.judged
    if judged is not None and np.any(moved := judged.measured > 0):
        errors = judged.before, judged.after
        before, after = (float(np.median(one[moved] / judged.measured[moved])) for one in errors)
        if after > _LARGE or after > max(_WORSE * before, _SMALL):
            return (
                "the torques of the logs have little to do with the motion, or the model does not fit: on the end of "
                f"the logs the torque errors are {100 * after:.3g} % of the torques after the fit, {100 * before:.3g} "
                "% before it (root mean squares, the median of the joints)"
            )
    fit = estimate.fit
    free = np.asarray(np.linalg.lstsq(fit.normal.matrix, fit.normal.vector, rcond=1e-12)[0], dtype=float)
    ratio = float(np.sqrt(fit.normal.squares(fit.x) / max(fit.normal.squares(free), 1e-300)))
    if ratio < _PULLED:
        return ""
    return f"torque residuals are {ratio:.3g} times those of a fit that knows nothing of the robot's masses: {_FAR}"


def _check_length(logs: list[Log], fitted: _System, options: IdentifyOptions) -> None:
    """Refuse logs that are too short for a fit and its cross-validation.

    Args:
        logs: the logs.
        fitted: equations of their fitted parts.
        options: with the averaging time, the parts and the folds.
    """
    least, count = max(_LEAST_MEANS, 2 * options.fit.folds), len(fitted.joined[1])
    if count < least:
        seconds = sum(float(log.t[-1] - log.t[0]) for log in logs)
        raise LogError(
            f"{', '.join(log.name for log in logs)}: {seconds:.3g} s are too short: all but the last "
            f"{100 * options.held_out:g} % make {count} means over {1e3 * options.step:g} ms, and a fit takes {least} "
            "at least; several seconds of motion measure an arm"
        )


def _warnings(robot: Robot, estimate: Estimate, signals: list[Signals], options: IdentifyOptions) -> tuple[str, ...]:
    """Whether other inertias of the links explain the residuals of a fit that takes them from the robot."""
    equations, found = estimate.equations, estimate.fit
    (links,) = _systems(robot, "all", signals, signals, (equations.width,), options.step)
    whole = links.fit(replace(options.fit, weights=(found.weight,)))
    significant = found.noise > _SIGNIFICANT * equations.torque_limits
    parts = zip(robot.joint_names, whole.noise / found.noise, significant, strict=True)
    joints = ", ".join(f"{joint} to {100 * part:.0f} %" for joint, part, own in parts if own and part < _EXPLAINED)
    warning = f"the logs ask for other inertias of the links, with which torque residuals fall in {joints}"
    remedy = f"identify all links (what='all' instead of '{equations.what}')"
    return (f"{warning}; the {equations.what} alone makes up for them: {remedy}",) if joints else ()


def _judged(robot: Robot, estimate: Estimate, signals: list[Signals], step: float) -> Judged:
    """Mean torques of parts of the logs, and their predictions."""

    def means(torque: Callable[[Signals], Array]) -> Array:
        return np.concatenate([means_of(torque(one), one.samples_in(step)) for one in signals])

    torque = means(lambda one: one.tau)
    return Judged(
        t=np.asarray(step * np.arange(len(torque)), dtype=float),
        torque=torque,
        prior=means(lambda one: inverse_dynamics(robot)(one.q, one.v, one.a)),
        fitted=means(lambda one: estimate.torques(one.q, one.v, one.a)),
    )


@dataclass(frozen=True, kw_only=True)
class _System:
    """The equations at the samples of the logs, for one width of Coulomb friction.

    Attributes:
        equations: with their width.
        logs: of each log the columns, shape (m, nv, p), and the torques, measured minus known [N m or N], (m, nv).
    """

    equations: Equations
    logs: tuple[tuple[Array, ...], ...]

    def begun(self, part: float) -> _System:
        """The equations of the first part of each log."""
        return replace(self, logs=tuple(tuple(one[: int(part * len(one))] for one in log) for log in self.logs))

    def fit(self, options: FitOptions) -> Fit:
        """The fit to the torques of all logs."""
        return fit(self.equations.unknowns, *self.joined, options)

    @property
    def joined(self) -> tuple[Array, Array]:
        """Columns and torques of all logs, one after the other."""
        columns, torque = map(np.concatenate, zip(*self.logs, strict=True))
        return columns, torque


def _systems(
    robot: Robot, what: What, first: list[Signals], signals: list[Signals], widths: Sequence[float | Array], step: float
) -> list[_System]:
    """One system per width that is tried; scales of unknown friction are of the first parts of the logs."""
    plain = Equations.of(robot, what, first, widths[0])
    every = [one.samples_in(step) for one in signals]
    parts = [plain.without_coulomb(one.q, one.v, one.a, k) for one, k in zip(signals, every, strict=True)]
    systems = []
    for width in widths:
        own = replace(plain, width=width)
        logs = []
        for one, k, part in zip(signals, every, parts, strict=True):
            columns, known = own.with_coulomb(means_of(one.smoothed(np.tanh(one.v / width)), k), *part)
            logs.append((columns, means_of(one.tau, k) - known))
        systems.append(_System(equations=own, logs=tuple(logs)))
    return systems


def _best(systems: list[_System]) -> _System:
    """The system with the most likely common width of Coulomb friction; a joint's own where it is far more likely.

    Another width is more likely than the true one by a factor k with a probability of 1 / k at most (Markov).
    """
    if len(systems) == 1:
        return systems[0]
    options = FitOptions(weights=FitOptions().weights[:1], rounds=2)  # a larger weight of the prior errs like a width
    fits = [one.fit(options) for one in systems]
    joined = [one.joined for one in systems]
    residual = np.array([torque - columns @ one.x for (columns, torque), one in zip(joined, fits, strict=True)])
    scaled = np.abs(residual) / np.min([one.noise for one in fits], axis=0)
    clipped = np.minimum(scaled, options.huber)
    loss = np.sum(clipped * (scaled - clipped / 2), axis=1)
    common = int(np.argmin(np.sum(loss, axis=1)))
    better = loss[common] - np.min(loss, axis=0) > np.log(loss.size / FALSE_ALARMS)
    return _joined([systems[k] for k in np.where(better, np.argmin(loss, axis=0), common)])


def _joined(systems: list[_System]) -> _System:
    """The system that has the equations of joint j from system j."""
    width = np.array([one.equations.width for one in systems])
    logs = tuple(
        tuple(np.stack([one[:, j] for j, one in enumerate(own)], axis=1) for own in zip(*log, strict=True))
        for log in zip(*(one.logs for one in systems), strict=True)
    )
    return _System(equations=replace(systems[0].equations, width=width), logs=logs)
