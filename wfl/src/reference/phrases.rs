//! Words that need more than a row of a table.

use super::Phrase;

/// Words of regions and splits: how they are written, and what they mean.
pub(super) const PHRASES: &[Phrase] = &[
    Phrase {
        word: "interface",
        usage: "region f = interface from a to b\nregion f = interface along s\nregion f = interface along s towards [0,0,1]",
        text: "Faces with two sides. Integrals are taken from the side `here`, whose outward normal is Normal: plain names are \
         values there, Interpolate(u, neighbor_element) is the value on the side `there`. `from a to b` are the faces \
         between two regions of cells, `here` in a. `along s` are faces inside a body, say a surface of a mesh file (a \
         line in two dimensions), plane or curved: `here` lies on one side all over each connected sheet. `towards v` \
         chooses the side on which the integral of Normal.v is positive; v may depend on the position. Without it, the \
         largest component of the mean normal is positive (the first of equal ones), and normals of a closed sheet \
         point outwards. Where three or more faces meet at an edge the surface is divided into sheets. A surface with \
         one side, as a Moebius strip has, is E436. `wfl check` shows the sheets. A field is continuous across an \
         interface inside its region until it is split: split u across f.",
    },
    Phrase {
        word: "refine",
        usage: "refine where sqrt(x^2 + y^2) < 0.1 times 3\nrefine on r times 2\nrefine on r where z > 0 times 2 along x, y",
        text: "The size of the cells is halved `times` times, where the condition holds at the centre or a vertex of a cell, in \
         the cells of the regions, or at their faces and nodes. The mesh is refined before regions, interfaces, splits \
         and the map of the mesh are made on it. Triangles and tetrahedra are bisected; quadrilaterals and hexahedra are \
         divided in whole layers, through the opposite edges to the boundary, on a box in the directions behind `along` \
         only. `wfl check` shows the cells before and after.",
    },
    Phrase {
        word: "split",
        usage: "split u across f",
        text: "The field u may jump across the faces f, which lie inside the region of u. Each node of f gets one value for \
         each group of cells around it that hangs together without crossing f: two along a crack, also where it meets \
         the outer boundary; one at the front, where it ends inside the body; three where a T joins. All splits of a \
         field are made together. u - Interpolate(u, neighbor_element) is the jump on an interface; `wfl explain \
         interface` says how to declare one.",
    },
];
