"""What the scripts of all peers share: sizes of the nine cases, timing, output.

Each script prints one JSON line per case: {"case": name, "entities": n, "seconds": best of several passes}. A pass
brings an allocated sparse matrix from any values to the tangent at a state; what a peer allocates again each time is
part of its time. One thread; processor time, which other programs on the machine disturb least.
"""

import json
import time

TETS, FEW_TETS, HEXES, FAULT, TRIANGLES = (20, 20, 20), (12, 12, 12), (24, 24, 24), (2, 64, 64), (300, 300)
LAMBDA, MU = 1e4, 1e4
NEO_LAMBDA, NEO_MU = 120.0, 80.0
GAMMA = 1e5
PASS_SECONDS = 0.5


def measure(case, entities, assemble):
    """Best time of `assemble` within about PASS_SECONDS, at least one pass after the first."""
    assemble()
    best, start, passes = float("inf"), time.process_time(), 0
    while passes < 1 or time.process_time() - start < PASS_SECONDS:
        begin = time.process_time()
        assemble()
        best, passes = min(best, time.process_time() - begin), passes + 1
    print(json.dumps({"case": case, "entities": entities, "seconds": best}), flush=True)


def refuse(case, error):
    """A case this peer could not run."""
    print(json.dumps({"case": case, "refused": f"{type(error).__name__}: {error}"[:200]}), flush=True)


def run(cases):
    """Runs `(name, function)` pairs; one that fails does not stop the others."""
    for name, function in cases:
        try:
            measure(name, *function())
        except Exception as error:  # noqa: BLE001 - whatever a peer throws is part of the result
            refuse(name, error)
