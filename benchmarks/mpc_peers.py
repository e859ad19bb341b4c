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
from ocp.baselines import Said
from ocp.bench import _figures, case_of, replace_span
from ocp.closed_loop import closed_loop
from ocp.scenario import Experiment, control_of

RESULT = Path(__file__).parent / "results" / "mpc_peers.json"


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
        mpc.set_rterm(u=s.change[0])
        mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = s.lower[0], s.upper[0]
        mpc.scaling["_u", "u"] = s.upper[0]
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
    """Run it and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, default=RESULT)
    parser.add_argument("--t-end", type=float, default=16.0)
    options = parser.parse_args()
    case = case_of("planar", _filter_of)
    loop = closed_loop(
        DoMPC(case.found),
        case.found.plant,
        case.found.stages,
        t_end=options.t_end,
        estimator=case.estimator,
        measured=control_of(case.scene).measured,
    )
    figures: dict[str, Any] = {}
    if options.t_end >= case.scene.t_end:
        figures = _figures(case, loop, 1e3 * loop.seconds[1:])
    figures |= {
        "median_ms": 1e3 * float(np.median(loop.seconds[1:])),
        "cost_2_s": replace_span(loop, loop.t <= 2.0 + 1e-9).cost,
        "violations": loop.violations,
    }
    record = {
        "schema": 1,
        "do_mpc": importlib.metadata.version("do-mpc"),
        "baselines": {"do_mpc": figures},
    }
    options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
