"""A fixed step with its share of the energy balance, as one Function for many robots at once."""

from collections.abc import Callable, Sequence

import casadi as ca

from .. import functions
from ..graphs import Graphs
from ..health import NODES, WEIGHTS
from ..integrators.dense import cubic, quintic, slopes
from ..integrators.explicit import Explicit
from ..integrators.package import SLACK_MAX
from ..integrators.step import At, OneStep, Plant
from ..integrators.steppers import plant_of, step_function, symbols

# Squares of states above this overflow soon; a state that is not finite fails the same comparison.
_HUGE = 1e300


def advance_function(method: OneStep, g: Graphs, limited: Sequence[int]) -> ca.Function:
    """x, rates, u, du, h, theta -> x_next, rates_next, status, work, peak.

    Work (supplied, dissipated) is integrated by three Gauss nodes on the quintic between the ends,
    as in `health`; peak is the largest of the angles in entries `limited` of x.
    """
    plant = plant_of(g)
    at = symbols(plant)
    rates = plant.kind.sym("rates", *at.x.shape)
    if isinstance(method, Explicit) and plant.projection is None:
        x_next, slack = method.following(plant, at, rates).x_next, at.zeros(1)
    else:
        x_next, _, slack = step_function(method, plant)(*at)
    rates_next = plant.ode(x_next, at.u + at.h * at.du, at.theta)
    power, work = functions.power(g), at.zeros(2)
    ends = (at.x, rates), (x_next, rates_next)
    between = _between(plant, at.h, *ends)
    for node, weight in zip(NODES.tolist(), WEIGHTS.tolist(), strict=True):
        supplied, dissipated, _ = power(between(node), at.u + node * at.h * at.du, at.theta)
        work = work + at.h * weight * ca.vertcat(supplied, dissipated)
    good = (ca.sumsqr(x_next) <= _HUGE) * (slack <= SLACK_MAX)
    outputs = {
        "x_next": x_next,
        "rates_next": rates_next,
        "status": 1 - good,
        "work": work,
        "peak": _largest([at.zeros(1), *(ca.fabs(x_next[k]) for k in limited)]),
    }
    return ca.Function(
        f"advance_{method.name}",
        [at.x, rates, *at[1:]],
        [ca.densify(value) for value in outputs.values()],
        ["x", "rates", *At._fields[1:]],
        list(outputs),
        {"cse": True},
    )


def _between(
    plant: Plant, h: ca.MX, start: tuple[ca.MX, ca.MX], end: tuple[ca.MX, ca.MX]
) -> Callable[[float], ca.MX]:
    """States inside a step from (x, xdot) at its ends, as `integrators.dense` has them."""
    places = plant.sizes
    (q0, v0, z0), (q1, v1, z1) = (ca.vertsplit(x, places) for x, _ in (start, end))
    (_, a0, d0), (_, a1, d1) = (ca.vertsplit(rates, places) for _, rates in (start, end))
    curve = quintic(q0, h * v0, h**2 * a0, q1, h * v1, h**2 * a1)
    line = cubic(z0, h * d0, z1, h * d1)

    def at(s: float) -> ca.MX:
        q, slope, z = (
            sum(c * s**k for k, c in enumerate(each)) for each in (curve, slopes(curve), line)
        )
        return ca.vertcat(q, slope / h, z)

    return at


def repeated(advance: ca.Function, times: int) -> ca.Function:
    """The same ports over several steps: the last state, statuses and work added, highest peak."""
    x, rates, u, du, h, theta = (ca.MX.sym(n, advance.size1_in(n)) for n in advance.name_in())
    ports = [x, rates, u, du, h, theta]
    statuses, works, peaks = [], [], []
    for k in range(times):
        x, rates, status, work, peak = advance(x, rates, u + k * h * du, du, h, theta)
        statuses.append(status)
        works.append(work)
        peaks.append(peak)
    outputs = [x, rates, sum(statuses), sum(works), _largest(peaks)]
    name = f"{advance.name()}_{times}"
    return ca.Function(name, ports, outputs, advance.name_in(), advance.name_out())


def _largest(values: list[ca.MX]) -> ca.MX:
    result = values[0]
    for value in values[1:]:
        result = ca.fmax(result, value)
    return result
