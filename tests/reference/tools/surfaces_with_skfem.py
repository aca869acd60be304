"""References of examples/surfaces: a pressurised T of two cracks, and a listric fault with Coulomb friction.

An independent program: meshes of gmsh (Python module), nodes on the cracks doubled here by the sectors of triangles
around them, quadratic triangles of scikit-fem 12, and contact by the compliances of the node pairs with an active set.
Plane strain, E = 25000, nu = 0.25.

    python3 surfaces_with_skfem.py tee 0.01 0.005 0.0025 0.00125    # opened areas: left, right half, branch
    python3 surfaces_with_skfem.py listric 0.04 0.02 0.01           # integral and largest slip, friction force

The numbers are sizes of the cells at the ends of the cracks. Printed by these two commands:

    tee      0.01     2.22536996e-04  2.22548443e-04  1.28276893e-04
    tee      0.005    2.22740879e-04  2.22769568e-04  1.28425031e-04
    tee      0.0025   2.22864207e-04  2.22868909e-04  1.28487683e-04
    tee      0.00125  2.22932050e-04  2.22930960e-04  1.28517560e-04
    listric  0.04     9.29296116e-04  4.52995327e-04  1.21216640e+01
    listric  0.02     9.28977902e-04  4.52989330e-04  1.21259166e+01
    listric  0.01     9.28810586e-04  4.53023100e-04  1.21265457e+01
"""

import math
import sys

import gmsh
import numpy as np
from scipy.sparse.linalg import splu
from skfem import Basis, ElementTriP2, ElementVector, MeshTri
from skfem.models.elasticity import linear_elasticity

YOUNG, POISSON, FRICTION, PRESSURE = 25000.0, 0.25, 0.4, 2.0
EDGES = [(0, 1, 3), (1, 2, 4), (2, 0, 5)]
SIMPSON = np.array([1 / 6, 1 / 6, 4 / 6])
# the listric fault: an arc from the top (dip 60 degrees) to a depth of 2.42 (dip 10 degrees)
WIDTH, DEPTH, RADIUS, OUTCROP = 10.0, 5.0, 5.0, 3.0
DIPS = math.radians(60), math.radians(10)


def mesh_of(build, size):
    """Nodes, triangles of six nodes, and the lines of three nodes of each crack."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    cracks = build(size)
    for name in ["ExtendFromBoundary", "FromPoints", "FromCurvature"]:
        gmsh.option.setNumber("Mesh.MeshSize" + name, 0)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    place = {int(t): i for i, t in enumerate(tags)}
    numbers = lambda dim, tag, n: np.array(
        [place[int(t)] for t in gmsh.model.mesh.getElements(dim, tag)[2][0]]
    ).reshape(-1, n)
    triangles = numbers(2, -1, 6)
    lines = [numbers(1, crack, 3) for crack in cracks]
    gmsh.finalize()
    return xyz.reshape(-1, 3)[:, :2], triangles, lines


def sectors(around, triangles, cut):
    """Groups of the triangles `around` a node that hang together through edges that are not cut."""
    by_edge = {}
    for t in around:
        for a, b, _ in EDGES:
            edge = tuple(sorted((triangles[t][a], triangles[t][b])))
            if edge not in cut:
                by_edge.setdefault(edge, []).append(t)
    beyond = {t: set() for t in around}
    for pair in by_edge.values():
        for t in pair:
            beyond[t].update(pair)
    groups, left = [], list(around)
    while left:
        group, todo = set(), [left[0]]
        while todo:
            t = todo.pop()
            if t not in group:
                group.add(t)
                todo.extend(beyond[t])
        groups.append(group)
        left = [t for t in left if t not in group]
    return groups


def split(x, triangles, lines):
    """Doubles nodes; gives nodes, triangles, and by crack the triples of nodes on the left and right of each line."""
    cut = {tuple(sorted(line[:2])) for crack in lines for line in crack}
    on = {n for crack in lines for line in crack for n in line}
    around = {}
    for t, nodes in enumerate(triangles):
        for n in nodes:
            if n in on:
                around.setdefault(n, []).append(t)
    x, new = list(map(tuple, x)), triangles.copy()
    for n in sorted(on):
        for group in sectors(around[n], triangles, cut)[1:]:
            x.append(x[n])
            for t in group:
                new[t][list(triangles[t]).index(n)] = len(x) - 1
    x = np.array(x)
    owners = {}
    for t, nodes in enumerate(triangles):
        for a, b, m in EDGES:
            edge = tuple(sorted((nodes[a], nodes[b])))
            if edge in cut:
                owners.setdefault(edge, []).append((t, a, b, m))
    sides = [[both_sides(line, x, triangles, new, owners) for line in crack] for crack in lines]
    return x, new, sides


def both_sides(line, x, triangles, new, owners):
    along = x[line[1]] - x[line[0]]
    to_left = np.array([-along[1], along[0]])
    found = {}
    for t, a, b, m in owners[tuple(sorted(line[:2]))]:
        a, b = (a, b) if triangles[t][a] == line[0] else (b, a)
        centre = x[new[t][:3]].mean(0) - x[line[0]]
        found[centre @ to_left > 0] = (new[t][a], new[t][b], new[t][m])
    return found[True], found[False]


class Body:
    """Stiffness of quadratic triangles, and the dofs of each node."""

    def __init__(self, x, triangles):
        vertices = np.unique(triangles[:, :3])
        place = -np.ones(len(x), int)
        place[vertices] = np.arange(len(vertices))
        mesh = MeshTri(x[vertices].T.copy(), place[triangles[:, :3]].T.copy())
        basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
        first = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
        self.stiffness = linear_elasticity(first, YOUNG / (2 * (1 + POISSON))).assemble(basis).tocsc()
        self.n = self.stiffness.shape[0]
        self.dofs = np.full((len(x), 2), -1)
        for n in vertices:
            self.dofs[n] = basis.nodal_dofs[:, place[n]]
        for t, nodes in enumerate(triangles):
            facets = {tuple(sorted(mesh.facets[:, f])): f for f in mesh.t2f[:, t]}
            for a, b, m in EDGES:
                facet = facets[tuple(sorted((place[nodes[a]], place[nodes[b]])))]
                self.dofs[nodes[m]] = basis.facet_dofs[:, facet]

    def solver(self, fixed):
        free = np.setdiff1d(np.arange(self.n), fixed)
        factor = splu(self.stiffness[free][:, free].tocsc())

        def solve(load):
            u = np.zeros(load.shape)
            u[free] = factor.solve(load[free])
            return u

        return solve


def normal_of(line, x):
    """Normal to the left of a line, as long as the line."""
    along = x[line[1]] - x[line[0]]
    return np.array([-along[1], along[0]])


def sized(fields, formula):
    field = gmsh.model.mesh.field
    for k, (kind, tags) in enumerate(fields, 1):
        field.add("Distance", k)
        field.setNumbers(k, kind, tags)
        if kind == "CurvesList":
            field.setNumber(k, "Sampling", 1000)
    field.add("MathEval", 9)
    field.setString(9, "F", formula)
    field.setAsBackgroundMesh(9)


def build_tee(size):
    geo = gmsh.model.geo
    corners = [(-6, -6), (6, -6), (6, 6), (-6, 6), (-1, 0), (0, 0), (1, 0), (0, -1)]
    points = [geo.addPoint(*p, 0) for p in corners]
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (5, 7)]
    lines = [geo.addLine(points[a], points[b]) for a, b in ends]
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines[:4])])
    geo.synchronize()
    gmsh.model.mesh.embed(1, lines[4:], 2, surface)
    sized([("PointsList", points[4:])], f"{size} + 0.1*F1")
    return lines[4:]


def tee(size):
    x, triangles, sides = split(*mesh_of(build_tee, size))
    body = Body(x, triangles)
    load = np.zeros(body.n)
    for left, right in (pair for crack in sides for pair in crack):
        for k in range(3):
            force = PRESSURE * SIMPSON[k] * normal_of(left, x)
            load[body.dofs[left[k]]] += force
            load[body.dofs[right[k]]] -= force
    at = lambda p: body.dofs[np.argmin(np.abs(x - p).sum(1))]
    u = body.solver([*at([-6, -6]), at([6, -6])[1]])(load)
    jump = lambda left, right, k: u[body.dofs[left[k]]] - u[body.dofs[right[k]]]
    opened = lambda left, right: sum(SIMPSON[k] * jump(left, right, k) @ normal_of(left, x) for k in range(3))
    print("tee     ", size, *(f"{sum(opened(*pair) for pair in crack):.8e}" for crack in sides))


def build_listric(size):
    geo = gmsh.model.geo
    steep, flat = DIPS
    arc = lambda d: (OUTCROP + RADIUS * (math.sin(steep) - math.sin(d)), RADIUS * (math.cos(steep) - math.cos(d)))
    centre = (OUTCROP + RADIUS * math.sin(steep), RADIUS * math.cos(steep))
    corners = [(0, -DEPTH), (WIDTH, -DEPTH), (WIDTH, 0), arc(steep), (0, 0), arc(flat), centre]
    points = [geo.addPoint(*p, 0) for p in corners]
    lines = [geo.addLine(points[a], points[b]) for a, b in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]]
    fault = geo.addCircleArc(points[3], points[6], points[5])
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.synchronize()
    gmsh.model.mesh.embed(1, [fault], 2, surface)
    fields = [("PointsList", [points[3], points[5]]), ("CurvesList", [fault])]
    sized(fields, f"min({size} + 0.15*F1, {12 * size} + 0.2*F2)")
    return [fault]


def contact(compliance, gap):
    """Forces (normal, tangential by pair) of Coulomb friction: an active set on `jump = gap - compliance forces`."""
    pairs = len(gap) // 2
    state = ["stick"] * pairs
    while True:
        matrix, right = compliance.copy(), gap.copy()
        for i, s in enumerate(state):
            n, t = 2 * i, 2 * i + 1
            for row in [n, t] if s == "open" else [t] if s != "stick" else []:
                matrix[row], right[row] = 0, 0
                matrix[row, row] = 1
            if s in (-1, 1):
                matrix[t, n] = -s * FRICTION
        force = np.linalg.solve(matrix, right)
        jump = gap - compliance @ force
        after = list(state)
        for i, s in enumerate(state):
            n, t = 2 * i, 2 * i + 1
            if s == "open":
                after[i] = "stick" if jump[n] > 1e-14 else s
            elif force[n] < 0:
                after[i] = "open"
            elif s == "stick" and abs(force[t]) > FRICTION * force[n] * (1 + 1e-12):
                after[i] = 1 if force[t] > 0 else -1
            elif s in (-1, 1) and s * jump[t] < 0:
                after[i] = "stick"
        if after == state:
            return force, jump
        state = after


def pressed(body, x, triangles, on, traction, load):
    for nodes in triangles:
        for a, b, m in EDGES:
            if on(x[nodes[a]]) and on(x[nodes[b]]):
                length = np.linalg.norm(x[nodes[a]] - x[nodes[b]])
                for node, weight in zip((nodes[a], nodes[b], nodes[m]), SIMPSON):
                    load[body.dofs[node]] += weight * length * np.array(traction)


def listric(size):
    x, triangles, sides = split(*mesh_of(build_listric, size))
    body = Body(x, triangles)
    load = np.zeros(body.n)
    pressed(body, x, triangles, lambda p: abs(p[1]) < 1e-9, (0.0, -10.0), load)
    pressed(body, x, triangles, lambda p: abs(p[0] - WIDTH) < 1e-9, (-3.0, 0.0), load)
    fixed = [body.dofs[i][1] for i in np.flatnonzero(np.abs(x[:, 1] + DEPTH) < 1e-9)]
    fixed += [body.dofs[i][0] for i in np.flatnonzero(np.abs(x[:, 0]) < 1e-9)]
    solve = body.solver(np.unique(fixed))
    weights = {}
    for left, right in sides[0]:
        normal = -normal_of(left, x)
        for k in range(3):
            if left[k] != right[k]:
                weights.setdefault((left[k], right[k]), np.zeros(3))
                weights[left[k], right[k]] += SIMPSON[k] * np.array([*normal, np.linalg.norm(normal)])
    pairs = np.zeros((body.n, 2 * len(weights)))
    for i, ((left, right), w) in enumerate(weights.items()):
        n = w[:2] / np.linalg.norm(w[:2])
        for column, direction in ((2 * i, n), (2 * i + 1, np.array([-n[1], n[0]]))):
            pairs[body.dofs[left], column] += direction
            pairs[body.dofs[right], column] -= direction
    force, jump = contact(pairs.T @ solve(pairs), pairs.T @ solve(load))
    slip, lengths = np.abs(jump[1::2]), np.array([w[2] for w in weights.values()])
    print("listric ", size, f"{lengths @ slip:.8e} {slip.max():.8e} {np.abs(force[1::2]).sum():.8e}")


if __name__ == "__main__":
    for argument in sys.argv[2:]:
        {"tee": tee, "listric": listric}[sys.argv[1]](float(argument))
