"""Runs: the numbers of the command, callbacks, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time

import meshio
import numpy as np
import pytest
from conftest import HEAT, command, programs

import wfl

SAME = ["fault/nitsche.wfl", "fault/augmented_lagrangian.wfl", "friction/weakening.wfl", "creep/maxwell.wfl",
        "hyperelastic/contact.wfl", "heat/layers.wfl", "surfaces/tjunction.wfl"]


@pytest.mark.parametrize("path", SAME)
@pytest.mark.parametrize("program", programs())
def test_the_numbers_are_those_of_the_command_bit_for_bit(examples, tmp_path, path, program):
    out = tmp_path / "out"
    told = command("run", examples / path, "--out", out, program=program)
    assert told.returncode == 0, told.stderr
    report = json.loads((out / "report.json").read_text())
    result = wfl.Scene(examples / path).run()
    assert [s["t"] for s in report["steps"]] == [s.t for s in result.steps]
    for of_command, own in zip(report["steps"], result.steps):
        assert of_command["measures"] == own.measures, "floats of Python print and read back all bits"
        assert of_command["iterations"] == own.iterations
    last = len(result.steps) - 1
    for name, pieces in result.outputs().items():
        file = out / f"{name}_{last:04}.vtu"
        read = vtu(file)
        for key, of in (("point_data", "points"), ("cell_data", "cells")):
            names = {array for piece in pieces for array in piece[key]}
            assert names <= set(read[key]), "the file has all arrays, and what tells its bodies apart"
            for array in names:
                own = np.concatenate([values_of(piece, key, of, array, pieces) for piece in pieces])
                np.testing.assert_array_equal(read[key][array].reshape(own.shape), own)


def values_of(piece, key, of, array, pieces):
    """An array of a piece as a file has it: vectors of the plane with a third component, nan where the piece has none."""
    like = next(p[key][array] for p in pieces if array in p[key])
    size = len(piece["points"]) if of == "points" else sum(len(positions) for *_, positions in piece["cells"])
    shape = (3,) if like.shape[1:] == (2,) else like.shape[1:]
    if array not in piece[key]:
        return np.full((size, *shape), np.nan)
    values = piece[key][array]
    return np.pad(values, ((0, 0), (0, 1))) if values.shape[1:] == (2,) else values


def vtu(file):
    """Arrays of a .vtu of the command by name."""
    import re

    raw = file.read_bytes()
    head, _, data = raw.partition(b'<AppendedData encoding="raw">')
    data = data[data.index(b"_") + 1 :]
    found = {"point_data": {}, "cell_data": {}}
    section = None
    for line in head.decode().splitlines():
        if "<PointData" in line:
            section = "point_data"
        elif "<CellData" in line:
            section = "cell_data"
        elif "<Points" in line or "<Cells" in line or "<FieldData" in line:
            section = None
        elif "<DataArray" in line and section and 'type="Float64"' in line:
            tag = dict(re.findall(r'(\w+)="([^"]*)"', line))
            at = int(tag["offset"])
            size = int.from_bytes(data[at : at + 8], "little")
            values = np.frombuffer(data, dtype="<f8", count=size // 8, offset=at + 8)
            found[section][tag["Name"]] = values
    return found


def test_files_are_those_of_the_command(examples, tmp_path):
    own, of_command = tmp_path / "own", tmp_path / "command"
    result = wfl.Scene(examples / "friction" / "weakening.wfl").run(out=own)
    assert command("run", examples / "friction" / "weakening.wfl", "--out", of_command).returncode == 0
    for file in of_command.glob("*.vtu"):
        assert (own / file.name).read_bytes() == file.read_bytes(), file.name
    assert {f.name for f in result.files} >= {f.name for f in of_command.glob("*.vtu")}
    assert result.plot().names and "weakening" in result.page()


def test_threads_do_not_change_the_numbers(examples):
    scene = wfl.Scene(examples / "fault" / "nitsche.wfl")
    one, two = scene.run(threads=1), scene.run(threads=2)
    np.testing.assert_array_equal(one.u, two.u)


def test_steps_and_iterations_are_told(examples, capsys):
    scene = wfl.Scene(examples / "friction" / "weakening.wfl")
    steps, iterations = [], []
    result = scene.run(on_step=steps.append, on_iteration=iterations.append, progress=True)
    assert [s.t for s in steps] == [s.t for s in result.steps]
    assert all(s.u is not None and s["uL"].shape == (scene.fields["uL"].n_nodes, 2) for s in steps)
    assert len(iterations) >= sum(len(s.history) for s in steps)
    assert iterations[0].residual > 0
    assert capsys.readouterr().err.count("iterations  residual") == 9


def test_an_exception_in_a_callback_ends_the_run_and_the_scene_can_be_run_again():
    scene = wfl.Scene.from_text(HEAT)
    done = []

    def on_step(step):
        done.append(step.t)
        if len(done) == 2:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        scene.run(on_step=on_step)
    assert done == [0.0, 0.25]
    assert len(scene.run().steps) == 5


def test_a_callback_cannot_use_the_scene_that_calls_it():
    scene = wfl.Scene.from_text(HEAT)
    with pytest.raises(RuntimeError, match="at work"):
        scene.run(on_step=lambda step: scene.run())


def test_other_threads_go_on_while_it_solves(examples):
    scene = wfl.Scene(examples / "fault" / "nitsche.wfl")
    scene.check()
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    begin = time.perf_counter()
    scene.run(threads=1)
    took = time.perf_counter() - begin
    done.set()
    thread.join()
    # a millisecond of sleep each; with the interpreter held there would be a handful
    assert counted[0] > 100 * took, f"{counted[0]} in {took} s"


LONG = """
import warnings, wfl
warnings.simplefilter("ignore")
scene = wfl.Scene({path!r})
print("ready", flush=True)
try:
    scene.times = [0.001*k for k in range(20000)]
    scene.run()
except KeyboardInterrupt:
    print("interrupted", flush=True)
    scene.times = [0.0, 0.5]
    print(len(scene.run().steps), flush=True)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_stops_at_the_next_iteration_and_the_scene_is_as_good_as_new(examples):
    path = str(examples / "fault" / "nitsche.wfl")
    child = subprocess.Popen([sys.executable, "-c", LONG.format(path=path)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(2.0)
    begin = time.perf_counter()
    child.send_signal(signal.SIGINT)
    assert child.stdout.readline() == "interrupted\n"
    took = time.perf_counter() - begin
    assert child.stdout.readline() == "2\n"
    child.wait()
    # an iteration takes a hundredth of a second here
    assert took < 2.0


def test_importing_takes_less_than_a_fifth_of_a_second():
    code = "import time; a = time.perf_counter(); import wfl; print(time.perf_counter() - a)"
    times = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
             for _ in range(5)]
    assert min(times) < 0.2, times


def test_the_command_comes_along():
    assert command("--version").stdout.strip().endswith(wfl.__version__)
    wrong = command("run", "nothing.wfl")
    assert wrong.returncode == 1 and "cannot read nothing.wfl" in wrong.stderr
    assert command("explain", "E201").returncode == 0


def test_meshes_and_runs_are_readable_by_meshio(examples, tmp_path):
    result = wfl.Scene(examples / "signorini" / "signorini.wfl").run()
    mesh = result.to_meshio()
    mesh.write(tmp_path / "own.vtu")
    back = meshio.read(tmp_path / "own.vtu")
    body = len(result["u"])
    np.testing.assert_array_equal(back.points[:body, :2], result.points["u"])
    np.testing.assert_array_equal(back.point_data["displacement"][:body, :2], result["u"])


def test_files_for_viewers_are_readable_by_meshio(examples, tmp_path):
    scene = examples / "fault" / "nitsche.wfl"
    assert command("run", scene, "--out", tmp_path / "out").returncode == 0
    grid = meshio.read(sorted((tmp_path / "out").glob("nitsche_*.vtu"))[-1])
    assert [(c.type, len(c.data)) for c in grid.cells] == [("hexahedron", 512), ("quad", 64)]
    part = np.concatenate(grid.cell_data["part"]).ravel()
    assert [np.count_nonzero(part == k) for k in range(3)] == [256, 256, 64]
    left = np.unique(grid.cells[0].data[part[:512] == 0])
    right = np.unique(grid.cells[0].data[part[:512] == 1])
    assert len(left) + len(right) < len(grid.points) and not set(left) & set(right)
    moved = grid.point_data["displacement"]
    for name, own, other in (("uL", left, right), ("uR", right, left)):
        np.testing.assert_array_equal(moved[own], grid.point_data[name][own])
        assert np.isnan(grid.point_data[name][other]).all()
    faces = np.unique(grid.cells[1].data)
    np.testing.assert_array_equal(moved[faces], grid.point_data["uL"][faces])
    assert not np.isnan(moved).any()


BLOCK = """wfl 1
param E = 3
param grip = 0.2
mesh box [0] to [1] cells [4]
region left = faces where x == 0
region right = faces where x == 1
unknown u : scalar
data k : scalar = 1
term stress on all : E*k*Grad_u.Grad_Test_u
term friction on right : Ball_projection(10*(u - Previous_u), grip)*Test_u
fix u = 0 on left
load u = t on right
steps t = 0.1 to 0.5 by 0.1
measure end = value(u) at [1]
"""


def test_derivatives_are_those_of_the_closed_form():
    scene = wfl.Scene.from_text(BLOCK)
    result = scene.run(gradients=True)
    gradient = result.gradient("end", ["E", "grip", "field k"])
    # it slides with the friction `grip`: u = (0.5 - grip)/E at its end, and k is E where it is one
    end = result.measures["end"][-1]
    assert np.isclose(end, 0.1, rtol=1e-9)
    assert np.isclose(gradient["E"], -end / 3, rtol=1e-9)
    assert np.isclose(gradient["grip"], -1 / 3, rtol=1e-9)
    assert gradient["field k"].shape == (5,)
    assert np.isclose(gradient["field k"].sum(), 3 * gradient["E"], rtol=1e-9)
    value, slope = scene.value_and_gradient("end", ["E", "grip"], [6.0, 0.2])
    assert slope.shape == (2,) and scene.params["E"] == 6.0
    more, _ = scene.value_and_gradient("end", ["E", "grip"], [6.0 + 1e-5, 0.2])
    assert np.isclose((more - value) / 1e-5, slope[0], rtol=1e-4)


def test_a_jacobian_and_its_products():
    scene = wfl.Scene.from_text(BLOCK + "measure all = integral(u) on all\n")
    result = scene.run(gradients=True)
    names = ["E", "grip", "field k"]
    jacobian = result.jacobian(["end", "all"], names)
    assert jacobian.shape == (5, 2, 2 + 5)
    for step in (2, 5):
        gradient = result.gradient(f"end at t={step / 10}", names)
        row = jacobian[step - 1, 0]
        assert np.allclose(row[:2], [gradient["E"], gradient["grip"]], rtol=1e-11, atol=1e-14)
        assert np.allclose(row[2:], gradient["field k"], rtol=1e-11, atol=1e-14)
    along = {"grip": 0.3, "field k": np.arange(5.0)}
    moved = result.jvp(["end", "all"], along)
    assert moved.shape == (5, 2)
    assert np.allclose(moved, jacobian[:, :, 1] * 0.3 + jacobian[:, :, 2:] @ np.arange(5.0), rtol=1e-11, atol=1e-14)
    weights = {"end": np.linspace(1, 2, 5), "all": np.linspace(0, 1, 5)}
    back = result.vjp(weights, names)
    whole = np.einsum("sm,sme->e", np.stack(list(weights.values()), axis=1), jacobian)
    assert np.isclose(back["E"], whole[0], rtol=1e-11) and np.allclose(back["field k"], whole[2:], rtol=1e-11)
    with pytest.raises(wfl.WflError, match="2 numbers for 5 steps"):
        result.vjp({"end": [1.0, 2.0]}, ["E"])
    with pytest.raises(wfl.WflError, match="3 numbers for `k`, which has 5"):
        result.jvp(["end"], {"field k": [1.0, 2.0, 3.0]})


def test_derivatives_need_the_steps_of_the_run():
    scene = wfl.Scene.from_text(BLOCK)
    with pytest.raises(wfl.WflError, match="gradients=True"):
        scene.run().gradient("end", ["E"])
    with pytest.raises(wfl.WflError, match="did you mean `grip`"):
        scene.run(gradients=True).gradient("end", ["grib"])
    result = scene.run(gradients=True)
    scene.data["k"] = 2.0
    with pytest.raises(wfl.WflError, match="changed after the run"):
        result.gradient("end", ["E"])
