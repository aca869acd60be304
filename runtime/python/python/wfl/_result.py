"""Results: steps, fields, contact, grids and charts."""

from __future__ import annotations

import base64
import html
import json
import math
import tempfile
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Iterator, Mapping, Sequence

from ._messages import Message, WflWarning

if TYPE_CHECKING:
    import meshio
    import numpy as np
    import pandas
    import pyvista
    from numpy.typing import NDArray

    from ._scene import Field

    Array = NDArray[np.float64]


def field_view(field: Field, u: Array) -> Array:
    """The values of an unknown in the vector of all, shape ``(n_nodes, *shape)``, without a copy."""
    if field.start is None:
        raise KeyError(f"`{field.name}` is not among the unknowns: it is {field.kind}")
    return _shaped(field, u[field.start : field.start + field.size])


def _shaped(field: Field, block: Array) -> Array:
    """A block of values, first index of the tensor fastest, as ``(n_nodes, *shape)``, without a copy."""
    turned = block.reshape(field.n_nodes, *reversed(field.shape))
    return turned.transpose(0, *range(turned.ndim - 1, 0, -1))


def _flat(numbers: Any, field: Field | None = None) -> list[float]:
    """Numbers of a tensor, first index fastest; those of a field node by node."""
    import numpy as np

    block = np.asarray(numbers, dtype=float)
    if field is None:
        return block.ravel(order="F").tolist()
    if block.size == field.n_nodes * math.prod(field.shape):
        block = block.reshape(field.n_nodes, *field.shape)
        block = block.transpose(0, *range(block.ndim - 1, 0, -1))
    return block.ravel().tolist()


def _warn(told: dict[str, Any]) -> None:
    """What there is to tell of derivatives."""
    for text in told["warnings"]:
        warnings.warn(f"W660: {text}", WflWarning, stacklevel=4)


def _same(a: Array, b: Array) -> bool:
    """True if two arrays differ by the rounding of a mean at most."""
    import numpy as np

    size = np.nanmax(np.abs(a), initial=0.0)
    return bool(np.allclose(a, b, rtol=0.0, atol=1e-13 * size, equal_nan=True))


@dataclass(frozen=True)
class Iteration:
    """An iteration of Newton's method."""

    number: int
    """0 is the start."""
    method: str
    """What led to it, in the words of docs/newton.md."""
    residual: float
    """Relative residual after it."""
    floor: float
    """The residual that rounding alone causes."""
    merit: float
    """The merit function of the method."""
    step: float
    """Part of the correction that was taken."""
    changed: int
    """Points whose branch in the active set changed."""
    contact: tuple[int, int, int] | None
    """Points open, slipping, sticking; None without contact."""


class Step:
    """A step of a run."""

    def __init__(self, fields: Mapping[str, Field], told: dict[str, Any]) -> None:
        self._fields = fields
        self.number: int = told["number"]
        """From 0."""
        self.t: float = told["t"]
        """The step variable."""
        self.increment: float = told["increment"]
        """Its last increment: smaller than that of the scene after a step in parts."""
        self.converged: bool = told["converged"]
        self.stop: str | None = told["stop"]
        """Why the iteration ended: ``"tolerance"``, ``"floor"``, ``"maxit"``, ``"rest"`` where nothing acts,
        or ``"given"`` where nothing was solved."""
        self.iterations: int = told["iterations"]
        """Linear systems that were solved."""
        self.attempts: int = told["attempts"]
        """Attempts at parts of the step."""
        self.digits: float | None = told["digits"]
        """About how many digits of the unknowns are correct in finite precision."""
        self.friction_work: float | None = told["friction_work"]
        """Energy that friction took in this step, force times length; None without friction."""
        self.history: list[Iteration] = [Iteration(**i) for i in told["history"]]
        """The start and each iteration of the last attempt."""
        self.measures: dict[str, float] = told["measures"]
        """The measures of the scene, in their units."""
        self.checks: list[tuple[str, float, float, bool]] = told["checks"]
        """Conditions of mechanics: name, value, limit, whether it holds."""
        self.u: Array | None = told["state"]
        """All unknowns, shape ``(n_dofs,)``, read-only; None for an earlier step of a run without ``keep_states``."""
        if self.u is not None:
            self.u.flags.writeable = False

    def __getitem__(self, field: str) -> Array:
        """The values of an unknown, shape ``(n_nodes, *shape)``, a view."""
        if self.u is None:
            raise KeyError(f"the unknowns of step {self.number} were not kept: run(keep_states=True)")
        return field_view(self._fields[field], self.u)

    @property
    def residual(self) -> float:
        """The relative residual at the end; nan where nothing was solved."""
        return self.history[-1].residual if self.history else math.nan

    @property
    def contact(self) -> tuple[int, int, int] | None:
        """Points open, slipping, sticking; None without contact."""
        return self.history[-1].contact if self.history else None

    def line(self) -> str:
        """The step in a line."""
        contact = "" if self.contact is None else "  open {} slip {} stick {}".format(*self.contact)
        word = self.stop if self.converged else "NOT CONVERGED"
        return f"t = {self.t:<8g} {self.iterations:>2} iterations  residual {self.residual:.1e} ({word}){contact}"

    def __repr__(self) -> str:
        return f"<wfl.Step {self.number}: {self.line()}>"


class Contact:
    """Contact at the integration points of a region, at the last step of a run."""

    def __init__(self, region: str, told: dict[str, Any]) -> None:
        self.region: str = region
        self.points: Array = told["points"]
        """Where, shape ``(n, dim)``, a length."""
        self.weights: NDArray[Any] = told["weights"]
        """Weights of the rule, shape ``(n,)``: their sum is the area of the region, or its length in 2-D."""
        self.normals: Array = told["normals"]
        """Unit normals that point away from the near side, shape ``(n, dim)``."""
        self.state: NDArray[np.uint8] = told["state"]
        """0 open, 1 slip, 2 stick (without friction: in contact), shape ``(n,)``, as ``contact_state`` in files."""
        self.gap: Array = told["gap"]
        """Distance of the sides along the normal, negative where they overlap, shape ``(n,)``, a length; nan where no law
        has one."""
        self.slip: Array = told["slip"]
        """Tangential motion of the near side against the other one as the law of friction takes it, in total or in the
        step, shape ``(n, dim)``, a length."""
        self.traction: Array = told["traction"]
        """Force on the near side by area, stress times normal, shape ``(n, dim)``."""

    @property
    def pressure(self) -> Array:
        """Minus the normal traction, shape ``(n,)``."""
        import numpy as np

        return -np.einsum("ni,ni->n", self.traction, self.normals)

    @property
    def shear(self) -> Array:
        """The tangential traction, shape ``(n, dim)``."""
        return self.traction + self.pressure[:, None] * self.normals

    @property
    def force(self) -> Array:
        """The traction integrated over the region, shape ``(dim,)``."""
        return self.weights @ self.traction

    def __len__(self) -> int:
        return len(self.weights)

    def __repr__(self) -> str:
        n = [int((self.state == k).sum()) for k in range(3)]
        return f"<wfl.Contact {self.region}: {n[0]} points open, {n[1]} slipping, {n[2]} sticking>"


@dataclass(frozen=True)
class Chart:
    """A chart of the report."""

    name: str
    title: str
    svg: str

    def save(self, file: str) -> None:
        """Writes it as SVG."""
        with open(file, "w", encoding="utf-8") as out:
            out.write(self.svg)

    def _repr_html_(self) -> str:
        # as a picture: the styles of a chart stay its own
        data = base64.b64encode(self.svg.encode()).decode()
        title = html.escape(self.title, quote=True)
        return f'<img alt="{title}" title="{title}" style="max-width:100%" src="data:image/svg+xml;base64,{data}">'


class Charts(Sequence[Chart]):
    """The charts of a run, by position or name."""

    def __init__(self, charts: list[Chart]) -> None:
        self._charts = charts

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            for chart in self._charts:
                if chart.name == key:
                    return chart
            raise KeyError(f"no chart `{key}`; there are {', '.join(self.names)}")
        return self._charts[key]

    def __len__(self) -> int:
        return len(self._charts)

    @property
    def names(self) -> list[str]:
        """Their names."""
        return [c.name for c in self._charts]

    def _repr_html_(self) -> str:
        cell = '<div style="display:inline-block;max-width:440px;margin:4px">{}</div>'
        return "".join(cell.format(c._repr_html_()) for c in self._charts)

    def __repr__(self) -> str:
        return f"<wfl.Charts {', '.join(self.names)}>"


class _ByField(Mapping[str, Any]):
    """Something of every field that has it, made when it is asked for."""

    def __init__(self, names: list[str], make: Any) -> None:
        self._names, self._make = names, make

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(f"`{name}`; known: {', '.join(self._names)}")
        return self._make(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Result(Mapping[str, Any]):
    """A run: ``result["u"]`` are the values of a field at its last step, shape ``(n_nodes, *shape)``, read-only views."""

    def __init__(self, native: Any, fields: Mapping[str, Field], told: dict[str, Any], outcome: Any) -> None:
        self._native, self._outcome, self._fields = native, outcome, fields
        self._known: list[Array] = told["known"]
        self._contact: dict[str, Any] = told["contact"]
        self._kept: list[dict[str, Any]] = told["kept"]
        self._report: str = told["report"]
        self.ending: str = told["ending"]
        """``"done"``, ``"not_converged"``, ``"not_finite"`` or ``"not_as_expected"``."""
        self.summary: str = told["summary"]
        """The lines that the command prints at the end."""
        self.files: list[Any] = told["files"]
        """Files that were written."""
        self.messages: list[Message] = [Message(**m) for m in told["messages"]]
        """Warnings about the numbers, and why the run is not done."""
        self.steps: list[Step] = [Step(fields, s) for s in told["steps"]]
        """The steps that were tried."""
        for block in self._known:
            block.flags.writeable = False

    @property
    def ok(self) -> bool:
        """True if every step converged and every expectation holds."""
        return self.ending == "done"

    def __getitem__(self, name: str) -> Array:
        field = self._fields[name]
        if field.start is None:
            position = list(self._fields).index(name)
            return _shaped(field, self._known[position])
        return self.steps[-1][name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def gradient(self, result: str, parameters: Sequence[str]) -> dict[str, float | Array]:
        """The derivatives of a measure by name: in a parameter a number (an array, first index fastest, for one of several
        numbers), in ``"field k"`` an array of shape ``(n_nodes, *shape)``. The run needs ``gradients=True``.

        ``result`` is ``"Fn"`` at the last step, ``"Fn at t=4.5"``, ``"sum(Fn)"`` or ``"mean(Fn)"`` over the steps.
        """
        return self.value_and_gradient(result, parameters)[1]

    def value_and_gradient(self, result: str, parameters: Sequence[str]) -> tuple[float, dict[str, float | Array]]:
        """The value of a result, and its derivatives as :meth:`gradient` has them."""
        return self._followed(self._outcome.gradient(self._native, result, ", ".join(parameters), ""))

    def one_sided(self, result: str, parameters: Sequence[str]) -> dict[str, tuple[float | Array, float | Array]]:
        """By parameter the derivatives of a result where the parameter grows and where it falls: two slopes, which differ where
        points are between two branches (W660), and are those of :meth:`gradient` elsewhere.
        """
        names = ", ".join(parameters)
        told = self._outcome.gradient(self._native, result, names, names)
        _warn(told)
        made: dict[str, tuple[float | Array, float | Array]] = {}
        for name, both in told["sides"].items():
            larger, smaller = (float(x[0]) if len(x) == 1 else x for x in (both["larger"], both["smaller"]))
            made[name] = (larger, smaller)
        return made

    def jacobian(self, measures: Sequence[str], parameters: Sequence[str]) -> Array:
        """The derivatives of measures at all steps, shape ``(steps, measures, entries)``: entries are those of the
        parameters in their order, first index fastest, and behind all parameters those of each ``"field k"``,
        ``[node, component]``. It takes a linear solution a step and entry, or, where there are more entries, a solution a
        step, measure and step before it. The run needs ``gradients=True``.
        """
        told = self._outcome.jacobian(self._native, ", ".join(measures), ", ".join(parameters))
        _warn(told)
        return told["values"]

    def jvp(self, measures: Sequence[str], direction: Mapping[str, Any]) -> Array:
        """What measures do along a direction, shape ``(steps, measures)``: the Jacobian times ``direction``, which has by
        parameter a number or several, and by ``"field k"`` an array over the nodes. One linear solution a step.
        """
        lists: tuple[list[Any], list[Any]] = ([], [])
        for name, numbers in direction.items():
            plain = name.removeprefix("field ")
            field = self._fields.get(plain) if plain != name else None
            lists[plain != name].append((plain, _flat(numbers, field)))
        told = self._outcome.jvp(self._native, list(measures), *lists)
        _warn(told)
        return told["values"]

    def vjp(self, weights: Mapping[str, Any], parameters: Sequence[str]) -> dict[str, float | Array]:
        """What a sum of measures follows: ``weights`` has by measure a number for each step, times which the measure at
        that step is added. The transposed Jacobian times ``weights``, as :meth:`gradient` has it. One solution a step.
        """
        lists = [(name, _flat(numbers)) for name, numbers in weights.items()]
        return self._followed(self._outcome.vjp(self._native, lists, ", ".join(parameters)))[1]

    def _followed(self, told: dict[str, Any]) -> tuple[float, dict[str, float | Array]]:
        _warn(told)
        made: dict[str, float | Array] = {}
        for name, entries in told["parameters"].items():
            made[name] = float(entries[0]) if len(entries) == 1 else entries
        for name, values in told["fields"].items():
            made[f"field {name}"] = _shaped(self._fields[name], values)
        return told["value"], made

    @property
    def u(self) -> Array:
        """All unknowns at the last step, shape ``(n_dofs,)``, read-only."""
        u = self.steps[-1].u
        assert u is not None
        return u

    @property
    def points(self) -> Mapping[str, Array]:
        """Positions of the nodes by field, shape ``(n_nodes, dim)``, a length."""
        return _ByField(list(self._fields), self._native.points)

    @property
    def cells(self) -> Mapping[str, dict[str, NDArray[np.int64]]]:
        """Nodes of the cells by field and kind, shape ``(n_cells, nodes of a cell)``, in the order of VTK; of fields whose
        elements have degree 1 or 2."""
        names = [n for n, f in self._fields.items() if f.place == "nodes"]

        def make(name: str) -> dict[str, Any]:
            found = self._native.cells(name)
            if found is None:
                raise KeyError(f"`{name}` has no cells of degree 1 or 2")
            return {kind: nodes for kind, _, nodes, _ in found}

        return _ByField(names, make)

    @property
    def measures(self) -> dict[str, Array]:
        """The step variable ``t`` and the measures as columns over the steps: ``pandas.DataFrame(result.measures)``."""
        import numpy as np

        columns = {"t": np.array([s.t for s in self.steps])}
        for name in self.steps[-1].measures if self.steps else ():
            columns[name] = np.array([s.measures.get(name, math.nan) for s in self.steps])
        return columns

    @property
    def times(self) -> Array:
        """The step variable at the end of each step, shape ``(n_steps,)``."""
        import numpy as np

        return np.array([s.t for s in self.steps])

    def to_pandas(self) -> pandas.DataFrame:
        """The measures as a table with a row a step; the step variable is its index."""
        import pandas

        return pandas.DataFrame(self.measures).set_index("t")

    @property
    def report(self) -> dict[str, Any]:
        """What ``report.json`` of a run has: sizes, times, checks (docs/results.md)."""
        return json.loads(self._report)

    def contact(self, region: str | None = None) -> Contact:
        """Contact at the points of a region with a law of contact, at the last step. The region may be left out where there
        is one."""
        if region is None:
            if len(self._contact) != 1:
                raise KeyError(f"regions with contact: {', '.join(self._contact) or 'none'}")
            region = next(iter(self._contact))
        if region not in self._contact:
            raise KeyError(f"no law of contact on `{region}`; regions with one: {', '.join(self._contact) or 'none'}")
        return Contact(region, self._contact[region])

    def outputs(self, step: int = -1) -> dict[str, list[dict[str, Any]]]:
        """What the ``output vtk`` statements give at a step, by name: pieces with ``points``, ``cells``, ``point_data`` and
        ``cell_data``. Of the steps that were kept: all of a small run, else the first, the middle and the last one."""
        return self._step_kept(step)["grids"]

    def tables(self, step: int = -1) -> dict[str, dict[str, Array]]:
        """What the ``output csv`` statements give at a step, by file: columns that pandas takes."""
        found = self._step_kept(step)["tables"]
        return {file: {n: rows[:, k] for k, n in enumerate(names)} for file, (names, rows) in found.items()}

    def _step_kept(self, step: int) -> dict[str, Any]:
        number = range(len(self.steps))[step]
        for kept in self._kept:
            if kept["number"] == number:
                return kept
        known = ", ".join(str(k["number"]) for k in self._kept) or "none"
        raise KeyError(f"the outputs of step {number} are not in memory (run without `out`, outputs=True); kept: {known}")

    def grids(self, step: int = -1) -> list[dict[str, Any]]:
        """The bodies with all fields that live on them at a step, as :meth:`outputs` has them; ``displacement`` is the
        first vector among the unknowns of each body. What the outputs of the scene give on a body or on faces is added."""
        import numpy as np

        state = self.steps[step].u
        if state is None:
            raise KeyError("the unknowns of that step were not kept: run(keep_states=True)")
        pieces = self._native.grids(state, self._known)
        dim = self._native.dim
        for piece in pieces:
            for name, values in list(piece["point_data"].items()):
                if self._fields[name].kind == "unknown" and self._fields[name].shape == (dim,) and dim > 1:
                    piece["point_data"].setdefault("displacement", values)
                    break
        number = range(len(self.steps))[step]
        outputs = [k["grids"] for k in self._kept if k["number"] == number]
        for name, found in (item for grids in outputs for item in grids.items()):
            for extra in found:
                same = [p for p in pieces if np.array_equal(p["points"], extra["points"])]
                home = same[0] if same else None
                if home is None:
                    pieces.append({**extra, "point_data": dict(extra["point_data"])})
                    continue
                for key in ("point_data", "cell_data"):
                    for array, values in extra[key].items():
                        known = home[key].get(array)
                        if known is None:
                            home[key][array] = values
                        elif known.shape != values.shape or not _same(known, values):
                            home[key][f"{name}:{array}"] = values
        return pieces

    def _merged(self, step: int) -> tuple[Array, list[Any], dict[str, Array], dict[str, list[Array]]]:
        """One grid of all pieces: points, blocks of cells, point data, cell data by block; nan where a piece lacks one."""
        import numpy as np

        pieces = self.grids(step)
        first = np.cumsum([0, *(len(p["points"]) for p in pieces)])
        points = np.concatenate([p["points"] for p in pieces])

        def wide(values: Array) -> Array:
            # two components are three in VTK: so vectors can be warped by
            if values.ndim == 2 and values.shape[1] == 2:
                return np.pad(values, ((0, 0), (0, 1)))
            return values

        def widths(key: str) -> dict[str, tuple[int, ...]]:
            return {n: wide(v).shape[1:] for p in pieces for n, v in p[key].items()}

        point_data: dict[str, Array] = {}
        for name, width in widths("point_data").items():
            whole = np.full((len(points), *width), math.nan)
            for k, piece in enumerate(pieces):
                if name in piece["point_data"]:
                    whole[first[k] : first[k + 1]] = wide(piece["point_data"][name])
            point_data[name] = whole
        blocks: list[Any] = []
        cell_data: dict[str, list[Array]] = {n: [] for n in widths("cell_data")}
        for k, piece in enumerate(pieces):
            for kind, number, nodes, at in piece["cells"]:
                blocks.append((kind, number, nodes + first[k]))
                for name, width in widths("cell_data").items():
                    values = piece["cell_data"].get(name)
                    none = np.full((len(at), *width), math.nan)
                    cell_data[name].append(none if values is None else wide(values)[at])
        return points, blocks, point_data, cell_data

    def to_meshio(self, step: int = -1) -> meshio.Mesh:
        """A mesh of meshio with the fields of all bodies and the outputs of the scene; vectors have three components, and
        what a body lacks is nan there."""
        import meshio

        points, blocks, point_data, cell_data = self._merged(step)
        return meshio.Mesh(points, [(kind, nodes) for kind, _, nodes in blocks], point_data, cell_data)

    def to_pyvista(self, step: int = -1) -> pyvista.UnstructuredGrid:
        """A grid of pyvista, as :meth:`to_meshio`: ``result.to_pyvista().warp_by_vector("displacement").plot()``."""
        import numpy as np
        import pyvista

        points, blocks, point_data, cell_data = self._merged(step)
        sized = [np.hstack([np.full((len(nodes), 1), nodes.shape[1]), nodes]).ravel() for _, _, nodes in blocks]
        kinds = np.concatenate([np.full(len(nodes), number, dtype=np.uint8) for _, number, nodes in blocks])
        grid = pyvista.UnstructuredGrid(np.concatenate(sized), kinds, points)
        for name, values in point_data.items():
            grid.point_data[name] = values
        for name, values in cell_data.items():
            grid.cell_data[name] = np.concatenate(values)
        return grid

    def _pages(self, at: Sequence[float]) -> tuple[str, Charts]:
        with tempfile.TemporaryDirectory() as folder:
            # results that were written are read where they are
            where = str(self.files[0].parent) if self.files else folder
            page, charts = self._outcome.pages(self._native, where, [float(t) for t in at])
        return page, Charts([Chart(*chart) for chart in charts])

    def plot(self, name: str | None = None, at: Sequence[float] = ()) -> Any:
        """The charts of the report, or the one of a name; maps and profiles at the values ``at`` of the step variable, or at
        the first, the middle and the last step. They show themselves in a notebook; ``chart.svg`` is the text."""
        charts = self._pages(at)[1]
        return charts if name is None else charts[name]

    def page(self, at: Sequence[float] = ()) -> str:
        """The page that ``wfl report`` makes, as HTML."""
        return self._pages(at)[0]

    def _repr_html_(self) -> str:
        last = self.steps[-1] if self.steps else None
        rows = "".join(
            f"<tr><td>{html.escape(n)}</td><td>{v:.9g}</td></tr>" for n, v in (last.measures if last else {}).items()
        )
        good = sum(s.converged for s in self.steps)
        head = f"{html.escape(self._native.name)}: {good} of {len(self.steps)} steps converged, {self.ending.replace('_', ' ')}"
        told = "".join(f"<pre>{html.escape(str(m))}</pre>" for m in self.messages)
        table = f"<table><tr><th>measure</th><th>at the end</th></tr>{rows}</table>" if rows else ""
        return f"<div><b>{head}</b>{told}{table}{self.plot()._repr_html_()}</div>"

    def __repr__(self) -> str:
        good = sum(s.converged for s in self.steps)
        return f"<wfl.Result {self._native.name}: {good} of {len(self.steps)} steps converged, {self.ending}>"
