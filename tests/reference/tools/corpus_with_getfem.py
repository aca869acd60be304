#!/usr/bin/env python3
"""Assemble every case of a conformance corpus with GetFEM and write the numbers into it.

    corpus_with_getfem.py IN.json OUT.json

Needs GetFEM's Python interface (Debian: python3-getfem). A case whose residual GetFEM differentiates wrongly (its
tangent is more than 1e-4 away from central differences of its residual), or which it refuses without the mark
`reject`, is left out and named.
"""

import copy
import json
import sys

import getfem as gf
import numpy as np

TRANSFORMATION = {"tri": "GT_PK(2,1)", "quad": "GT_QK(2,1)", "tet": "GT_PK(3,1)", "hex": "GT_QK(3,1)", "line": "GT_PK(1,1)"}
DIMENSION = {"tri": 2, "quad": 2, "tet": 3, "hex": 3, "line": 1}
FACES = {"tri": 3, "quad": 4, "tet": 4, "hex": 6, "line": 2}


def element(space, cell):
    family = "PK" if cell in ("tri", "tet", "line") else "QK"
    return gf.Fem(f"FEM_{family}({DIMENSION[cell]},{int(space[1])})")


def faces(mesh, nodes, cells, wanted):
    """[cells, local faces] of faces given by their nodes."""

    def nearest(p):
        return int(np.argmin(np.linalg.norm(nodes - p, axis=1)))

    found = []
    for cell, ids in wanted:
        for k in range(FACES[cells[cell][0]]):
            points = mesh.pts(mesh.pid_in_faces(np.array([[cell], [k]]))).T
            if {nearest(p) for p in points} == set(ids):
                found.append((cell, k))
    assert len(found) == len(wanted)
    return np.array(found).T


def field(model, mesh, cells, name, f):
    """Adds a finite element field; returns position and component of each of its degrees of freedom."""
    n = f["components"]
    space = gf.MeshFem(mesh, n)
    for i in f["cells"]:
        space.set_fem(element(f["space"], cells[i][0]), [i])
    at = space.basic_dof_nodes()
    table = [(np.ravel(p).astype(float), np.ravel(v)) for p, v in f["values"]]
    values, places = np.zeros(space.nbdof()), []
    for d in range(space.nbdof()):
        point, value = min(table, key=lambda row: np.linalg.norm(row[0] - at[:, d]))
        assert np.linalg.norm(point - at[:, d]) < 1e-9
        values[d] = value[d % n]
        places.append((point.tolist(), d % n))
    if f["role"] == "variable":
        model.add_fem_variable(name, space)
        model.set_variable(name, values)
        return places
    model.add_initialized_fem_data(name, space, values)
    return None


def set_up(corpus, case):
    described = corpus["meshes"][case["mesh"]]
    cells = described["cells"]
    nodes = np.array(described["nodes"], float).reshape(len(described["nodes"]), -1)
    mesh = gf.Mesh("empty", described["dim"])
    for cell, ids in cells:
        mesh.add_convex(gf.GeoTrans(TRANSFORMATION[cell]), nodes[ids].T)
    rules = gf.MeshIm(mesh)
    for i, (cell, _) in enumerate(cells):
        rules.set_integ(gf.Integ(corpus["quadratures"][case["quadrature"][cell]]["getfem"]), [i])
    model, dofs = gf.Model("real"), []
    for name, f in sorted(case["fields"].items()):
        if f["kind"] == "global":
            values = np.ravel(f["values"]).astype(float)
            model.add_variable(name, len(values))
            model.set_variable(name, values)
            places = [(None, k) for k in range(len(values))]
        else:
            places = field(model, mesh, cells, name, f)
        dofs += [(name, at, k, i) for i, (at, k) in enumerate(places or [])]
    for name, data in case["data"].items():
        values = np.ravel(data["values"]).astype(float)
        if len(data["shape"]) < 2:
            model.add_initialized_data(name, values)
        else:
            model.add_initialized_data(name, values, data["shape"])
    for head, body in case["macros"]:
        model.add_macro(head, body)
    region = case["region"]
    if region["kind"] == "cells":
        mesh.set_region(1, np.array([region["cells"], [-1] * len(region["cells"])]))
    else:
        mesh.set_region(1, faces(mesh, nodes, cells, region["faces"]))
    dofs = [(name, at, k, model.interval_of_variable(name)[0] + i) for name, at, k, i in dofs]
    return model, rules, sorted(dofs, key=lambda d: (d[0], d[1] or [], d[2]))


def assembled(corpus, case):
    """The numbers of a case: dofs, scalar, residual and tangent, as far as its order has them."""
    model, rules, dofs = set_up(corpus, case)
    places = [d[3] for d in dofs]

    def order(k):
        return gf.asm_generic(rules, k, case["expression"], 1, model)

    out = {"dofs": [[name, at, k] for name, at, k, _ in dofs]}
    if case["order"] == 0:
        out["scalar"] = float(order(0))
    if case["order"] <= 1:
        out["residual"] = np.ravel(order(1))[places].tolist()
    tangent = order(2).full()[np.ix_(places, places)]
    out["tangent"] = [[int(i), int(j), float(tangent[i, j])] for i, j in zip(*np.nonzero(tangent))]
    return out


def shifted(case, dof, by):
    name, at, k = dof
    moved = copy.deepcopy(case)
    f = moved["fields"][name]
    if f["kind"] == "global":
        f["values"] = np.ravel(f["values"]).astype(float).tolist()
        f["values"][k] += by
        return moved
    for row in f["values"]:
        if np.allclose(np.ravel(row[0]), at):
            row[1] = np.ravel(row[1]).astype(float).tolist()
            row[1][k] += by
    return moved


def tangent_error(corpus, case, numbers, step=1e-6):
    n = len(numbers["dofs"])
    tangent, differences = np.zeros((n, n)), np.zeros((n, n))
    for i, j, value in numbers["tangent"]:
        tangent[i, j] = value
    for j, dof in enumerate(numbers["dofs"]):
        up, down = (np.array(assembled(corpus, shifted(case, dof, s * step))["residual"]) for s in (1, -1))
        differences[:, j] = (up - down) / (2 * step)
    return np.abs(tangent - differences).max() / max(1e-12, np.abs(tangent).max())


def rounded(x):
    if isinstance(x, float):
        return float(f"{x:.13g}")
    if isinstance(x, list):
        return [rounded(y) for y in x]
    return {k: rounded(v) for k, v in x.items()} if isinstance(x, dict) else x


def main(source, target):
    corpus = json.load(open(source))
    kept = []
    for case in corpus["cases"]:
        try:
            numbers = assembled(corpus, case)
        except Exception as error:  # the interface raises one kind for everything it refuses
            if case.get("reject"):
                kept.append(case)
            else:
                print(f"left out, GetFEM refuses it: {case['id']}: {str(error).strip().splitlines()[-1]}")
            continue
        if case.get("reject"):
            print(f"left out, GetFEM accepts it: {case['id']}")
        elif case["order"] < 2 and not tangent_error(corpus, case, numbers) < 1e-4:
            print(f"left out, GetFEM's tangent is wrong: {case['id']}")
        else:
            kept.append(case | rounded(numbers))
    corpus["cases"] = kept
    json.dump(corpus, open(target, "w"), separators=(",", ":"))
    print(f"{len(kept)} cases")


if __name__ == "__main__":
    main(*sys.argv[1:])
