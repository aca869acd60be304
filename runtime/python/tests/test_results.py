"""Results: arrays, contact, grids, charts."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from conftest import command

import wfl


@pytest.fixture(scope="module")
def fault():
    from conftest import EXAMPLES

    return wfl.Scene(EXAMPLES / "fault" / "nitsche.wfl").run()


def test_fields_are_views_of_one_vector_that_cannot_be_written_to(fault):
    left, right = fault["uL"], fault["uR"]
    assert left.shape == (405, 3) and np.shares_memory(left, fault.u) and np.shares_memory(right, fault.u)
    with pytest.raises(ValueError, match="read-only"):
        left[0] = 1.0
    assert set(fault) == {"uL", "uR"} and fault.points["uL"].shape == (405, 3)
    assert fault.cells["uL"]["hexahedron"].shape == (256, 8)
    with pytest.raises(KeyError):
        fault["u"]


def test_measures_are_columns(fault):
    frame = pd.DataFrame(fault.measures)
    assert list(frame)[:2] == ["t", "Fn"] and len(frame) == 20
    assert frame["Fn"].iloc[-1] == fault.steps[-1].measures["Fn"]


def test_contact_sums_up_to_the_measures_and_obeys_the_law(fault):
    contact = fault.contact("fault")
    last = fault.steps[-1].measures
    assert contact.weights.sum() == pytest.approx(16.0)
    assert contact.force @ contact.normals[0] == pytest.approx(last["Fn"], rel=1e-9)
    assert contact.force[2] == pytest.approx(last["Ftz"], rel=1e-9)
    assert np.linalg.norm(contact.slip, axis=1).max() == pytest.approx(last["max_slip"], rel=1e-9)
    assert -(contact.weights @ contact.gap) / 16 == pytest.approx(last["opening"], rel=1e-9)
    assert contact.pressure.min() >= 0
    sliding = contact.state == 1
    # Coulomb's law: friction 0.4, against the slip
    shear = np.linalg.norm(contact.shear, axis=1)
    np.testing.assert_allclose(shear[sliding], 0.4 * contact.pressure[sliding], rtol=1e-9)
    assert (np.einsum("ni,ni->n", contact.shear, contact.slip)[sliding] < 0).all()
    assert tuple(np.bincount(contact.state, minlength=3)) == fault.steps[-1].contact
    with pytest.raises(KeyError, match="regions with one: fault"):
        fault.contact("left")


def test_multipliers_carry_the_traction_that_the_scene_measures(examples):
    result = wfl.Scene(examples / "fault" / "augmented_lagrangian.wfl").run()
    contact, last = result.contact(), result.steps[-1].measures
    assert contact.force[0] == pytest.approx(last["Fn"], rel=1e-9)
    assert contact.force[2] == pytest.approx(last["Ftz"], rel=1e-9)


def test_grids_have_all_bodies_and_one_displacement(fault):
    mesh = fault.to_meshio()
    assert [c.type for c in mesh.cells] == ["hexahedron", "hexahedron", "quad"]
    displacement = mesh.point_data["displacement"]
    assert displacement.shape == (891, 3)
    bodies = np.unique(np.concatenate([c.data.ravel() for c in mesh.cells if c.type == "hexahedron"]))
    assert not np.isnan(displacement[bodies]).any()
    grid = fault.to_pyvista()
    assert grid.n_cells == 576 and {"uL", "stress_left", "traction"} <= set(grid.point_data)
    assert np.isclose(grid.extract_cells(np.arange(512)).volume, 32.0)
    warped = grid.extract_cells(np.arange(512)).warp_by_vector("displacement", factor=100)
    assert warped.bounds != grid.bounds


def test_second_degree_and_plane_grids(examples):
    result = wfl.Scene(examples / "elasticity" / "cook.wfl").run()
    mesh = result.to_meshio()
    assert mesh.points.shape[1] == 3
    name = next(n for n, f in result._fields.items() if f.kind == "unknown")
    assert mesh.point_data[name].shape == (len(mesh.points), 3)
    grid = result.to_pyvista()
    area = grid.compute_cell_sizes()["Area"].sum()
    assert area == pytest.approx(48 * (44 + 16) / 2, rel=1e-6)


def test_charts_are_those_of_the_report(examples, tmp_path):
    scene = wfl.Scene(examples / "friction" / "weakening.wfl")
    result = scene.run()
    out = tmp_path / "out"
    assert command("run", examples / "friction" / "weakening.wfl", "--out", out).returncode == 0
    assert command("report", out, "--plots").returncode == 0
    charts = result.plot()
    assert sorted(charts.names) == sorted(f.stem for f in (out / "plots").glob("*.svg"))
    for chart in charts:
        if chart.name != "time":
            assert chart.svg == (out / "plots" / f"{chart.name}.svg").read_text(), chart.name
    assert result.plot("measure_total").title
    with pytest.raises(KeyError, match="there are"):
        result.plot("nothing")
    charts[0].save(tmp_path / "chart.svg")
    shown = result._repr_html_()
    assert "9 of 9 steps converged" in shown and shown.count("<img") == len(charts)
    assert "<html" in result.page()


def test_outputs_and_tables_are_in_memory(fault):
    pieces = fault.outputs()["nitsche"]
    assert {"points", "cells", "point_data", "cell_data"} == set(pieces[0])
    table = fault.tables()["across_0019.csv"]
    assert len(table["x"]) == 101
    with pytest.raises(KeyError, match="not kept"):
        fault.steps[3]["uL"]


def test_a_report_is_at_hand(fault):
    assert fault.report["dofs"] == 2088 and "2088 unknowns" in fault.summary
    assert fault.ok and fault.files == []


def test_the_stub_names_what_the_library_has():
    import ast
    from pathlib import Path

    from wfl import _wfl

    tree = ast.parse((Path(wfl.__file__).parent / "_wfl.pyi").read_text())
    for found in tree.body:
        if isinstance(found, ast.ClassDef):
            own = {n for n in vars(getattr(_wfl, found.name)) if not n.startswith("_")}
            named = {n.name for n in found.body if isinstance(n, ast.FunctionDef)} - {"__init__"}
            named |= {n.target.id for n in found.body if isinstance(n, ast.AnnAssign)}
            assert own == named, found.name


BAR = """wfl 1
param E = 100
mesh box [0] to [2] cells [4] segment
region west = faces where x == 0
region east = faces where x == 2
unknown u : scalar
term bar on all : E*Grad_u.Grad_Test_u
fix u = 0 on west
fix u = 0.1*t on east
steps t = 1 to 2 by 1
measure F = reaction(u) on west
measure k = abs(F)/(0.1*t)
"""


def test_measures_are_a_table_of_pandas():
    result = wfl.Scene.from_text(BAR).run()
    table = result.to_pandas()
    assert list(table.index) == [1.0, 2.0] and list(table.columns) == ["F", "k"]
    assert np.array_equal(result.times, [1.0, 2.0])
    assert np.allclose(table["k"], 50.0, rtol=1e-12)


def test_a_sweep_runs_every_combination_and_leaves_the_scene_as_it_was():
    scene = wfl.Scene.from_text(BAR, E=300)
    table = scene.sweep(E=[100, 200], degree=[1, 2])
    assert list(table["E"]) == [100, 100, 200, 200] and list(table["degree"]) == [1, 2, 1, 2]
    assert np.allclose(table["k"], table["E"] / 2, rtol=1e-12) and table["ok"].all()
    assert list(table["dofs"]) == [5, 9, 5, 9]
    assert scene.params["E"] == 300 and scene.n_dofs == 5
    assert np.isclose(scene.run().measures["k"][-1], 150)
    assert np.isnan(scene.sweep(E=[100], step=7).get("k", np.nan)).all()
    with pytest.raises(wfl.WflError):
        scene.sweep(E=[100], nothing=[1])
    assert scene.params["E"] == 300
