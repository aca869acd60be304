//! The mesh files of a scene: read before anything else, because they have its dimension; then placed and put together.

use std::path::Path;

use wfl::{
    Code, Diagnostic, ResolvedScript, Span,
    ast::{Expr, MeshFile, MeshSource, Placing},
    nearest,
};
use wfl_host::{
    input::{InputError, InputKind},
    reading::{self, ReadingError},
};
use wfl_mesh::mesh::{
    Mesh, MeshError, Placement, Together,
    read::{ReadError, mesh_beside},
    together,
};
use wfl_output::Hash;

use super::{
    InputFile,
    constants::{bare_env, number, numbers},
    mesh::{MeshMaker, mesh_error, too_much_memory},
};

/// The meshes of the files, in their order; `None` for a box, and after a message.
pub(super) fn read(
    script: &ResolvedScript,
    folder: &Path,
    inputs: &mut Vec<InputFile>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Vec<Mesh>> {
    let MeshSource::Files(files) = &script.mesh.as_ref()?.source else { return None };
    // a message for each of them
    let meshes: Vec<Option<Mesh>> = files.iter().map(|file| read_one(file, folder, inputs, diagnostics)).collect();
    meshes.into_iter().collect()
}

fn read_one(
    file: &MeshFile,
    folder: &Path,
    inputs: &mut Vec<InputFile>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Mesh> {
    let MeshFile { path, span, .. } = file;
    let bytes = match reading::bytes(folder, folder, path, InputKind::Mesh) {
        Ok(bytes) => bytes,
        Err(e) => {
            let near =
                if matches!(e, ReadingError::Input(InputError::NotFound)) { similar(folder, path) } else { None };
            let d = unread(&e, Code::E410, &format!("cannot use the mesh file `{path}`"));
            diagnostics.push(match near {
                Some(near) => d.at(*span, format!("did you mean `{near}`?")).replace(*span, format!("\"{near}\"")),
                None => d.at(*span, ""),
            });
            return None;
        }
    };
    let input = InputFile::new(folder, path, Hash::of(&bytes));
    if !inputs.contains(&input) {
        inputs.push(input);
    }
    let mut beside = |name: &str| {
        let path = neighbour(path, name);
        let bytes = reading::bytes(folder, folder, &path, InputKind::Mesh)?;
        let input = InputFile::new(folder, &path, Hash::of(&bytes));
        if !inputs.contains(&input) {
            inputs.push(input);
        }
        Ok(bytes)
    };
    match mesh_beside(&bytes, &mut beside) {
        Ok(mesh) => {
            diagnostics.extend(torn(&mesh, *span));
            diagnostics.extend(turned(&mesh, *span));
            Some(mesh)
        }
        Err(ReadError::Mesh(MeshError::TooMuchMemory(need))) => {
            diagnostics.push(too_much_memory(&need, *span));
            None
        }
        Err(e) => {
            let what = format!("cannot use the mesh file `{path}`: {e}");
            let error = e.included();
            let d = Diagnostic::new(error.map_or(Code::E410, |error| code_of(error, Code::E410)), what).at(*span, "");
            diagnostics.push(match error.and_then(ReadingError::help) {
                Some(help) => d.help(help),
                None => d,
            });
            None
        }
    }
}

/// The name of a file beside another one.
fn neighbour(path: &str, name: &str) -> String {
    match path.rsplit_once('/') {
        Some((folder, _)) if !name.starts_with('/') => format!("{folder}/{name}"),
        _ => name.to_owned(),
    }
}

/// W405 for nodes at one place that are not joined.
fn torn(mesh: &Mesh, span: Span) -> Option<Diagnostic> {
    let twins = &mesh.warnings().duplicate_nodes;
    let (a, b) = twins.first()?;
    let [a_at, b_at] = [a, b].map(|n| &mesh.nodes()[n.index()][..mesh.dim()]);
    let [a, b] = [a, b].map(|n| mesh.numbers().node(*n));
    let d = Diagnostic::new(
        Code::W405,
        format!("{} pairs of nodes of one body have the same coordinates but are not joined", twins.len()),
    );
    let first = format!("the first pair: {a} at {a_at:?} and {b} at {b_at:?}");
    Some(d.at(span, first).help("the body is torn there; merge them in the mesh generator"))
}

/// W423 for cells of a file that ran clockwise.
fn turned(mesh: &Mesh, span: Span) -> Option<Diagnostic> {
    let cells = &mesh.warnings().turned_cells;
    let first = mesh.numbers().cell(*cells.first()?);
    let many = match (cells.len(), mesh.n_cells()) {
        (1, _) => "1 cell runs".to_owned(),
        (n, all) if n == all => format!("all {n} cells run"),
        (n, _) => format!("{n} cells run"),
    };
    let d = Diagnostic::new(Code::W423, format!("{many} clockwise in this file, and were turned"));
    let d = d.at(span, format!("the first is {first}; places, groups and results are not changed by that"));
    Some(d.help("in Gmsh: reverse the curve loop of the surface, or Reverse Surface{..}"))
}

/// A file that cannot be had: E217 if the scene may not read it, E606 if it is too large, else `code`.
pub(super) fn unread(error: &ReadingError, code: Code, what: &str) -> Diagnostic {
    let d = Diagnostic::new(code_of(error, code), format!("{what}: {error}"));
    match error.help() {
        Some(help) => d.help(help),
        None => d,
    }
}

fn code_of(error: &ReadingError, code: Code) -> Code {
    match error {
        ReadingError::Outside { .. } => Code::E217,
        ReadingError::Input(InputError::TooLarge(_)) => Code::E606,
        ReadingError::Input(_) => code,
    }
}

/// The mesh file beside a missing one whose name is nearest.
fn similar(folder: &Path, path: &str) -> Option<String> {
    let (inner, wanted) = path.rsplit_once('/').unwrap_or(("", path));
    let files = std::fs::read_dir(folder.join(inner)).ok()?;
    let names = files.filter_map(|f| f.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|n| [".msh", ".inp", ".vtu"].iter().any(|e| n.ends_with(e))).collect();
    names.sort_unstable();
    let near = nearest(wanted, names.iter().map(String::as_str))?;
    Some(if inner.is_empty() { near.to_owned() } else { format!("{inner}/{near}") })
}

impl MeshMaker<'_> {
    /// The meshes of the files as one, each at its place; one that stays where it is is not touched.
    pub(super) fn placed(&mut self, files: &[MeshFile], mut meshes: Vec<Mesh>) -> Option<Mesh> {
        if meshes.len() == 1 && files.iter().all(|f| f.placed.is_empty()) {
            return meshes.pop();
        }
        let dim = meshes.first()?.dim();
        let mut placed = Vec::with_capacity(meshes.len());
        for (file, mesh) in files.iter().zip(meshes) {
            let mut place = Placement::default();
            for step in &file.placed {
                place = self.step(place, step, dim)?;
            }
            placed.push((mesh, place));
        }
        let span = self.script.mesh.as_ref()?.span;
        match together(placed) {
            Ok(Together { mesh, joined }) => {
                if !joined.is_empty() {
                    let names = joined.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
                    let d = Diagnostic::new(Code::W703, format!("groups of several mesh files have one name: {names}"));
                    let d = d.at(span, "each of them is one region here, with the members of all files");
                    self.diagnostics.push(d.help("give them names of their own in the files to tell them apart"));
                }
                Some(mesh)
            }
            Err(MeshError::TooMuchMemory(need)) => {
                self.diagnostics.push(too_much_memory(&need, span));
                None
            }
            Err(e) => {
                self.diagnostics.push(mesh_error(&e, span));
                None
            }
        }
    }

    fn step(&mut self, place: Placement, step: &Placing, dim: usize) -> Option<Placement> {
        let env = bare_env(self.script, dim, self.params);
        match step {
            Placing::Moved(e) => {
                let by = numbers(&env, "a motion", e, self.diagnostics)?;
                if by.len() != dim {
                    return self.misplaced(e, format!("a motion has {dim} components here, found {}", by.len()));
                }
                Some(place.moved(std::array::from_fn(|d| by.get(d).copied().unwrap_or(0.0))))
            }
            Placing::Scaled(e) => {
                let factor = number(&env, "a factor", e, self.diagnostics)?;
                if factor <= 0.0 {
                    return self.misplaced(e, format!("a factor is above 0, found {factor}"));
                }
                Some(place.scaled(factor))
            }
            Placing::Turned(e, axis) => {
                let degrees = number(&env, "an angle", e, self.diagnostics)?;
                let axis = match axis {
                    None if dim == 2 => [0.0, 0.0, 1.0],
                    None => {
                        return self.misplaced(e, "in space a turn needs its axis: about [0,0,1]".to_owned());
                    }
                    Some(axis) if dim < 3 => {
                        return self
                            .misplaced(axis, "in the plane a turn is about the origin, without an axis".to_owned());
                    }
                    Some(axis) => {
                        let found = numbers(&env, "an axis", axis, self.diagnostics)?;
                        if found.len() != 3 || found.iter().all(|x| *x == 0.0) {
                            return self.misplaced(axis, "an axis has three components that are not all 0".to_owned());
                        }
                        [found[0], found[1], found[2]]
                    }
                };
                if dim == 1 {
                    return self.misplaced(e, "a line cannot be turned".to_owned());
                }
                Some(place.turned(degrees, axis))
            }
        }
    }

    fn misplaced<T>(&mut self, e: &Expr, what: String) -> Option<T> {
        self.diagnostics.push(Diagnostic::new(Code::E718, what).at(e.span, ""));
        None
    }
}
