"""Runs one by one with `dtcasadi.simulate`, adaptive or not."""

from collections.abc import Sequence

import numpy as np

from ..batch import Batch, batch
from ..errors import DtcasadiError
from ..result import Run
from ..simulate import simulate
from .columns import DONE, FAILED, outcomes
from .probe import probe_of
from .targets import Rows, Setup

# Instants that are looked at, evenly spread over the run.
INSTANTS = 201


class Single:
    """Engine of runs with the scene's own method and tolerances."""

    def __init__(self, setup: Setup, save: Sequence[tuple[str, str]]):
        self.setup, self.save = setup, save
        self.probe = probe_of(setup.model, [name for name, _ in save])
        self.look: Batch = batch(self.probe.function)

    def run(self, inputs: np.ndarray) -> dict[str, np.ndarray]:
        """See `Engine`."""
        rows = self.setup.rows(inputs)
        parts = [self._one(rows, k) for k in range(len(inputs))]
        columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return columns

    def _one(self, rows: Rows, k: int) -> dict[str, np.ndarray]:
        scene, model = self.setup.scene, self.setup.model
        reason, run = rows.faults[k], None
        x, theta = rows.x0[:, k], rows.theta[:, k]
        if not reason:
            profile = self.setup.profile(rows, k)
            try:
                run = simulate(
                    model,
                    x,
                    u=profile,
                    t_end=scene.t_end,
                    theta=theta,
                    method=scene.method,
                    rtol=scene.rtol,
                    atol=scene.atol,
                    step_s=scene.step_s,
                    fixed=scene.fixed,
                )
                reason = "" if run.success else run.message
            except DtcasadiError as error:
                reason = " ".join(str(error).split())
        seen, work = self._seen(run) if run else self._start(x, theta)
        with np.errstate(all="ignore"):
            columns = outcomes(seen, work, self.save)
        columns["t_reached"] = np.array([run.t[-1] if run else 0.0])
        columns["status"] = np.array([FAILED if reason else DONE], dtype=np.int8)
        columns["reason"] = np.array([reason], dtype=str)
        return columns

    def _seen(self, run: Run) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """The run at even instants, its energies at those of its own balance."""
        even = run.at(np.linspace(run.t[0], run.t[-1], INSTANTS))
        if run.model is not self.setup.model:
            values = batch(probe_of(run.model, [name for name, _ in self.save]).function)
        else:
            values = self.look
        found = values(even.x, even.u, even.thetas)[:, :, np.newaxis]
        seen = self.probe.split(found)
        energy = {name: value[:, np.newaxis] for name, value in run.energy.items()}
        for name in ("kinetic", "potential", "stored"):
            seen[name] = energy[name][np.newaxis]
        return seen, {name: energy[name] for name in ("supplied", "dissipated")}

    def _start(
        self, x: np.ndarray, theta: np.ndarray
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """What is seen of a run that never started: its first state."""
        model = self.setup.model
        instants = np.repeat(x[:, np.newaxis], INSTANTS, axis=1)
        found = self.look(instants, np.zeros(model.n_u), theta)[:, :, np.newaxis]
        nothing = np.zeros((INSTANTS, 1))
        return self.probe.split(found), {"supplied": nothing, "dissipated": nothing}
