"""Logs on a model's steps: what is used, left out, noticed and refused."""

import re

import numpy as np
import pytest
from recordings import toy, toy_log

from dtcasadi.errors import IdentificationError, LogError
from dtcasadi.identify import Experiment, build
from dtcasadi.identify.data import gridded
from dtcasadi.identify.problem import wanted_of
from dtcasadi.logs import Log, parse_csv

X0, THETA = np.array([0.5, -0.3, 0.8]), np.array([0.7, -1.2])
DISCRETE = toy()
WANTED = wanted_of(DISCRETE, ("left", "right"))


def log_of(**changes) -> Log:
    """Ten steps of 0.1 s, some columns replaced."""
    log = toy_log(DISCRETE, THETA, X0, 10)
    channels = {name: column.copy() for name, column in log.channels.items()}
    t = changes.pop("t", log.t)
    for name, column in changes.items():
        channels[name.replace("__", ".")] = np.asarray(column, dtype=float)
    return Log(t, channels, dict.fromkeys(channels, ""), "my.csv")


def grid(log: Log, **known):
    return gridded(Experiment(log, **known), WANTED)


def test_a_plain_log_is_taken_as_it_is():
    log = log_of()
    data = grid(log)
    assert data.n == 10 and data.seen.all() and not data.notes
    np.testing.assert_array_equal(data.y[:, 2], log.channels["right.y0"])
    np.testing.assert_array_equal(data.u[:, 0], log.channels["command1"])
    assert np.all(np.isinf(data.sigma)) and not data.x0.any()


def test_rows_out_of_order_are_sorted_and_counted():
    log = log_of()
    order = np.array([0, 2, 1, 3, 6, 5, 4, 7, 8, 9, 10])
    mixed = Log(log.t[order], {n: c[order] for n, c in log.channels.items()}, log.units, "my.csv")
    data, plain = grid(mixed), grid(log)
    np.testing.assert_array_equal(data.y, plain.y)
    assert data.notes == ("3 rows behind later ones: sorted by time",)


def test_gaps_are_run_through_and_told():
    log = log_of()
    keep = np.r_[0:3, 9:11]
    gappy = Log(log.t[keep], {n: c[keep] for n, c in log.channels.items()}, log.units, "my.csv")
    data = grid(gappy)
    assert data.n == 10 and data.seen.sum() == 5
    # The command before the gap holds through it.
    assert np.all(data.u[2:9, 0] == log.channels["command1"][2])
    assert data.notes[0].startswith("1 gap, the longest 0.7 s (rows are 0.1 s apart)")


def test_rows_off_the_steps_are_told():
    t = log_of().t.copy()
    t[4] += 0.03
    assert grid(log_of(t=t)).notes[0].startswith("1 row up to 30 ms away from the step")


def test_of_two_readings_in_a_step_the_last_is_used_and_both_are_counted():
    t = log_of().t.copy()
    t[4] = t[5] - 0.01
    log = log_of(t=t)
    data = grid(log)
    assert data.y[5, 0] == log.channels["left.y0"][5] and np.isnan(data.y[4, 0])
    assert data.counts["left.y0"] == (10, 0, 1)
    assert any(note.startswith("3 readings left out for a later one") for note in data.notes)


def test_empty_cells_have_no_weight_and_commands_hold():
    column = np.arange(11.0)
    column[[0, 1, 5]] = np.nan
    left = np.full(11, np.nan)
    left[3] = 1.0
    data = grid(log_of(command1=column, left__y0=left))
    np.testing.assert_array_equal(data.u[:, 0], [2, 2, 2, 3, 4, 4, 6, 7, 8, 9, 10])
    assert data.counts["left.y0"] == (1, 10, 0)
    assert data.notes == (
        "cells without a reading, which weigh nothing: left.y0 10",
        "command1 starts 0.2 s late: its first one holds",
    )


def test_other_channels_and_dead_sensors_are_told():
    log = toy_log(DISCRETE, THETA, X0, 60)
    channels = {**log.channels, "nose.x": np.zeros(61), "right.y0": np.ones(61)}
    data = grid(Log(log.t, channels, dict.fromkeys(channels, ""), "my.csv"))
    assert "right.y0 never changes: is the sensor alive?" in data.notes
    assert "not used: nose.x" in data.notes


def test_a_log_without_some_sensors_serves():
    log = log_of()
    channels = {name: log.channels[name] for name in ("command1", "right.y0")}
    data = grid(Log(log.t, channels, log.units, "my.csv"))
    assert np.isnan(data.y[:, :2]).all() and data.seen.all() and "left.y0" not in data.counts


def test_commands_may_come_from_the_scene():
    log = log_of()
    channels = {name: c for name, c in log.channels.items() if name != "command1"}
    data = grid(Log(log.t, channels, log.units, "my.csv"), command=lambda t: np.array([2 * t]))
    # A scene's command is taken in the middle of each step.
    np.testing.assert_allclose(data.u[:, 0], 0.2 * np.arange(11) + 0.1)
    assert data.notes == ("no commands in the log: the scene's, from its t = 0",)


@pytest.mark.parametrize(
    ("log", "line"),
    [
        (log_of(t=np.zeros(11)), "my.csv: t: expected rows at different times, got one instant"),
        (log_of(t=1e6 * np.arange(11.0)), "my.csv: expected 1 to 1000000 steps of 0.1 s"),
        (log_of(t=1e-4 * np.arange(11.0)), "my.csv: expected 1 to 1000000 steps of 0.1 s"),
        (log_of(command1=np.full(11, np.nan)), "command1: expected numbers, got empty cells only"),
        (
            log_of(**dict.fromkeys(("left__y0", "left__y1", "right__y0"), np.full(11, np.nan))),
            "my.csv: expected readings, got empty cells only",
        ),
        (
            parse_csv(b"t [s],command1,left.y0\n0,1,2\n0.1,1,2\n", "my.csv"),
            "my.csv: left.y1: expected a channel beside left.y0",
        ),
        (
            parse_csv(b"t [s],command1,right.y0 [mm]\n0,1,2\n0.1,1,2\n", "my.csv"),
            "my.csv: right.y0: expected a unit of [], got [m]",
        ),
        (
            parse_csv(b"t [s],right.y0\n0,2\n0.1,2\n", "my.csv"),
            "my.csv: expected channels command1, got none",
        ),
    ],
)
def test_bad_logs_are_one_line(log, line):
    with pytest.raises(LogError, match=re.escape(line)):
        grid(log)


def test_a_log_of_other_sensors_is_refused():
    log = parse_csv(b"t [s],nose.x\n0,1\n1,2\n", "my.csv")
    line = "my.csv: expected channels of left.y0, left.y1, right.y0"
    with pytest.raises(LogError, match=re.escape(line)):
        build(DISCRETE, [Experiment(log)], ("a",))


@pytest.mark.parametrize(
    ("unit", "given", "good"),
    [
        ("Pa", "", True),
        ("Pa", "Pa", True),
        ("Pa", "m", False),
        ("", "Pa", False),
        (None, "m", True),
    ],
)
def test_commands_have_their_unit(unit, given, good):
    log = log_of()
    log = Log(log.t, log.channels, {**log.units, "command1": given}, "my.csv")
    wanted = WANTED._replace(command_unit=unit)
    if good:
        gridded(Experiment(log), wanted)
    else:
        with pytest.raises(LogError, match=r"my.csv: command1: expected .*unit.*, got \["):
            gridded(Experiment(log), wanted)


@pytest.mark.parametrize(
    ("known", "line"),
    [
        (
            {"x0": [1.0, 2.0]},
            "experiment: x0: expected finite numbers of shape (3), got shape (2,)",
        ),
        ({"sigma": [1.0, 2.0]}, "experiment: sigma: expected a number or 3 of them"),
        ({"sigma": -1.0}, "experiment: sigma: expected non-negative numbers"),
        ({"sigma": np.nan}, "experiment: sigma: expected non-negative numbers"),
        ({"sigma": "wide"}, "experiment: sigma: expected a number or 3 of them, got 'wide'"),
    ],
)
def test_bad_starts_are_one_line(known, line):
    with pytest.raises(IdentificationError, match=re.escape(line)):
        grid(log_of(), **known)


def test_things_that_are_no_logs_are_refused():
    with pytest.raises(IdentificationError, match="experiment: log: expected a Log, got 3"):
        Experiment(3)
    for experiments in ([], Experiment(log_of())):
        with pytest.raises(IdentificationError, match="experiments: expected a sequence of them"):
            build(DISCRETE, experiments, ("a",))
