//! Files of other programs: what they are, and the one command that makes a mesh that is read of them.

/// Comments behind `#`, then five numbers: nodes, cells, and numbers of values.
fn is_ucd(start: &[u8]) -> bool {
    let line = start.split(|b| *b == b'\n').map(<[u8]>::trim_ascii).find(|l| !l.is_empty() && !l.starts_with(b"#"));
    let words: Vec<&[u8]> = line.unwrap_or_default().split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect();
    words.len() == 5 && words.iter().all(|w| w.iter().all(u8::is_ascii_digit))
}

/// What a file seems to be, with the command that converts it.
pub(super) fn told(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    const GMSH: &str = "`gmsh part.med -save -o part.msh`";
    const MESHIO: &str = "`meshio convert part.ext part.vtu --ascii`";
    let start = &bytes[..bytes.len().min(512)];
    let line = start.split(|b| *b == b'\n').next().unwrap_or_default().trim_ascii();
    let text = |what: &str| start.windows(what.len()).any(|w| w == what.as_bytes());
    Some(match start {
        [0x89, b'H', b'D', b'F', ..] if bytes.windows(8).any(|w| w == b"ENS_MAA\0" || w == b"INFOS_GE") => {
            ("a MED file of Salome or Code_Aster", GMSH)
        }
        [0x89, b'H', b'D', b'F', ..] => ("an HDF5 file (Exodus, CGNS, XDMF, ...)", MESHIO),
        [b'C', b'D', b'F', 1 | 2 | 5, ..] => ("an Exodus file", MESHIO),
        _ if line.starts_with(b"# vtk DataFile") => ("a legacy file of VTK", MESHIO),
        _ if line.starts_with(b"MeshVersionFormatted") || line.starts_with(b"MeshVersionUnformatted") => {
            ("a Medit file", "`gmsh part.mesh -save -o part.msh`")
        }
        _ if line == b"-1" => ("a universal file (I-DEAS, Salome)", "`gmsh part.unv -save -o part.msh`"),
        _ if line == b"$NOD" => ("a Gmsh file of version 1", "`gmsh part.msh -save -format msh41 -o new.msh`"),
        _ if is_ucd(start) => ("an AVS-UCD file", "`meshio convert part.inp part.vtu --input-format avsucd --ascii`"),
        _ if line.starts_with(b"MFEM mesh") => ("a mesh of MFEM", "save it as .vtu there: `mesh.PrintVTU(\"part\")`"),
        _ if text("BEGIN BULK") || text("CEND") || text("GRID,") || text("GRID ") => {
            ("a Nastran file", "`gmsh part.bdf -save -o part.msh`")
        }
        _ if text("<Xdmf") => ("an XDMF file", MESHIO),
        _ if text("<dolfin") => ("a mesh of FEniCS in XML", MESHIO),
        _ if line.starts_with(b"solid ") || line.starts_with(b"OFF") || line.starts_with(b"ply") => {
            ("a surface without cells of volume", "mesh its inside first, as Gmsh does with `Merge` and `Surface Loop`")
        }
        _ => return None,
    })
}
