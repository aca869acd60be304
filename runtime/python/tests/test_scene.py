"""Scenes: what is read, given and refused."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import HEAT, command

import wfl


def test_a_scene_says_what_it_is_made_of(examples):
    scene = wfl.Scene(examples / "fault" / "nitsche.wfl", gamma=2e5)
    assert scene.name == "nitsche" and scene.dim == 3
    assert scene.params["gamma"] == 2e5 and scene.params["fric"] == 0.4
    assert scene.fields["uL"].shape == (3,) and scene.fields["uL"].start == 0
    assert scene.n_dofs == sum(f.size for f in scene.fields.values())
    assert scene.regions["left"] == 256 and scene.regions["fault"] == 64
    points = scene.points("uL")
    assert points.shape == (405, 3) and points[:, 0].max() == 0.0
    (kind, nodes), = scene.cells("uL").items()
    assert kind == "hexahedron" and nodes.shape == (256, 8) and nodes.max() == 404
    assert "2430 unknowns" in repr(scene)
    np.testing.assert_array_equal(scene.times, np.arange(20) * 0.5)


def test_numbers_vectors_and_matrices_reach_the_scene_with_all_their_bits():
    text = """wfl 1
param a = 1
param b = [1,2]
param m = [1,2;3,4]
mesh box [0,0] to [1,1] cells [1,1] quad
unknown u : scalar
term t on all : (Grad_u - b).Grad_Test_u + (a*u - Trace(m))*Test_u
measure ma = mean(a) on all
measure mb = mean(b(2)) on all
measure mm = mean(m(2,1)) on all
"""
    a, b, m = 0.1 + 0.2, np.array([1 / 3, np.pi]), np.array([[1.0, 2.0], [1e-300, 1 / 7]])
    scene = wfl.Scene.from_text(text, a=a, b=b, m=m)
    np.testing.assert_array_equal(scene.params["m"], m)
    measures = scene.run().steps[-1].measures
    assert scene.params["a"] == a and measures["mb"] == pytest.approx(b[1], rel=1e-15)
    assert measures["mm"] == pytest.approx(1e-300, rel=1e-12)
    assert scene.set(a="1/8").params["a"] == 0.125
    np.testing.assert_array_equal(scene.params["b"], b)


BROKEN = """wfl 1
mesh box [0,0] to [1,1] cells [2,2] quad
unknown u : scalar
term heat on everywhere : Grad_u.Grad_Test_u
load u = v on all
"""


def test_an_error_has_code_text_place_and_the_rendering_of_the_command(tmp_path):
    file = tmp_path / "broken.wfl"
    file.write_text(BROKEN)
    with pytest.raises(wfl.WflError) as caught:
        wfl.Scene(file)
    error = caught.value
    assert [m.code for m in error.messages] == ["E201", "E216"]
    assert error.code == "E201" and "everywhere" in error.text
    assert error.place == (str(file), 4, 14)
    told = command("run", file)
    assert told.returncode == 1
    assert told.stderr.strip() == str(error).strip()


def test_a_run_that_fails_says_what_the_command_says(tmp_path):
    file = tmp_path / "loose.wfl"
    file.write_text("wfl 1\nmesh box [0,0] to [1,1] cells [2,2] quad\nunknown u : vector\n"
                    "term e on all : Sym(Grad_u):Grad_Test_u\nload u = [1,0] on all\n")
    scene = wfl.Scene(file)
    with pytest.raises(wfl.WflError) as caught:
        scene.run()
    assert caught.value.code == "E602"
    told = command("run", file, "--out", tmp_path / "out")
    assert str(caught.value).strip() in told.stderr


def test_an_expectation_that_does_not_hold_raises_with_the_run(tmp_path):
    file = tmp_path / "hot.wfl"
    file.write_text(HEAT + "expect m > 100\n")
    scene = wfl.Scene(file)
    with pytest.raises(wfl.WflError) as caught:
        scene.run()
    assert caught.value.code == "E604" and caught.value.place[1] == 14
    assert caught.value.result.measures["m"].shape == (5,)
    result = scene.run(check=False)
    assert result.ending == "not_as_expected" and not result.ok
    told = command("run", file, "--out", tmp_path / "out")
    assert told.returncode == 3 and str(caught.value).strip() in told.stderr


def test_warnings_are_warnings(examples):
    scene = wfl.Scene(examples / "fault" / "nitsche.wfl", gamma=1e3, theta=1)
    with pytest.warns(wfl.WflWarning, match="W503"):
        scene.run(check=False)
    assert any(m.code == "W503" and m.severity == "warning" and m.place for m in scene.check())


def test_a_missing_file_and_an_unknown_parameter_are_told(tmp_path):
    with pytest.raises(wfl.WflError, match="cannot read"):
        wfl.Scene(tmp_path / "nothing.wfl")
    with pytest.raises(wfl.WflError) as caught:
        wfl.Scene.from_text(HEAT, q=1)
    assert caught.value.code == "E703"
    with pytest.raises(wfl.WflError, match="no data field and no parameter"):
        wfl.Scene.from_text(HEAT, q=lambda t: t)


def test_a_data_field_takes_functions_arrays_and_numbers():
    known = wfl.Scene.from_text(HEAT).run(keep_states=True)
    asked = []

    def k(x, t):
        assert x.shape == (49, 2)
        asked.append(t)
        return 1 + x[:, 0] * t

    scene = wfl.Scene.from_text(HEAT, data={"k": k})
    scene.check()
    asked.clear()
    given = scene.run(keep_states=True)
    assert asked == [0.0, 0.25, 0.5, 0.75, 1.0], "once a step"
    for a, b in zip(known.steps, given.steps):
        np.testing.assert_array_equal(a.u, b.u)
    np.testing.assert_array_equal(given["k"], 1 + scene.points("k")[:, 0])
    scene.data["k"] = 1 + 0.5 * scene.points("k")[:, 0]
    half = scene.run().measures
    np.testing.assert_allclose(half["m"], half["m"][0])
    assert half["m"][0] == pytest.approx(known.measures["m"][2], rel=1e-13)
    scene.data["k"] = 2.0
    assert scene.run().measures["m"][0] == pytest.approx(known.measures["m"][0] / 2, rel=1e-13)


def test_data_without_a_value_wait_for_one():
    text = HEAT.replace(" = 1 + x*t", "")
    with pytest.raises(wfl.WflError) as caught:
        wfl.Scene.from_text(text)
    assert caught.value.code == "E415"
    scene = wfl.Scene.from_text(text, data={"k": 1.0})
    assert scene.run().ok


def test_a_parameter_may_be_a_function_of_the_step():
    known = wfl.Scene.from_text(HEAT.replace("load u = c*", "load u = (1 + t^2)*")).run()
    scene = wfl.Scene.from_text(HEAT, c=lambda t: 1 + t**2)
    np.testing.assert_allclose(scene.run().measures["m"], known.measures["m"], rtol=1e-13)
    assert "c" not in scene.params and scene.fields["c"].place == "global"


def test_what_a_function_gives_is_checked():
    scene = wfl.Scene.from_text(HEAT, data={"k": lambda x, t: np.ones((3, 2))})
    with pytest.raises(ValueError, match=r"values of shape \(49,\), found \(3, 2\)"):
        scene.run()
    scene.data["k"] = lambda x, t: 1 / 0
    with pytest.raises(ZeroDivisionError):
        scene.run()
    scene.data["k"] = lambda x, t: np.full(len(x), np.nan)
    with pytest.raises(wfl.WflError) as caught:
        scene.run()
    assert caught.value.code == "E610" and "`k`" in str(caught.value)
    with pytest.raises(KeyError, match="known: k"):
        scene.data["u2"] = 1.0


def test_a_change_that_fails_leaves_the_scene_as_it_was():
    start = {"u": np.full(49, 0.5)}
    scene = wfl.Scene.from_text(HEAT, data={"k": np.linspace(1, 2, 49)}, start=start, times=[0, 0.5], c=2)
    native, before = scene._native, scene.run(keep_states=True)

    def given(scene):
        return dict(scene.data), dict(scene.start), list(scene.times), scene.params, scene.fields, scene.n_dofs

    known = repr(given(scene))
    # of another degree the values that were given have another length; the second name is not one of the scene
    for change in ({"degree": 2}, {"c": "nonsense"}, {"unheard": 1}):
        with pytest.raises((ValueError, wfl.WflError)):
            scene.set(**change)
        assert scene._native is native and repr(given(scene)) == known, change
    after = scene.run(keep_states=True)
    for a, b in zip(before.steps, after.steps):
        np.testing.assert_array_equal(a.u, b.u)
    assert scene.set(c=3).params["c"] == 3


def test_starts_and_times_are_those_that_are_given(examples):
    scene = wfl.Scene(examples / "creep" / "maxwell.wfl")
    scene.start["u"] = lambda x: np.stack([1e-3 * x[:, 1], 0 * x[:, 0]], axis=1)
    scene.times = [0, 0.25, 0.5]
    result = scene.run(keep_states=True, check=False)
    x = scene.points("u")
    np.testing.assert_allclose(result.steps[0]["u"][:, 0], 1e-3 * x[:, 1], rtol=1e-14)
    np.testing.assert_array_equal(result.measures["t"], [0, 0.25, 0.5])
    with pytest.raises(wfl.WflError, match="one direction"):
        scene.times = [0, 1, 0.5]
    start = np.zeros((scene.fields["u"].n_nodes, 2))
    scene.start["u"] = start
    assert scene.run(check=False).steps[0].converged
    # a matrix of a state: given and read in the same order
    ev = np.arange(4.0).reshape(2, 2)
    scene.start["ev"] = ev
    scene.times = [0, 1e-9]
    np.testing.assert_allclose(scene.run(check=False)["ev"][0], ev, atol=1e-3)
