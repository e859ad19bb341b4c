"""What filters made of a log, in figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import casadi as ca
import numpy as np

from dtcasadi.compile import bind
from dtcasadi.discrete import DiscreteModel
from dtcasadi.scene import Scene
from dtcasadi.sensors import Marker

from .runner import Track
from .truth import Truth

if TYPE_CHECKING:
    from dtcasadi.cli.common import Report


@dataclass(frozen=True, eq=False)
class Result:
    """A filter's run, for people.

    Attributes:
        title: the filter's name.
        discrete: its model.
        track: what it made of the log.
        tip: place of the scene's tip (`Tip`) in the root frame, shape (n, 3) [m].
        tip_sigma: standard deviation of each coordinate of it, shape (n, 3) [m].
        force: contact force in the root frame, shape (n, 3) [N].
        force_sigma: its standard deviation, shape (n, 3) [N].
    """

    title: str
    discrete: DiscreteModel
    track: Track
    tip: np.ndarray
    tip_sigma: np.ndarray
    force: np.ndarray
    force_sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class Tip:
    """What the errors of a scene are measured at: a marker on the last disc, or its centre.

    Attributes:
        point: in the disc's frame, shape (3,) [m].
        marker: name of the marker, or ''.
    """

    point: np.ndarray
    marker: str = ""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The tip of a scene."""
        for sensor in scene.sensors:
            if isinstance(sensor, Marker) and sensor.disc == scene.robot.n_discs:
                return cls(sensor.point, sensor.name)
        return cls(scene.robot.discs[-1].centre_of_mass)

    def places(self, discrete: DiscreteModel, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """The tip in the root frame at each row of x and theta, shape (n, 3) [m]."""
        slope = bind(self.slope(discrete))
        return np.array([slope(*row)[0] for row in zip(x, theta, strict=True)])

    def slope(self, discrete: DiscreteModel) -> ca.Function:
        """The tip and its derivative for x as a Function of x and theta."""
        model = discrete.model
        x, theta = ca.MX.sym("x", model.n_x), ca.MX.sym("theta", len(discrete.theta0))
        R, r = model.poses(x[: model.n_q], theta[: len(model.theta0)])
        place = r[:, -1] + ca.mtimes(R[:, -3:], ca.DM(self.point))
        return ca.Function("tip", [x, theta], [place, ca.densify(ca.jacobian(place, x))])


def result_of(title: str, tip: Tip, discrete: DiscreteModel, found: Track) -> Result:
    """Where the tip is and what pushes, with standard deviations."""
    n_x, block = len(discrete.state_names), discrete.theta_blocks["wrench"]
    slope, tips, sigmas = bind(tip.slope(discrete)), [], []
    for est in found.estimates:
        place, J = slope(est.x, est.theta)
        tips.append(place)
        sigmas.append(np.sqrt(np.einsum("ij,jk,ik->i", J, est.P[:n_x, :n_x], J)))
    force = np.array([est.theta[block][:3] for est in found.estimates])
    deviation = np.array([est.sigma[n_x : n_x + 3] for est in found.estimates])
    return Result(title, discrete, found, np.array(tips), np.array(sigmas), force, deviation)


def tip_errors(result: Result, tip: Tip, truth: Truth) -> np.ndarray:
    """Distance of estimated and true tip over the robot's length at every step, shape (n,)."""
    places = tip.places(truth.discrete, truth.x, truth.theta)
    return np.linalg.norm(result.tip - places, axis=1) / truth.discrete.model.robot.length


def figures(results: Mapping[str, Result], tip: Tip, truth: Truth | None, report: Report) -> None:
    """Say how the runs went; errors where the truth is known."""
    for name, result in results.items():
        _counts(name, result, report)
        if truth is not None:
            _errors(result, tip, truth, report)


def _counts(name: str, result: Result, report: Report) -> None:
    found, last = result.track, result.track.last
    report.section(name, result.title)
    report.line(
        "{steps} steps; readings skipped {skipped}, updates gated {gated}, samples too late "
        "{refused}, steps failed {failed}, re-centred {recentred} times",
        steps=len(found.t) - 1,
        skipped=last.skipped,
        gated=last.gated,
        refused=len(found.refused),
        failed=last.failed,
        recentred=last.recentred,
    )
    force = result.force.round(4)
    report.line(
        "contact force at the end: {force_N} N; from {force_least_N} to {force_most_N} N",
        force_N=force[-1].tolist(),
        force_least_N=force.min(axis=0).tolist(),
        force_most_N=force.max(axis=0).tolist(),
    )


def _errors(result: Result, tip: Tip, truth: Truth, report: Report) -> None:
    error = tip_errors(result, tip, truth)
    half = len(error) // 2
    report.line(
        "tip off by {start:.3g} of the length at the start, {rms:.3g} (root mean square) in the "
        "second half",
        start=error[0],
        rms=float(np.sqrt(np.mean(error[half:] ** 2))),
    )
    off = np.linalg.norm(result.force - truth.force, axis=1)
    report.line(
        "contact force off by {force_rms_N:.3g} N (root mean square) in the second half",
        force_rms_N=float(np.sqrt(np.mean(off[half:] ** 2))),
    )
