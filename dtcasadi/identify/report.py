"""The result of identification as text and as plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .result import Identified, Validation
    from .whiteness import ResidualTests


def text(found: Identified) -> str:
    """The result as lines."""
    return "\n".join(
        [
            f"{found.status}: {found.message}",
            "",
            *parameter_lines(found),
            *(f"  not told apart: {line}" for line in found.unidentifiable),
            "",
            *test_lines(found.tests),
            *(line for each in found.validation for line in ("", *validation_lines(each))),
            *(f"  note: {note}" for note in found.notes),
        ]
    )


def parameter_lines(found: Identified) -> list[str]:
    """A table of the parameters."""
    width = max(len("parameter"), *(len(name) for name in found.names))
    percent = f"{100 * found.level:g} % interval"
    lines = [f"  {'parameter':{width}} {'value':>12} {percent:>25} {'start':>10}  unit"]
    for k, name in enumerate(found.names):
        low, high = found.intervals[k]
        interval = "on its bound" if name in found.at_bound else f"{low:.5g} to {high:.5g}"
        lines.append(
            f"  {name:{width}} {found.values[k]:12.6g} {interval:>25} {found.starts[k]:10.4g}  "
            f"{found.units[k]}"
        )
    return lines


def test_lines(tests: ResidualTests) -> list[str]:
    """The residual tests."""
    if not tests.channels:
        return [f"  {finding}" for finding in tests.findings]
    lines = [f"  {'channel':16} {'readings':>8} {'rms':>10} {'/ noise':>8} {'p(white)':>9}  unit"]
    for each in tests.channels:
        lines.append(
            f"  {each.name:16} {each.n:>8} {each.rms:10.3g} {each.size:8.3f} {each.p_white:9.2g}  "
            f"{each.unit}"
        )
    lines.append(
        f"  chi-square {tests.chi_square:.6g} for {tests.freedom} degrees of freedom, chance of "
        f"more {tests.p_large:.2g}, of less {tests.p_small:.2g}"
    )
    return [*lines, *(f"  {finding}" for finding in tests.findings)]


def validation_lines(validation: Validation) -> list[str]:
    """Errors of the prediction of data left out."""
    lines = [
        f"  {validation.source}, left out ({validation.how}): errors {validation.size:.3g} times "
        "the noise"
    ]
    for each in validation.channels:
        lines.append(
            f"  {each.name:16} {each.n:>8} {each.rms:10.3g} {each.size:8.3f}  {each.unit}, fit "
            f"{each.fit:.1f} %"
        )
    return lines


def record(found: Identified) -> dict[str, Any]:
    """The result as plain values for JSON."""
    return {
        "status": found.status,
        "message": found.message,
        "level": found.level,
        "parameters": [
            {
                "name": name,
                "value": found.values[k],
                "unit": found.units[k],
                "interval": found.intervals[k],
                "sigma": found.sigma[k],
                "start": found.starts[k],
                "at_bound": name in found.at_bound,
            }
            for k, name in enumerate(found.names)
        ],
        "covariance": found.covariance,
        "correlation": found.correlation,
        "unidentifiable": list(found.unidentifiable),
        "tests": {
            "passed": found.tests.passed,
            "chi_square": found.tests.chi_square,
            "freedom": found.tests.freedom,
            "p_large": found.tests.p_large,
            "p_small": found.tests.p_small,
            "findings": list(found.tests.findings),
            "channels": [each._asdict() for each in found.tests.channels],
        },
        "validation": [
            each._asdict() | {"channels": [channel._asdict() for channel in each.channels]}
            for each in found.validation
        ],
        "iterations": found.iterations,
        "cost": found.cost,
        "x0": list(found.x0),
        "step_error": found.step_error,
        "notes": list(found.notes),
        "build_s": found.build_s,
        "solve_s": found.solve_s,
    }
