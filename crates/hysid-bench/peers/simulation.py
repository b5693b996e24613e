"""The oscillator with dry friction of ../models/friction.sim.toml, by numba loops or by scipy's solve_ivp.

usage: simulation.py plain|batch|sticking|scipy STEPS SAMPLES REPS MODEL IN OUT

plain: Runge-Kutta steps with sign(v) as it stands, the least that a loop can do; batch: 32 parameter sets one after the other;
sticking: the step in which v changes its sign is cut there, and the mass rests while the force is below F_c, as in ours.
scipy: RK45 with its default tolerances, kept from stepping over samples.
"""
import sys
import tomllib

import numba
import numpy as np
from scipy.integrate import solve_ivp

from timing import read, repeat, report, write

form, steps, samples, reps = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
with open(sys.argv[5], "rb") as file:
    model = tomllib.load(file)
u = read(sys.argv[6])[:samples]
period = model["time"]["period_s"]
theta = np.array([model["parameters"][name]["value"] for name in ("m", "c", "k", "F_c")])


@numba.njit(cache=True)
def pull(x, v, u, m, c, k, friction):
    return (u - c * v - k * x - friction) / m


@numba.njit(cache=True)
def step(x, v, u0, slope, t, h, theta, direction, free):
    """One step from (x, v); friction follows sign(v) where `free`, else it keeps `direction`."""
    m, c, k, f = theta[0], theta[1], theta[2], theta[3]
    a = u0 + slope * t
    b = u0 + slope * (t + 0.5 * h)
    e = u0 + slope * (t + h)
    v1 = v
    k1 = pull(x, v1, a, m, c, k, f * (np.sign(v1) if free else direction))
    v2 = v + 0.5 * h * k1
    k2 = pull(x + 0.5 * h * v1, v2, b, m, c, k, f * (np.sign(v2) if free else direction))
    v3 = v + 0.5 * h * k2
    k3 = pull(x + 0.5 * h * v2, v3, b, m, c, k, f * (np.sign(v3) if free else direction))
    v4 = v + h * k3
    k4 = pull(x + h * v3, v4, e, m, c, k, f * (np.sign(v4) if free else direction))
    return x + h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@numba.njit(cache=True)
def plain(u, period, steps, theta, out):
    h = period / steps
    x = v = 0.0
    for n in range(len(u)):
        out[n] = x
        slope = (u[n + 1] - u[n]) / period if n + 1 < len(u) else 0.0
        for s in range(steps):
            x, v = step(x, v, u[n], slope, s * h, h, theta, 0.0, True)
    return out


@numba.njit(cache=True)
def batch(u, period, steps, sets, out):
    for i in range(len(sets)):
        plain(u, period, steps, sets[i], out[i])
    return out


@numba.njit(cache=True)
def sticking(u, period, steps, theta, out):
    whole = period / steps
    k, f = theta[2], theta[3]
    x = v = direction = 0.0
    for n in range(len(u)):
        out[n] = x
        slope = (u[n + 1] - u[n]) / period if n + 1 < len(u) else 0.0
        for s in range(steps):
            t, left = s * whole, whole
            for _ in range(12):
                if direction == 0.0:
                    # At rest until the force at the end of the step is above the friction.
                    over = u[n] + slope * (t + left) - k * x
                    if abs(over) <= f:
                        break
                    # The moment at which it gets there.
                    begin = u[n] + slope * t - k * x
                    share = 0.0
                    if abs(begin) < f and over != begin:
                        share = (np.sign(over) * f - begin) / (over - begin)
                    t, left = t + share * left, (1.0 - share) * left
                    direction = np.sign(over)
                x1, v1 = step(x, v, u[n], slope, t, left, theta, direction, False)
                if v1 * direction >= 0.0:
                    x, v = x1, v1
                    break
                # The velocity changes its sign within: cut the step there (secant, then one correction).
                low, v_low, high, v_high = 0.0, v, left, v1
                at = left
                for _ in range(8):
                    at = low + (high - low) * v_low / (v_low - v_high)
                    x1, v1 = step(x, v, u[n], slope, t, at, theta, direction, False)
                    if abs(v1) < 1e-9:
                        break
                    if v1 * direction > 0.0:
                        low, v_low = at, v1
                    else:
                        high, v_high = at, v1
                x, v, t, left = x1, 0.0, t + at, left - at
                over = u[n] + slope * t - k * x
                direction = np.sign(over) if abs(over) > f else 0.0
    return out


def adaptive():
    m, c, k, f = theta
    times = period * np.arange(len(u))

    def right(t, z):
        return [z[1], (np.interp(t, times, u) - c * z[1] - k * z[0] - f * np.sign(z[1])) / m]

    return solve_ivp(right, (0.0, times[-1]), [0.0, 0.0], t_eval=times, max_step=period).y[0]


out = np.zeros(len(u))
runs = 1
if form == "batch":
    runs = 32
    sets = np.array([theta * (1.0 + 0.01 * i) for i in range(runs)])
    many = np.zeros((runs, len(u)))
    work = lambda: batch(u, period, steps, sets, many)
elif form == "scipy":
    work = adaptive
else:
    work = lambda: (plain if form == "plain" else sticking)(u, period, steps, theta, out)
if form != "scipy":
    work()
cpu, wall, y = repeat(work, reps)
write(sys.argv[7], y[0] if form == "batch" else y)
report(cpu, wall, runs * len(u))
