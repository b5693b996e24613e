"""Ferro's Preisach model (PyPI `ferro`, LandauFilm.calc_efe_preisach): a loop over its relays for each sample.

usage: preisach_ferro.py CELLS SAMPLES REPS IN OUT

The relays are those of our uniform plane from -1 to 1 with its diagonal. Ferro takes the direction of the input from a central
difference, so a random input is only followed when it comes from below and every sample is given twice; the check does that,
the timing does not (the work for a sample is the same).
"""
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from ferro import models  # noqa: E402

from timing import read, repeat, report, write  # noqa: E402

cells, samples, reps = (int(word) for word in sys.argv[1:4])
u = read(sys.argv[4])[:samples]
middle = [-1.0 + 2.0 * (i + 0.5) / cells for i in range(cells)]
film = models.LandauFilm(thickness=1.0, area=1.0, pr=1.0)
relays = [
    models.LandauDomain(film, (0.5 if i == j else 1.0) * 2.0 / cells**2,
                        (middle[i] - middle[j]) / 2.0, (middle[i] + middle[j]) / 2.0)
    for i in range(cells) for j in range(i + 1)
]
cpu, wall, _ = repeat(lambda: film.calc_efe_preisach(u, relays), reps)
twice = np.concatenate([[-2.0], u]).repeat(2)
write(sys.argv[5], film.calc_efe_preisach(twice, relays)[0][3::2])
report(cpu, wall, samples)
