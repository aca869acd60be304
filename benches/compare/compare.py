#!/usr/bin/env python3
"""Assembly and the fault benchmark against other programs, run A B A B on one machine; writes results.md beside itself.
With --solve, whole problems against DOLFINx with PETSc and NGSolve; writes solve.md.

    python3 benches/compare/compare.py [--solve] [--rounds 3] [--folder DIR] [--only PEER ...] [--built]

Peers are installed into DIR (default: a temporary folder that is removed): NGSolve, scikit-fem and DOLFINx from wheels,
GetFEM from the packages of a Debian-like system, unpacked without installing. A peer that cannot be installed or run
stands in the table with the reason. Figures are medians over the rounds of processor time on one thread, which other
programs on the machine disturb least; of two threads of WFL the time of the busier one counts.
"""

import argparse
import datetime
import json
import os
import pathlib
import platform
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
GETFEM_PACKAGES = """libgetfem5 python3-getfem libmumps-seq-5.5 libscotch-7.0 libqhull8.0 libsuperlu5 libgfortran5
libopenblas0-pthread liblapack3 libblas3 liblbfgsb0 python3-numpy python3-scipy python3-decorator""".split()
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


def call(*words, **options):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        lines = (done.stderr or done.stdout).strip().splitlines()
        raise RuntimeError(lines[-1] if lines else f"exit code {done.returncode}")
    return done.stdout


def newest_python():
    """DOLFINx wheels need Python 3.12 or later."""
    names = [shutil.which(f"python3.{minor}") for minor in (13, 12)]
    pyenv = sorted(pathlib.Path.home().glob(".pyenv/versions/3.1[23]*/bin/python"))
    return next((str(n) for n in [*names, *pyenv] if n and runs(n)), sys.executable)


def runs(python):
    """A name on the path may be one that a version manager refuses to run."""
    try:
        call(python, "-c", "")
    except (RuntimeError, OSError):
        return False
    return True


class Wheel:
    """A peer from the package index, in a virtual environment of its own."""

    def __init__(self, name, script, packages, version):
        self.name, self.script, self.packages, self.version = name, script, packages, version

    def install(self, folder):
        self.home = folder / self.name
        if not self.home.exists():
            call(newest_python(), "-m", "venv", self.home)
            call(self.home / "bin/pip", "install", "-q", *self.packages)
        self.python = self.home / "bin/python"
        self.environment = {"LD_LIBRARY_PATH": str(self.home / "lib")}
        return call(self.python, "-c", self.version, env={**os.environ, **self.environment}).strip().splitlines()[-1]


class Packages:
    """GetFEM: its python interface exists as a package of the system only."""

    name, script = "GetFEM", "getfem_cases.py"

    def install(self, folder):
        self.home = folder / self.name
        root = self.home / "root"
        if not root.exists():
            self.home.mkdir(parents=True)
            call("apt-get", "download", *GETFEM_PACKAGES, cwd=self.home)
            for package in self.home.glob("*.deb"):
                call("dpkg-deb", "-x", package, root)
        libraries = root / f"usr/lib/{platform.machine()}-linux-gnu"
        self.python = "/usr/bin/python3"
        self.environment = {
            "LD_LIBRARY_PATH": f"{libraries}:{libraries / 'openblas-pthread'}",
            "PYTHONPATH": str(root / "usr/lib/python3/dist-packages"),
        }
        versions = [p.name.split("_")[1] for p in self.home.glob("libgetfem5_*.deb")]
        return versions[0] if versions else "?"


PEERS = [
    Packages(),
    Wheel("NGSolve", "ngsolve_cases.py", ["ngsolve"], "import ngsolve; print(ngsolve.__version__)"),
    Wheel(
        "DOLFINx",
        "dolfinx_cases.py",
        ["dolfinx-solver-real", "mpich", "cffi", "setuptools", "numpy"],
        "import dolfinx; print(dolfinx.__version__)",
    ),
    Wheel("scikit-fem", "skfem_cases.py", ["scikit-fem"], "import skfem; print(skfem.__version__)"),
]


def run_peer(peer, *words):
    environment = {**os.environ, **ONE_THREAD, **peer.environment}
    text = call(peer.python, HERE / "peers" / peer.script, *words, env=environment, cwd=HERE / "peers")
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def build_wfl():
    """Builds the command and the benchmark."""
    call("cargo", "build", "--release", "-p", "wfl-cli", cwd=ROOT)
    call("cargo", "bench", "-p", "wfl-run", "--bench", "assembly", "--no-run", cwd=ROOT)


def built_bench():
    """The benchmark built last."""
    found = [p for p in (ROOT / "target/release/deps").glob("assembly-*") if os.access(p, os.X_OK)]
    return max(found, key=lambda p: p.stat().st_mtime)


def run_wfl(bench):
    """Cases of the table: name, thousand entities per second on one and two threads."""
    text = call(bench, "--bench", "--table", cwd=ROOT)
    rows = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return {row[0]: (float(row[1]), float(row[4])) for row in rows[2:]}


def fault_wfl(folder):
    """Processor time of the whole command: reading, compiling, solving, writing."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    scene = ROOT / "examples/fault/nitsche.wfl"
    call(ROOT / "target/release/wfl", "run", "-q", "--threads", "1", scene, "--out", folder / "fault", cwd=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def measure(bench, peers, rounds, folder):
    speeds, refused, faults = {}, {}, {"WFL": [], "GetFEM": []}
    for turn in range(rounds):
        for case, (one, two) in run_wfl(bench).items():
            speeds.setdefault(("WFL", case), []).append(one)
            speeds.setdefault(("WFL, 2 threads", case), []).append(two)
        faults["WFL"].append(fault_wfl(folder))
        for peer in peers:
            print(f"round {turn + 1}: {peer.name}", file=sys.stderr)
            for row in run_peer(peer):
                if "refused" in row:
                    refused[peer.name, row["case"]] = row["refused"]
                else:
                    speed = row["entities"] / row["seconds"] / 1000
                    speeds.setdefault((peer.name, row["case"]), []).append(speed)
            if peer.name == "GetFEM":
                faults["GetFEM"] += [row["seconds"] for row in run_peer(peer, "fault")]
    return {key: statistics.median(list_) for key, list_ in speeds.items()}, refused, faults


# scene, options of WFL, case and size of the peers, solvers by peer
SOLVES = [
    ("neo-Hookean cube, P2, 12 cells, 4 steps", "cube", ["cells=[12,12,12]"], "cube", 12,
     {"DOLFINx": ["mumps"], "NGSolve": ["cholesky"]}),
    ("elastic block, P2, 16 cells", "block", ["cells=[16,16,16]"], "block P2", 16,
     {"DOLFINx": ["gamg", "mumps"], "NGSolve": ["cholesky", "bddc"]}),
    ("elastic block, P2, 24 cells", "block", ["cells=[24,24,24]"], "block P2", 24, {"DOLFINx": ["gamg"]}),
    ("elastic block, P1, 40 cells", "block", ["cells=[40,40,40]", "degree=1"], "block P1", 40, {"DOLFINx": ["gamg"]}),
    ("Stokes flow, Taylor-Hood, 128 x 64 cells", "stokes", ["cells=[128,64]"], "stokes", 64,
     {"DOLFINx": ["mumps"], "NGSolve": ["lu"]}),
    ("heat, 64 x 64 cells, 1000 steps", "heat", ["cells=[64,64]"], "heat", 64,
     {"DOLFINx": ["mumps"], "NGSolve": ["cholesky"]}),
]  # fmt: skip
SOLVERS = {"mumps": "MUMPS", "gamg": "CG + GAMG", "cholesky": "its Cholesky", "lu": "UMFPACK", "bddc": "CG + BDDC"}
PEAK = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True); " \
    "u = resource.getrusage(resource.RUSAGE_CHILDREN); print(u.ru_utime + u.ru_stime, u.ru_maxrss * 1024)"


def solve_wfl(scene, words, folder):
    """Processor time and peak memory of the whole command, files included; the measure of the scene."""
    words = ["run", "-q", "--threads", "1", HERE / f"scenes/{scene}.wfl", *words, "--out", folder / scene]
    wfl = ROOT / "target/release/wfl"
    seconds, peak = call(sys.executable, "-c", PEAK, wfl, *words, cwd=folder).split()[-2:]
    report = json.loads((folder / scene / "report.json").read_text())
    step = report["steps"][-1]
    return {"seconds": float(seconds), "peak": float(peak), "value": step["measures"]["value"]}


def solve_peer(peer, case, size, solver):
    """Processor time, peak memory and measure of one run of a peer."""
    environment = {**os.environ, **ONE_THREAD, **peer.environment}
    script = HERE / f"peers/{peer.name.lower()}_solve.py"
    text = call(peer.python, script, case, size, solver, env=environment, cwd=HERE / "peers")
    return json.loads(text.splitlines()[-1])


def solves(peers, rounds, folder):
    """Rows of whole problems: name, then by program the medians of the rounds, run in turn."""
    rows = []
    for name, scene, words, case, size, solvers in SOLVES:
        others = [(peer, solver) for peer in peers for solver in solvers.get(peer.name, [])]
        runs = {"WFL": []} | {f"{peer.name}, {SOLVERS[solver]}": [] for peer, solver in others}
        for turn in range(rounds):
            print(f"round {turn + 1}: {name}", file=sys.stderr)
            runs["WFL"].append(solve_wfl(scene, words, folder))
            for peer, solver in others:
                runs[f"{peer.name}, {SOLVERS[solver]}"].append(solve_peer(peer, case, size, solver))
        middle = lambda list_, key: statistics.median(row[key] for row in list_)  # noqa: E731
        rows.append((name, {k: {key: middle(v, key) for key in ("seconds", "peak", "value")} for k, v in runs.items()}))
    return rows


def solve_page(versions, absent, rows, rounds):
    cpu = next((l.split(":")[1].strip() for l in open("/proc/cpuinfo") if l.startswith("model name")), "?")
    commit = call("git", "-C", ROOT, "rev-parse", "--short", "HEAD").strip()
    lines = [
        "# Whole problems against DOLFINx with PETSc and NGSolve",
        "",
        "Written by `benches/compare/compare.py --solve`: the scenes of `benches/compare/scenes` and the same problems in",
        f"`peers/*_solve.py`. Processor time on one thread, medians of {rounds} round(s) run in turn; WFL is the whole command",
        "with its checks and files, the others from the mesh to the solution, compiled forms of DOLFINx in a cache.",
        "`difference` is that of the measure of the scene; NGSolve interpolates the inflow of the Stokes problem differently.",
        "",
        f"- {datetime.date.today()}, {cpu}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, "
        f"load {os.getloadavg()[0]:.1f} at the end",
        f"- WFL {commit}; " + "; ".join(f"{name} {version}" for name, version in versions.items()),
        *(f"- {name}: not measured ({reason})" for name, reason in absent.items()),
        "",
        "| problem | program | seconds | times WFL | peak memory, GB | difference |",
        "|---|---|---|---|---|---|",
    ]
    for name, runs in rows:
        own = runs["WFL"]
        for program, row in runs.items():
            difference = abs(row["value"] / own["value"] - 1)
            compared = ["-", "-"] if program == "WFL" else [f"{row['seconds'] / own['seconds']:.2f}", f"{difference:.1e}"]
            cells = [name if program == "WFL" else "", program, f"{row['seconds']:.2f}", compared[0]]
            lines.append("| " + " | ".join([*cells, f"{row['peak'] / 1e9:.2f}", compared[1]]) + " |")
    return "\n".join(lines) + "\n"


def page(versions, absent, measured, rounds):
    speeds, refused, faults = measured
    cpu = next((l.split(":")[1].strip() for l in open("/proc/cpuinfo") if l.startswith("model name")), "?")
    commit = call("git", "-C", ROOT, "rev-parse", "--short", "HEAD").strip()
    lines = [
        "# Assembly and the fault benchmark against other programs",
        "",
        "Written by `benches/compare/compare.py`. Tangent into an allocated sparse matrix, thousand entities per second of",
        f"processor time on one thread (two threads: of the busier one), medians of {rounds} round(s) run in turn; in brackets how",
        "many times faster WFL is on one thread.",
        "",
        f"- {datetime.date.today()}, {cpu}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, "
        f"load {os.getloadavg()[0]:.1f} at the end",
        f"- WFL {commit}; " + "; ".join(f"{name} {version}" for name, version in versions.items()),
        *(f"- {name}: not measured ({reason})" for name, reason in absent.items()),
        "",
        "| case | WFL | WFL, 2 threads | " + " | ".join(versions) + " |",
        "|---" * (3 + len(versions)) + "|",
    ]
    for case in [case for name, case in speeds if name == "WFL"]:
        wfl = speeds["WFL", case]
        cells = [f"{wfl:,.0f}", f"{speeds['WFL, 2 threads', case]:,.0f}"]
        for name in versions:
            other = speeds.get((name, case))
            cells.append(f"{other:,.0f} ({wfl / other:.1f})" if other else "-")
        lines.append(f"| {case} | " + " | ".join(cells) + " |")
    lines += ["", *(f"- {name}, {case}: {why}" for (name, case), why in refused.items())]
    medians = {name: statistics.median(list_) for name, list_ in faults.items() if list_}
    lines += [
        "",
        "Fault benchmark (Nitsche, 8x8x8 cells, 20 steps), seconds of processor time on one thread; WFL is the whole command",
        "on examples/fault/nitsche.wfl with its files, GetFEM the steps alone:",
        "",
    ]
    lines += [f"- {name}: {seconds:.2f}" for name, seconds in medians.items()]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solve", action="store_true", help="whole problems against DOLFINx and NGSolve")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=pathlib.Path)
    parser.add_argument("--only", nargs="*", metavar="PEER")
    parser.add_argument("--built", action="store_true", help="WFL is built already")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.folder or pathlib.Path(temporary)).resolve()
        versions, absent, peers = {}, {}, []
        for peer in PEERS:
            if options.solve and not (HERE / f"peers/{peer.name.lower()}_solve.py").exists():
                continue
            if options.only is not None and peer.name not in options.only:
                absent[peer.name] = "not asked for"
                continue
            try:
                versions[peer.name] = peer.install(folder)
                peers.append(peer)
            except (RuntimeError, OSError) as error:
                absent[peer.name] = str(error)[:200]
        if not options.built:
            build_wfl()
        if options.solve:
            text = solve_page(versions, absent, solves(peers, options.rounds, folder), options.rounds)
            (HERE / "solve.md").write_text(text)
            print(text)
            return
        text = page(versions, absent, measure(built_bench(), peers, options.rounds, folder), options.rounds)
    (HERE / "results.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
