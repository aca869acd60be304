"""The equations in Python: tangents, an own Newton iteration, an own loop over time."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from conftest import HEAT

import wfl


def newton(scene, u, tolerance=1e-12):
    """Newton's method without a search."""
    for _ in range(30):
        r = scene.residual(u)
        du = scipy.sparse.linalg.spsolve(scene.tangent(u).tocsc(), -r)
        u = scene.advance(u, du)
        if np.abs(du).max() <= tolerance * np.abs(u).max():
            return u
    raise AssertionError("no convergence")


def test_the_tangent_is_the_derivative_of_the_residual(examples):
    scene = wfl.Scene(examples / "hyperelastic" / "contact.wfl")
    solved = scene.solve_step()
    u, n = solved.u, len(scene.free)
    k = scene.tangent(u)
    assert scipy.sparse.issparse(k) and k.format == "csr" and k.shape == (n, n)
    d = np.random.default_rng(1).standard_normal(n)
    h = 1e-6
    slope = (scene.residual(scene.advance(u, d, h)) - scene.residual(scene.advance(u, d, -h))) / (2 * h)
    np.testing.assert_allclose(slope, k @ d, atol=1e-6 * np.abs(k @ d).max())
    moved = scene.advance(u, d, 0.5)
    np.testing.assert_allclose(moved[scene.free], u[scene.free] + 0.5 * d)
    held = np.delete(np.arange(scene.n_dofs), scene.free)
    reactions = scene.reactions(u)
    assert np.abs(reactions[scene.free]).max() < 1e-8 * np.abs(reactions[held]).max()


@pytest.mark.parametrize("path", ["hyperelastic/contact.wfl", "creep/maxwell.wfl", "plasticity/perzyna.wfl",
                                  "elasticity/rollers.wfl"])
def test_an_own_newton_iteration_and_an_own_loop_over_time_find_what_a_run_finds(examples, path):
    scene = wfl.Scene(examples / path)
    known = scene.run(keep_states=True)
    scene.restart()
    for k, t in enumerate(scene.times):
        # a step that is left, as where its equations were not solved
        scene.begin(t + 0.3 * (scene.times[-1] - scene.times[0]))
        u = scene.begin(t)
        rates = k == 0 and known.steps[0].stop == "given"
        step = scene.accept(u if rates else newton(scene, u))
        size = np.abs(known.steps[k].u).max()
        np.testing.assert_allclose(step.u, known.steps[k].u, atol=1e-9 * size)
        for name, value in known.steps[k].measures.items():
            assert step.measures[name] == pytest.approx(value, rel=1e-7, abs=1e-12)
    result = scene.result()
    assert result.ok and len(result.steps) == len(known.steps)


def test_steps_one_by_one_are_those_of_a_run(examples):
    scene = wfl.Scene(examples / "friction" / "weakening.wfl")
    known = scene.run(keep_states=True)
    seen = []
    for step in scene.steps():
        np.testing.assert_array_equal(step.u, known.steps[step.number].u)
        assert step.measures == known.steps[step.number].measures
        seen.append(step.t)
    assert seen == list(scene.times)
    result = scene.result()
    assert result.ok and result.contact("fault").state.shape == known.contact("fault").state.shape
    np.testing.assert_array_equal(result.contact("fault").slip, known.contact("fault").slip)
    with pytest.raises(ValueError, match="no step was taken"):
        scene.result()


def test_an_own_loop_over_time_with_the_solver_of_the_package(examples):
    scene = wfl.Scene(examples / "friction" / "weakening.wfl")
    known = scene.run(keep_states=True)
    for t in scene.times[:3]:
        step = scene.solve_step(t)
    np.testing.assert_array_equal(step.u, known.steps[2].u)
    # from here on in half steps, with a look at the slip after each
    for t in np.arange(0.3125, 1.0001, 0.0625):
        step = scene.solve_step(t)
    assert step.measures["total"] == pytest.approx(known.steps[-1].measures["total"], rel=1e-6)


def test_a_run_goes_back_to_where_it_has_stood(examples):
    scene = wfl.Scene(examples / "friction" / "weakening.wfl")
    known = scene.run(keep_states=True)
    scene.solve_step()
    here = scene.state()
    assert here.n_steps == 1 and "1 step>" in repr(here)
    np.testing.assert_array_equal(here.u, scene.u)
    for _ in range(2):
        for number in (1, 2):
            np.testing.assert_array_equal(scene.solve_step().u, known.steps[number].u)
        scene.go_back(here)
        np.testing.assert_array_equal(scene.u, here.u)
    scene.restart()
    scene.go_back(here)
    np.testing.assert_array_equal(scene.solve_step().u, known.steps[1].u)
    scene.begin(0.5)
    with pytest.raises(wfl.WflError, match="a step was begun"):
        scene.state()
    other = wfl.Scene.from_text(HEAT)
    with pytest.raises(wfl.WflError, match="another scene"):
        other.go_back(here)


def test_unknowns_can_be_set_between_steps():
    scene = wfl.Scene.from_text(HEAT)
    scene.solve_step()
    u = scene.u
    scene.field_of(u, "u")[:] = 7.0
    scene.u = u
    np.testing.assert_array_equal(scene.u, 7.0)
    step = scene.solve_step()
    assert step.measures["m"] == pytest.approx(wfl.Scene.from_text(HEAT).run().measures["m"][1], rel=1e-12)
    with pytest.raises(ValueError, match="49 unknowns"):
        scene.u = np.zeros(3)


def test_equations_need_a_step():
    scene = wfl.Scene.from_text(HEAT)
    with pytest.raises(wfl.WflError, match="no step was begun"):
        scene.residual(np.zeros(scene.n_dofs))
    with pytest.raises(wfl.WflError, match="no step was begun"):
        scene.accept(np.zeros(scene.n_dofs))
    scene.begin(0.0)
    with pytest.raises(ValueError, match="49 unknowns"):
        scene.residual(np.zeros(3))
    bad = np.full(scene.n_dofs, np.nan)
    with pytest.raises(wfl.WflError) as caught:
        scene.residual(bad)
    assert caught.value.code == "E612"
    # a step that is left has no equations, nor has one whose end is no state
    scene.u = scene.u
    with pytest.raises(wfl.WflError, match="no step was begun"):
        scene.residual(np.zeros(scene.n_dofs))
    scene.begin(0.0)
    with pytest.raises(wfl.WflError):
        scene.accept(bad)
    with pytest.raises(wfl.WflError, match="no step was begun"):
        scene.tangent(np.zeros(scene.n_dofs))
