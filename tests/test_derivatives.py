"""Derivatives by recursion (`dtcasadi.derivatives`) with every option, against AD of the model.

The functions differentiated here are themselves checked in test_equations.py.
"""

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.robots import coordinates

import dtcasadi as dtc

CHARTS = ("cardan", "paper")
OPTIONS = [
    {"velocity_terms": "paper"},
    {"velocity_terms": "none"},
    {"damping": "coordinate"},
    {"wrenches": (2, 3)},
    {"actuator": "regulator"},
    {"assembly": "graph"},
    {"assembly": "graph", "velocity_terms": "paper", "wrenches": (3,)},
]
ROUND_OFF = 1e-11  # a derivative takes a few times the operations of its function: 10 x 1e-12


def exact(function: ca.Function, arguments: tuple, ports: int) -> list[np.ndarray]:
    """Jacobians of the first output for the first ports, one direction at a time."""
    function = function.expand()  # the plain expression, without the derivative it carries
    values = numbers(function, *arguments)
    values = [values] if isinstance(values, np.ndarray) else list(values)
    forward = function.forward(1)
    blocks = []
    for port in range(ports):
        columns = []
        for direction in np.eye(len(arguments[port])):
            seeds = [np.zeros(np.shape(a)) for a in arguments]
            seeds[port] = direction
            columns.append(forward.call([ca.DM(v) for v in (*arguments, *values, *seeds)])[0])
        blocks.append(ca.horzcat(*columns).full())
    return blocks


@pytest.mark.parametrize("options", OPTIONS, ids=lambda o: "_".join(map(str, o.values())))
def test_options(rng, options):
    """Inverse dynamics, forward dynamics and the state equation."""
    model = dtc.build(cases.robot(3), chart=list(CHARTS), **options)
    q = coordinates(rng, CHARTS)
    qd, qdd, tau = rng.normal(size=(3, len(q)))
    pressure = rng.uniform(1.0, 5.0, model.n_u)
    theta = model.theta0.copy()
    if "wrench" in model.theta_blocks:
        block = model.theta_blocks["wrench"]
        theta[block] = rng.normal(size=block.stop - block.start)

    arguments = q, qd, qdd, pressure, theta
    value = numbers(model.inverse_dynamics_jacobian, *arguments)
    for mine, reference in zip(value, exact(model.inverse_dynamics, arguments, 2), strict=True):
        assert error(mine, reference) < ROUND_OFF

    arguments = q, qd, pressure, tau, theta
    qdd, *value = numbers(model.forward_dynamics_jacobian, *arguments)
    assert error(qdd, numbers(model.forward_dynamics, *arguments)) < ROUND_OFF
    references = exact(model.forward_dynamics, arguments, len(value))
    for mine, reference in zip(value, references, strict=True):
        # Both solve with M: cond(M), up to 1e4 here.
        assert error(mine.reshape(reference.shape), reference) < 1e-9
    if "actuator" in options or "assembly" in options:  # else the state equation adds nothing
        check_ode(model, q, qd, pressure, theta)


def check_ode(model, q, qd, pressure, theta) -> None:
    """Derivatives of the state equation for state and command."""
    x = np.concatenate([q, qd, pressure[: model.n_x - 2 * model.n_q]])
    command = pressure + 0.01  # away from the regulator's limits and corners
    xdot, *value = numbers(model.ode_jacobian, x, command, theta)
    assert error(xdot, numbers(model.ode, x, command, theta)) < ROUND_OFF
    for mine, reference in zip(value, exact(model.ode, (x, command, theta), 2), strict=True):
        assert error(mine, reference) < 1e-9


@pytest.mark.parametrize("assembly", ["flat", "graph"])
@pytest.mark.parametrize("name", ["ode", "forward_dynamics"])
def test_derivatives_carried_by_functions(rng, name, assembly):
    """What MX graphs that call them get, theta included, is the plain expression's derivative."""
    model = dtc.build(
        cases.robot(3),
        chart=list(CHARTS),
        assembly=assembly,
        parameters=["springs.stiffness", "discs[3].mass"],
        wrenches=[3],
        actuator="regulator",
    )
    function = model.function(name)
    sizes = [function.size1_in(port) for port in function.name_in()]
    arguments = [rng.normal(size=n) for n in sizes[:-1]] + [model.theta0]
    inner = [ca.MX.sym(f"v{i}", n) for i, n in enumerate(sizes)]
    value = function(*inner)
    outer = ca.Function("outer", inner, [ca.jacobian(value, port) for port in inner])
    assert any(f.name() == f"jac_{name}" for f in outer.find_functions())
    references = exact(function, tuple(arguments), len(sizes))
    allowed = [np.eye(n) for n in sizes]
    # Block `frames` is left out: only re-centring changes it.
    allowed[-1] = allowed[-1][:, model.theta_blocks["frames"].stop :]
    for mine, reference, directions in zip(outer(*arguments), references, allowed, strict=True):
        assert error(mine.full() @ directions, reference @ directions) < 1e-9  # cond(M)
