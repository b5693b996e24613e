"""The Bouc-Wen operator by a numba Runge-Kutta loop or by scipy's solve_ivp.

usage: bouc_wen.py numba|scipy SAMPLES REPS IN OUT D A B G PERIOD

h' = A u' - B |u'| h - G u' |h|, y = D u - h, one step a sample, the input's slope constant within it. solve_ivp (RK45, 1e-6
relative, 1e-9 absolute) is kept from stepping over samples, as the input has a kink at each.
"""
import sys

import numba
import numpy as np
from scipy.integrate import solve_ivp

from timing import read, repeat, report, write

form, samples, reps = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
u = read(sys.argv[4])[:samples]
d, a, b, g, period = (float(word) for word in sys.argv[6:11])


@numba.njit(cache=True)
def loop(u, d, a, b, g, period):
    y = np.empty_like(u)
    h = 0.0
    y[0] = d * u[0] - h
    for n in range(1, len(u)):
        v = (u[n] - u[n - 1]) / period
        w = abs(v)
        k1 = a * v - b * w * h - g * v * abs(h)
        x = h + 0.5 * period * k1
        k2 = a * v - b * w * x - g * v * abs(x)
        x = h + 0.5 * period * k2
        k3 = a * v - b * w * x - g * v * abs(x)
        x = h + period * k3
        k4 = a * v - b * w * x - g * v * abs(x)
        h += period / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        y[n] = d * u[n] - h
    return y


def adaptive():
    slope = np.diff(u) / period
    last = len(slope) - 1

    def right(t, h):
        v = slope[min(int(t / period), last)]
        return a * v - b * abs(v) * h - g * v * abs(h)

    times = period * np.arange(len(u))
    found = solve_ivp(right, (0.0, times[-1]), [0.0], t_eval=times, max_step=period, rtol=1e-6, atol=1e-9)
    return d * u - found.y[0]


work = (lambda: loop(u, d, a, b, g, period)) if form == "numba" else adaptive
if form == "numba":
    work()
cpu, wall, y = repeat(work, reps)
write(sys.argv[5], y)
report(cpu, wall, len(u))
