"""Order of convergence, by the slope of the error over the step size, in the compiled loop."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_tools import METHODS, System, fixed_steps, kepler, linear, run_all
from scipy.linalg import expm

from chimera_hpc.integrate.lanes import Control

methods = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
ECCENTRICITY = 0.3
# Numbers of steps: enough to leave the first error term alone, too few to reach rounding.
MANY = [96, 112, 128, 144, 160, 192, 224, 256]
SOME = [56, 64, 72, 80, 88, 96, 112, 128]


def linear_problem():
    """Random 4 x 4 system that turns and decays, its start and its exact solution."""
    random = np.random.default_rng(7)
    matrix = random.normal(size=(4, 4)) - 0.5 * np.eye(4)
    y0 = random.normal(size=4)
    system = System(linear, matrix.ravel(), 4, np.array([4]))
    return system, y0, lambda t: np.array([expm(matrix * at) @ y0 for at in t]).T


def kepler_problem():
    """An ellipse from its nearest point; the exact solution by Kepler's equation."""
    e = ECCENTRICITY
    y0 = np.array([1.0 - e, 0.0, 0.0, np.sqrt((1.0 + e) / (1.0 - e))])

    def exact(t):
        t = np.asarray(t)
        anomaly = t.copy()
        for _ in range(50):
            anomaly -= (anomaly - e * np.sin(anomaly) - t) / (1.0 - e * np.cos(anomaly))
        c, s, r = np.cos(anomaly), np.sin(anomaly), 1.0 - e * np.cos(anomaly)
        b = np.sqrt(1.0 - e * e)
        return np.array([c - e, b * s, -s / r, b * c / r])

    return System(kepler, np.ones(1), 4), y0, exact


PROBLEMS = {"linear": (linear_problem(), 2.0), "kepler": (kepler_problem(), 3.0)}
problems = pytest.mark.parametrize("name", PROBLEMS)


def counts_of(name, method):
    """Numbers of steps that show the order of a method on a problem."""
    return MANY if name == "kepler" else SOME


def slope(counts, errors):
    """Exponent of the step size in the error."""
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0]


@methods
@problems
def test_solution_converges_with_its_order(method, name):
    (system, y0, exact), t_end = PROBLEMS[name]
    counts = counts_of(name, method)
    ends, _ = fixed_steps(system, y0, counts, t_end, method)
    errors = np.abs(ends - exact([t_end])).max(axis=0)
    assert slope(counts, errors) == pytest.approx(method.order, abs=0.2)


@methods
@problems
def test_samples_inside_the_steps_converge_with_the_order_of_the_interpolant(method, name):
    # An interpolant of order q is wrong by h**(q + 1) inside a step.
    (system, y0, exact), t_end = PROBLEMS[name]
    counts, sampling = counts_of(name, method), t_end / 997
    _, samples = fixed_steps(system, y0, counts, t_end, method, sampling)
    times = Control(t_end, 0.0, sampling).times
    errors = np.abs(samples - exact(times)).max(axis=(1, 2))
    order = min(method.order, method.interpolant_order + 1)
    assert slope(counts, errors) == pytest.approx(order, abs=0.2)


@methods
@problems
def test_error_follows_the_tolerance(method, name):
    (system, y0, exact), t_end = PROBLEMS[name]
    tolerances = 10.0 ** -np.arange(3, 12)
    errors = []
    for tolerance in tolerances:
        control = Control(t_end, 0.0, 0.01, rtol=tolerance, atol=tolerance, method=method)
        (run,) = run_all([system], [y0], control)
        assert run.outcome.n_sampled == control.n_samples
        errors.append(np.abs(run.samples - exact(control.times)).max())
    assert (np.array(errors) < 20 * tolerances).all()
    assert (np.array(errors) > 1e-3 * tolerances).all()
