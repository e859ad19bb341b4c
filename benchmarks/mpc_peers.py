"""do-mpc on the planar case of `dtcasadi bench mpc`: python benchmarks/mpc_peers.py.

The same equations of motion, horizon, weights, limits and filter; do-mpc transcribes them by its
default collocation and solves with IPOPT, as its users start. Needs `pip install do-mpc`.
"""

import argparse
import importlib.metadata
import json
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from dtcasadi.cli.bench_mpc import _filter_of
from dtcasadi.files import written
from ocp.baselines import Said
from ocp.bench import _EXACT, _baseline, _figures, _ms, _until, case_of, rti
from ocp.closed_loop import closed_loop
from ocp.scenario import Experiment, control_of

RESULT = Path(__file__).parent / "results" / "mpc_peers.json"
# Of the cost that is compared [s].
SPAN = 2.0


class DoMPC:
    """do-mpc's controller with the functions that `closed_loop` asks for."""

    def __init__(self, found: Experiment):
        """Build it."""
        import do_mpc

        self._s = s = found.stages
        n_r, n_theta = len(s.channels), len(s.discrete.theta0)
        model = do_mpc.model.Model("continuous", "MX")
        x = model.set_variable("_x", "x", (s.n_x, 1))
        u = model.set_variable("_u", "u", (s.n_u, 1))
        theta = model.set_variable("_tvp", "theta", (n_theta, 1))
        reference = model.set_variable("_tvp", "reference", (n_r, 1))
        model.set_rhs("x", s.discrete.ode(x, u, theta))
        model.setup()
        self._mpc = mpc = do_mpc.controller.MPC(model)
        quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}
        mpc.set_param(n_horizon=s.horizon, t_step=s.discrete.step_s, nlpsol_opts=quiet)
        r = s.residual(x, theta, reference)
        cost = ca.dot(ca.DM(s.weight[0]) * r, r)
        mpc.set_objective(mterm=cost, lterm=cost)
        # It counts changes in units of the scale.
        mpc.set_rterm(u=s.change[0] * s.upper[0] ** 2)
        mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = s.lower[0], s.upper[0]
        mpc.scaling["_u", "u"] = s.upper[0]
        # Angles and rates are of order one; what follows them are pressures.
        moving = sum(n.endswith("_rate") for n in s.discrete.state_names) * 2
        mpc.scaling["_x", "x"] = np.r_[np.ones(moving), np.resize(s.upper[0], s.n_x - moving)]
        self._theta, self._rows = s.discrete.theta0, s.references(0.0)
        template = mpc.get_tvp_template()

        def given(_: float) -> Any:
            for k in range(s.horizon + 1):
                template["_tvp", k, "theta"] = self._theta
                template["_tvp", k, "reference"] = self._rows[k]
            return template

        mpc.set_tvp_fun(given)
        mpc.setup()
        mpc.u0 = found.plant.u0
        self._first = True

    def step(self, estimate: Any, *, reference: Any = None) -> tuple[np.ndarray, Said]:
        """The next command; do-mpc has no rate limits, so changes are cut off."""
        s, mpc = self._s, self._mpc
        self._theta, self._rows = np.asarray(estimate.theta), np.asarray(reference)
        if self._first:
            mpc.x0 = np.asarray(estimate.x)
            mpc.set_initial_guess()
            self._first = False
            self._last = np.array(mpc.u0.cat).ravel()
        u = np.asarray(mpc.make_step(np.asarray(estimate.x).reshape(-1, 1))).ravel()
        u = np.clip(u, self._last - s.rate[0], self._last + s.rate[0])
        self._last = u = np.clip(u, s.lower[0], s.upper[0])
        plan = np.tile(u, (s.horizon, 1))
        return u, Said(plan, np.zeros((s.horizon + 1, s.n_x)), "do-mpc")


def main() -> None:
    """Run it beside the real-time iteration and IPOPT, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, default=RESULT)
    parser.add_argument("--t-end", type=float, default=16.0)
    options = parser.parse_args()
    case, exact = (case_of("planar", _filter_of, method=name) for name in (None, _EXACT))
    given = {
        "estimator": case.estimator,
        "measured": control_of(case.scene).measured,
        "t_end": options.t_end,
    }
    loops = {
        "do_mpc": closed_loop(DoMPC(case.found), case.found.plant, case.found.stages, **given),
        "rti": case.run(rti(case.found), options.t_end),
        "ipopt": _baseline(case, exact, "ipopt", SPAN),
    }
    converged = _until(loops["ipopt"], SPAN).cost
    baselines = {}
    for name, loop in loops.items():
        figures: dict[str, Any] = {
            "median_ms": float(np.median(_ms(loop))),
            "cost_over_converged": _until(loop, SPAN).cost / converged,
            "violations": loop.violations,
        }
        if float(loop.t[-1]) > 0.99 * case.scene.t_end:
            figures = _figures(case, loop, _ms(loop)) | figures
        baselines[name] = figures
    record = {
        "schema": 1,
        "do_mpc": importlib.metadata.version("do-mpc"),
        "converged_span_s": SPAN,
        "baselines": baselines,
    }
    text = json.dumps(record, indent=1)
    with written(options.json) as file:
        file.write(f"{text}\n".encode())
    print(text)


if __name__ == "__main__":
    main()
