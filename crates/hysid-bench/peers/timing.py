"""Shared parts of the scripts in this folder: timing, plain files of doubles, and the JSON object that each prints last."""
import json
import os
import resource
import time

import numpy as np


def read(path):
    return np.fromfile(path, dtype="<f8")


def write(path, values):
    np.ascontiguousarray(values, dtype="<f8").tofile(path)


def repeat(work, reps):
    """CPU and wall seconds of each repetition, and the last result."""
    cpu, wall, result = [], [], None
    for _ in range(reps):
        began, cpu_began = time.perf_counter(), time.process_time()
        result = work()
        cpu.append(time.process_time() - cpu_began)
        wall.append(time.perf_counter() - began)
    return cpu, wall, result


def report(cpu, wall, samples, **more):
    """Prints the object; `samples` is what one repetition went through."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"cpu_s": cpu, "wall_s": wall, "samples": samples, "peak_rss_mib": peak,
                      "loadavg": os.getloadavg()[0], **more}))
