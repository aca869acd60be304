"""Scenes: read, changed, run, stepped."""

from __future__ import annotations

import itertools
import os
import time
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence, Union

from . import _wfl
from ._messages import Message, WflError, WflWarning
from ._progress import Lines
from ._result import Iteration, Result, Step, field_view

if TYPE_CHECKING:
    import numpy as np
    import pandas
    import scipy.sparse
    from numpy.typing import ArrayLike, NDArray

    from ._wfl import State

    Array = NDArray[np.float64]
    #: A number, an array, text of the language, or a function of the step variable.
    ParamValue = Union[float, str, ArrayLike, Callable[[float], float]]
    #: An array, or a function of positions (n, dim) and the step variable.
    FieldValue = Union[ArrayLike, Callable[..., ArrayLike]]


@dataclass(frozen=True)
class Field:
    """A field of a scene."""

    name: str
    kind: str
    """``"unknown"``, ``"multiplier"``, ``"data"`` or ``"state"``."""
    shape: tuple[int, ...]
    """Of its value at a point: ``()`` for a scalar, ``(2,)`` for a vector in 2-D, ``(2, 2)`` for a matrix."""
    place: str
    """``"nodes"`` of an element, ``"points"`` of quadrature, or ``"global"``: one value."""
    n_nodes: int
    """How many nodes or points."""
    start: int | None
    """Position of its first number among all unknowns; None for data and states."""

    @property
    def size(self) -> int:
        """How many numbers: nodes times components."""
        n = self.n_nodes
        for s in self.shape:
            n *= s
        return n


def _word(value: Any) -> str:
    """A value as text of the language; numbers keep all their bits."""
    if isinstance(value, str):
        return value
    import numpy as np

    # knobs such as `degree` take whole numbers alone
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return str(int(value))
    a = np.asarray(value, dtype=float)
    if a.ndim == 0:
        return repr(float(a))
    if a.ndim == 1:
        return "[" + ",".join(repr(float(x)) for x in a) + "]"
    if a.ndim == 2:
        return "[" + ";".join(",".join(repr(float(x)) for x in row) for row in a) + "]"
    raise ValueError(f"a parameter is a number, a vector or a matrix, not an array of shape {a.shape}")


def _block(field: Field, value: Any) -> Array:
    """Values of a field in one block, node after node, first index of the tensor fastest."""
    import numpy as np

    shape = (field.n_nodes, *field.shape)
    found = np.asarray(value, dtype=float)
    if found.shape in ((), field.shape):
        whole = np.broadcast_to(found, shape)
    elif found.shape == shape:
        whole = found
    else:
        raise ValueError(f"`{field.name}` has values of shape {shape}, found {found.shape}")
    if len(field.shape) > 1:
        whole = whole.transpose(0, *range(whole.ndim - 1, 0, -1))
    return np.ascontiguousarray(whole).reshape(-1)


class _Given(MutableMapping[str, Any]):
    """Values of fields, given by name: ``scene.data["k"] = value``."""

    def __init__(self, scene: Scene, kinds: tuple[str, ...], as_start: bool) -> None:
        self._scene = scene
        self._kinds = kinds
        self._as_start = as_start
        self._values: dict[str, Any] = {}

    def _source(self, field: Field, value: Any) -> Callable[[Array, float, float], Array]:
        if not callable(value):
            block = _block(field, value)
            return lambda positions, t, increment: block
        dim = self._scene.dim

        def source(positions: Array, t: float, increment: float) -> Array:
            x = positions[:, :dim]
            if field.place == "global":
                found = value(t)
            elif self._as_start:
                found = value(x)
            else:
                found = value(x, t)
            return _block(field, found)

        return source

    def _put(self, name: str, value: Any) -> None:
        fields = self._scene.fields
        if name not in fields:
            known = ", ".join(n for n, f in fields.items() if f.kind in self._kinds) or "none"
            raise KeyError(f"no such field `{name}`; known: {known}")
        self._scene._native.give(name, self._source(fields[name], value), self._as_start)

    def __setitem__(self, name: str, value: Any) -> None:
        self._put(name, value)
        self._values[name] = value

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def __delitem__(self, name: str) -> None:
        raise TypeError("values that were given stay: make the scene again for those of its text")

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)


class Scene:
    """A scene, read and prepared: mesh, fields and compiled laws.

    Parameters
    ----------
    file:
        The scene, a path.
    data:
        Values of ``data`` fields by name, in place of those of the text: an array of shape ``(n_nodes, *shape)``, one value
        for all nodes, or a function of the positions ``x``, shape ``(n_nodes, dim)``, and the step variable ``t``. It is
        asked once for each value of the step variable and its increment; the checks before a run ask for some, too.
    start:
        First values of unknowns, multipliers and states by name: an array, one value, or a function of ``x``.
    times:
        Values of the step variable, in place of those of ``steps``.
    params:
        Parameters (``gamma=1e5``, vectors and matrices as arrays, formulas as text) and knobs of statements
        (``degree=2``), as on the command line. A function of ``t`` makes a parameter change from step to step.

    Raises
    ------
    WflError
        For a scene with an error; ``str(error)`` is what ``wfl check`` prints.
    """

    def __init__(
        self,
        file: str | os.PathLike[str],
        /,
        *,
        data: Mapping[str, FieldValue] | None = None,
        start: Mapping[str, FieldValue] | None = None,
        times: ArrayLike | None = None,
        **params: ParamValue,
    ) -> None:
        self._make(os.fspath(file), None, data, start, times, params)

    @classmethod
    def from_text(
        cls,
        text: str,
        /,
        *,
        name: str = "scene.wfl",
        folder: str | os.PathLike[str] = ".",
        data: Mapping[str, FieldValue] | None = None,
        start: Mapping[str, FieldValue] | None = None,
        times: ArrayLike | None = None,
        **params: ParamValue,
    ) -> Scene:
        """A scene from its text. Meshes and other files are found in ``folder``; messages call the scene ``name``."""
        self = cls.__new__(cls)
        where = os.fspath(folder)
        self._make(name if where == "." else os.path.join(where, name), text, data, start, times, params)
        return self

    def _make(
        self,
        path: str,
        text: str | None,
        data: Mapping[str, Any] | None,
        start: Mapping[str, Any] | None,
        times: Any,
        params: Mapping[str, Any],
    ) -> None:
        self._path, self._text = path, text
        self._params: dict[str, Any] = {}
        self._times: Any = None
        self._data = _Given(self, ("data",), False)
        self._start = _Given(self, ("unknown", "multiplier", "state"), True)
        self._prepare(dict(params), dict(data or {}), dict(start or {}), times)

    def _prepare(self, params: dict[str, Any], data: dict[str, Any], start: dict[str, Any], times: Any) -> None:
        functions = {n: v for n, v in params.items() if callable(v)}
        words = [f"{n}={_word(v)}" for n, v in params.items() if n not in functions]
        left = [*data, *functions]
        self._native = _wfl.Scene(self._path, self._text, words, left)
        self._fields = {
            n: Field(n, kind, tuple(sizes), place, nodes, first)
            for n, kind, sizes, place, nodes, first in self._native.fields()
        }
        self._warned = False
        self._params = params
        for name, value in functions.items():
            self._data._put(name, value)
        for given, values in ((self._data, data), (self._start, start)):
            given._values = {}
            for name, value in values.items():
                given[name] = value
        if times is not None:
            self.times = times

    def set(self, **params: ParamValue) -> Scene:
        """Changes parameters and knobs: the scene is read and prepared again. Given data, starts and times stay.

        After an error the scene is what it was.
        """
        merged = {**self._params, **params}
        kept = self._kept()
        try:
            self._prepare(merged, dict(self._data), dict(self._start), self._times)
        except BaseException:
            self._restore(kept)
            raise
        return self

    def _kept(self) -> tuple[Any, ...]:
        """What :meth:`_prepare` changes."""
        values = (dict(self._data._values), dict(self._start._values))
        return self._native, self._fields, self._warned, self._params, self._times, values

    def _restore(self, kept: tuple[Any, ...]) -> None:
        self._native, self._fields, self._warned, self._params, self._times, values = kept
        self._data._values, self._start._values = values

    def __repr__(self) -> str:
        unknowns = ", ".join(n for n, f in self._fields.items() if f.kind in ("unknown", "multiplier"))
        return f"<wfl.Scene {self.name}: {self._native.n_cells} cells, {self.n_dofs} unknowns ({unknowns})>"

    @property
    def name(self) -> str:
        """The name of the file without its ending."""
        return self._native.name

    @property
    def dim(self) -> int:
        """Dimension of the mesh: 1, 2 or 3."""
        return self._native.dim

    @property
    def n_dofs(self) -> int:
        """Number of unknowns, prescribed ones included: the length of every ``u``."""
        return self._native.n_dofs

    @property
    def fields(self) -> dict[str, Field]:
        """Fields by name, in the order of the text."""
        return dict(self._fields)

    @property
    def params(self) -> dict[str, float | Array]:
        """Values of the parameters: numbers, vectors (n,), matrices (m, n)."""
        import numpy as np

        made: dict[str, float | Array] = {}
        for name, sizes, values in self._native.params():
            made[name] = values[0] if not sizes else np.array(values).reshape(sizes, order="F")
        return made

    @property
    def regions(self) -> dict[str, int]:
        """Regions by name, with the number of their cells, faces or nodes."""
        return dict(self._native.regions())

    def points(self, field: str) -> Array:
        """Positions of the nodes of a field, shape ``(n_nodes, dim)``, a length."""
        return self._native.points(field)

    def cells(self, field: str) -> dict[str, NDArray[np.int64]]:
        """Nodes of the cells of a field by kind (``"quad"``, ``"triangle6"``, ... as meshio names them), shape ``(n_cells,
        nodes of a cell)``, in the order of VTK; for elements of degree 1 and 2."""
        found = self._native.cells(field)
        if found is None:
            raise KeyError(f"`{field}` has no cells of degree 1 or 2")
        return {kind: nodes for kind, _, nodes, _ in found}

    @property
    def data(self) -> MutableMapping[str, Any]:
        """Values of data fields: ``scene.data["k"] = array or function(x, t)``."""
        return self._data

    @property
    def start(self) -> MutableMapping[str, Any]:
        """First values: ``scene.start["u"] = array or function(x)``."""
        return self._start

    @property
    def times(self) -> Array:
        """The values of the step variable, shape ``(n_steps,)``; assign others to run through those."""
        import numpy as np

        return np.array(self._native.times)

    @times.setter
    def times(self, values: ArrayLike) -> None:
        import numpy as np

        self._native.times = [float(t) for t in np.atleast_1d(np.asarray(values, dtype=float))]
        self._times = values

    def check(self) -> list[Message]:
        """What is said of the scene before a run: warnings of ``wfl check`` and ``wfl run``."""
        return [Message(**d) for d in self._native.check()]

    def _warn(self) -> None:
        if not self._warned:
            self._warned = True
            for message in self.check():
                warnings.warn(str(message), WflWarning, stacklevel=3)

    def run(
        self,
        *,
        out: str | os.PathLike[str] | None = None,
        threads: int | None = None,
        progress: bool = False,
        on_step: Callable[[Step], Any] | None = None,
        on_iteration: Callable[[Iteration], Any] | None = None,
        keep_states: bool = False,
        outputs: bool = True,
        gradients: bool = False,
        check: bool = True,
    ) -> Result:
        """Solves all steps.

        Parameters
        ----------
        out:
            A folder for the files that ``wfl run`` writes; without one nothing is written.
        threads:
            Threads of assembly and solver; all of the machine by default. The numbers do not depend on it.
        progress:
            Writes a line for each step to standard error; in a notebook one line that is renewed.
        on_step, on_iteration:
            Called after each step and each iteration, on this thread; an exception ends the run before its next iteration.
        keep_states:
            Keeps the unknowns of every step, not only of the last one.
        gradients:
            Keeps all that :meth:`Result.gradient` needs: the unknowns and states of every step.
        outputs:
            Keeps what the ``output`` statements ask for in memory, for pictures and grids.
        check:
            Raises for a run that did not converge, or whose expectations do not hold.

        Raises
        ------
        WflError
            With the run as far as it came in ``error.result``, where there is one.
        KeyboardInterrupt
            On Ctrl-C, before the next iteration.
        """
        self._warn()
        step_hook = None
        show = Lines()
        if progress or on_step is not None:

            def step_hook(told: dict[str, Any]) -> None:
                step = Step(self._fields, told)
                if progress:
                    show(step.line())
                if on_step is not None:
                    on_step(step)

        iteration_hook = None if on_iteration is None else lambda told: on_iteration(Iteration(**told))
        folder = None if out is None else os.fspath(out)
        told, outcome = self._native.run(folder, threads, (keep_states, outputs, gradients), (step_hook, iteration_hook))
        return self._result(told, outcome, check)

    def sweep(
        self,
        *,
        step: int = -1,
        threads: int | None = None,
        progress: bool = False,
        check: bool = True,
        **values: Iterable[ParamValue],
    ) -> pandas.DataFrame:
        """Runs the scene for every combination of values of its parameters and knobs, and tells the measures.

        The scene has its parameters of before afterwards.

        Parameters
        ----------
        step:
            The step whose measures are told; the last one by default.
        progress:
            Writes a line for each run to standard error; in a notebook one line that is renewed.
        check:
            Raises for a run that did not converge or whose expectations do not hold; otherwise ``ok`` is False there.
        values:
            Lists of values by name: ``scene.sweep(fric=[0.3, 0.5], degree=[1, 2])``.

        Returns
        -------
        pandas.DataFrame
            A row a run, the last name changes fastest: the values, the measures, the number of unknowns ``dofs``,
            ``iterations`` of all steps, ``seconds``, and whether the run is ``ok``. nan where a run has no such step.

        Raises
        ------
        WflError
            As :meth:`run`; also for a value that the scene cannot take.
        """
        import pandas

        lists = {name: list(given) for name, given in values.items()}
        rows: list[dict[str, Any]] = []
        show = Lines()
        kept = self._kept()
        try:
            for chosen in itertools.product(*lists.values()):
                row: dict[str, Any] = dict(zip(lists, chosen))
                begin = time.perf_counter()
                result = self.set(**row).run(threads=threads, outputs=False, check=check)
                seconds = time.perf_counter() - begin
                if progress:
                    told = ", ".join(f"{name} = {value}" for name, value in row.items())
                    show(f"{len(rows) + 1}: {told}: {seconds:.2f} s")
                inside = -len(result.steps) <= step < len(result.steps)
                measures = result.steps[step].measures if inside else {}
                iterations = sum(s.iterations for s in result.steps)
                work = {"dofs": self.n_dofs, "iterations": iterations, "seconds": seconds, "ok": result.ok}
                rows.append({**row, **measures, **work})
        finally:
            self._restore(kept)
        return pandas.DataFrame(rows)

    def value_and_gradient(
        self, result: str, parameters: Sequence[str], x: ArrayLike | None = None, *, threads: int | None = None
    ) -> tuple[float, Array]:
        """A result and its derivatives in parameters of one number each, as optimisers want them.

        ``x`` has the values of the parameters, in their order; without it they keep theirs. The scene keeps the values::

            minimize(lambda x: scene.value_and_gradient("misfit", ["E", "fric"], x), x0, jac=True)
        """
        import numpy as np

        if x is not None:
            self.set(**{name: float(value) for name, value in zip(parameters, np.asarray(x), strict=True)})
        found = self.run(threads=threads, outputs=False, gradients=True)
        value, gradient = found.value_and_gradient(result, parameters)
        return value, np.array([float(gradient[name]) for name in parameters])

    def _result(self, told: dict[str, Any], outcome: Any, check: bool) -> Result:
        result = Result(self._native, self._fields, told, outcome)
        for message in result.messages:
            if message.severity == "warning":
                warnings.warn(str(message), WflWarning, stacklevel=4)
        if check and result.ending != "done":
            raise WflError(result.messages, result)
        return result

    def steps(self, *, check: bool = True) -> Iterator[Step]:
        """Solves the steps one after the other, each when it is asked for: ``for step in scene.steps(): ...``.

        Between two steps the scene may be looked at, its data changed, and :attr:`u` set. With ``check`` a step that does
        not converge raises. :meth:`result` ends the run.
        """
        self._warn()
        self._native.restart()
        while (told := self._native.step(None)) is not None:
            yield self._stepped(told, check)

    def solve_step(self, t: float | None = None, *, check: bool = True) -> Step:
        """Solves one step: to the next value of :attr:`times`, or to ``t`` in a loop over time of your own.

        The first step of a scene with rates is where time starts: nothing is solved there.
        """
        self._warn()
        told = self._native.step(None) if t is None else self._native.step_to(float(t), None)
        if told is None:
            raise ValueError("all steps of the scene are done; solve_step(t) goes on, restart() begins again")
        return self._stepped(told, check)

    def _stepped(self, told: dict[str, Any], check: bool) -> Step:
        step = Step(self._fields, told)
        if check and not step.converged:
            line = f"error[E603]: step t = {step.t} did not converge in {step.iterations} iterations"
            message = Message("E603", "error", line.split(": ", 1)[1], None, None, None, line)
            raise WflError([message])
        return step

    def restart(self) -> None:
        """Forgets the steps that were taken one by one: the next one is the first."""
        self._native.restart()

    def state(self) -> State:
        """Where the steps that are taken one by one stand: a value, to be kept for :meth:`go_back`, with a copy of the steps
        so far. It has their number, ``n_steps``, and the unknowns, ``u``."""
        return self._native.standing()

    def go_back(self, state: State) -> None:
        """Goes back to where steps of this scene, with these parameters, have stood: the next one has the bits that it had
        from there. To try several increments, say: ``here = scene.state()``, then ``scene.go_back(here)`` before each."""
        self._native.go_back(state)

    def result(self, *, check: bool = True) -> Result:
        """The result of the steps that were taken one by one."""
        found = self._native.result()
        if found is None:
            raise ValueError("no step was taken: for step in scene.steps(): ...")
        return self._result(*found, check)

    @property
    def u(self) -> Array:
        """All unknowns between two steps, shape ``(n_dofs,)``, a copy: field after field, node after node, component
        fastest. ``scene.field_of(u, "u")`` is the part of a field. Assign to go on from other values."""
        return self._native.unknowns()

    @u.setter
    def u(self, values: ArrayLike) -> None:
        import numpy as np

        self._native.set_unknowns(np.ascontiguousarray(values, dtype=float))

    def field_of(self, u: Array, name: str) -> Array:
        """The values of an unknown in ``u``, shape ``(n_nodes, *shape)``: a view, so that it can be written to."""
        return field_view(self._fields[name], u)

    @property
    def free(self) -> NDArray[np.int64]:
        """The free unknowns: ``residual(u)[i]`` belongs to ``u[free[i]]``, or at nodes with a prescribed normal component on
        a face that is not normal to an axis, to the same axis of the local frame of the node."""
        return self._native.free()

    def begin(self, t: float) -> Array:
        """Begins a step that you solve: the unknowns become the past, data and laws are those of ``t``, and prescribed
        values are written into the unknowns, which are returned, shape ``(n_dofs,)``. :meth:`accept` ends it; another
        ``begin``, or a step of the solver, leaves it."""
        self._warn()
        return self._native.begin(float(t))

    def residual(self, u: ArrayLike) -> Array:
        """The equations as they are written at ``u``, shape ``(n_free,)``, a force: zero at a solution. At the step of the
        last :meth:`begin` or :meth:`solve_step`; an error where that step was left."""
        return self._native.residual(_vector(u))

    def reactions(self, u: ArrayLike) -> Array:
        """The residual by unknown, shape ``(n_dofs,)``: where a value is prescribed, the force that holds it."""
        return self._native.forces(_vector(u))

    def tangent(self, u: ArrayLike) -> scipy.sparse.csr_matrix:
        """The derivative of :meth:`residual` in the free unknowns, shape ``(n_free, n_free)``; at a kink on the branch that
        the residual has at ``u``."""
        import scipy.sparse

        values, columns, rows, n = self._native.tangent(_vector(u))
        return scipy.sparse.csr_matrix((values, columns, rows), shape=(n, n))

    def advance(self, u: ArrayLike, correction: ArrayLike, step: float = 1.0) -> Array:
        """``u`` moved by a correction of the free unknowns, shape ``(n_free,)``: ``u[free] += step*correction``, and what
        follows from it at nodes with local frames and at unknowns that follow others."""
        return self._native.advance(_vector(u), _vector(correction), float(step))

    def accept(self, u: ArrayLike) -> Step:
        """Ends the step that was begun with the state ``u``: states are renewed, measures taken."""
        return Step(self._fields, self._native.accept(_vector(u)))


def _vector(u: ArrayLike) -> Array:
    import numpy as np

    return np.ascontiguousarray(u, dtype=float)
