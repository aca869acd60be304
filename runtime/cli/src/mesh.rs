//! `wfl mesh`: what a mesh file holds, how good it is, and a picture of it.

use std::{path::Path, process::ExitCode};

use serde_json::{Map, Value};
use wfl_host::{
    input::{InputKind, read_input},
    reading,
};
use wfl_mesh::mesh::{
    CellShape, GroupEntities, Mesh, RegionSet, Topology, cell_shapes, cell_volumes, divided_facets, element_sizes,
    facet_measures, facets_against,
    read::{DeckNotes, DeckPair, deck_notes, mesh_beside},
};
use wfl_problem::region_name;
use wfl_report::{MeshColours, mesh_picture};

use crate::{
    args_mesh::MeshArgs,
    check::mesh_table,
    load::{out, say},
    plot,
    prepared::EXIT_ERROR,
    table::{Table, number},
};

pub(crate) fn mesh(args: &MeshArgs) -> ExitCode {
    match told(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            say(&message);
            ExitCode::from(EXIT_ERROR)
        }
    }
}

fn told(args: &MeshArgs) -> Result<(), String> {
    let name = args.file.display();
    let bytes = read_input(&args.file, InputKind::Mesh).map_err(|e| format!("error: cannot read {name}: {e}\n"))?;
    let folder = args.file.parent().unwrap_or(Path::new(""));
    let mut beside = |name: &str| reading::bytes(folder, folder, name, InputKind::Mesh);
    let mesh = mesh_beside(&bytes, &mut beside).map_err(|e| {
        let help = e.included().and_then(reading::ReadingError::help).map(|help| format!("help: {help}\n"));
        format!("error[E410]: cannot use the mesh file {name}: {e}\n{}", help.unwrap_or_default())
    })?;
    let topology = Topology::new(&mesh).map_err(|e| format!("error[E410]: cannot use the mesh file {name}: {e}\n"))?;
    let notes = deck_notes(&bytes, &mut beside);
    let lines = scene_lines(&mesh, &notes.pairs);
    let tables = [
        mesh_table(&mesh),
        total(&mesh),
        regions(&mesh, &topology),
        quality(&mesh),
        odd(&mesh, &topology),
        left_out(&notes),
    ];
    if args.json {
        let mut all = Map::new();
        all.insert("file".to_owned(), name.to_string().into());
        for table in &tables {
            all.insert(table.name.replace(' ', "_"), table.json());
        }
        all.insert("scene_lines".to_owned(), lines.into());
        out(&format!("{:#}\n", Value::Object(all)));
    } else {
        let mut texts: Vec<String> = tables.iter().map(Table::text).filter(|t| !t.is_empty()).collect();
        if !lines.is_empty() {
            texts.push(format!("contact of the deck, as lines of a scene\n  {}\n", lines.join("\n  ")));
        }
        out(&texts.join("\n"));
    }
    drawn(args, &mesh)
}

/// Writes the pictures that are asked for.
fn drawn(args: &MeshArgs, mesh: &Mesh) -> Result<(), String> {
    if args.png.is_none() && args.svg.is_none() && args.pdf.is_none() {
        return Ok(());
    }
    plot::endings(&[(&args.png, "png"), (&args.svg, "svg"), (&args.pdf, "pdf")])?;
    let groups = mesh.groups().iter().filter(|g| matches!(g.entities, GroupEntities::Cells(_))).count();
    let by_itself = if groups > 1 { MeshColours::Regions } else { MeshColours::Angle };
    let colours = args.colours.map_or(by_itself, crate::args_mesh::Colours::of_picture);
    let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let picture = mesh_picture(mesh, &stem, colours, args.view);
    let picture = picture.ok_or("error: a mesh of lines is not drawn\n")?;
    if let Some(file) = &args.png {
        plot::write(file, &picture.chart.png().map_err(|e| format!("error: {e}\n"))?)?;
    }
    if let Some(file) = &args.pdf {
        plot::write(file, &picture.chart.pdf().map_err(|e| format!("error: {e}\n"))?)?;
    }
    match &args.svg {
        Some(file) => plot::write(file, picture.chart.svg().as_bytes()),
        None => Ok(()),
    }
}

fn total(mesh: &Mesh) -> Table {
    let cells: Vec<_> = mesh.cells().collect();
    let mut bodies: Vec<u32> = {
        let of_node = mesh.bodies();
        cells.iter().map(|c| of_node[mesh.cell_nodes(*c)[0].index()]).collect()
    };
    bodies.sort_unstable();
    bodies.dedup();
    let mut table = Table::new("total", &["what", "size", "bodies"]);
    let size: f64 = cell_volumes(mesh, &cells).iter().sum();
    table.push(vec![["length", "area", "volume"][mesh.dim() - 1].into(), size.into(), bodies.len().into()]);
    table
}

/// Elements of a deck that are no cells.
fn left_out(notes: &DeckNotes) -> Table {
    let mut table = Table::new("left out", &["elements", "lines"]);
    for (kind, lines) in &notes.left_out {
        table.push(vec![kind.clone().into(), (*lines).into()]);
    }
    table
}

/// The groups of the file by the names that a scene has for them.
fn regions(mesh: &Mesh, topology: &Topology) -> Table {
    let mut table = Table::new("regions", &["region", "of", "members", "size", "name in the file"]);
    for group in mesh.groups() {
        let name = region_name(&group.name);
        let (of, members, size) = match RegionSet::from_group(mesh, topology, group) {
            Ok(RegionSet::Cells(list)) => ("cells", list.len(), cell_volumes(mesh, &list).iter().sum::<f64>().into()),
            Ok(RegionSet::Facets(list)) => {
                ("faces", list.len(), facet_measures(mesh, &list).iter().sum::<f64>().into())
            }
            Ok(RegionSet::Nodes(list)) => ("nodes", list.len(), Value::Null),
            Ok(RegionSet::Interface(list)) => ("interface", list.len(), Value::Null),
            Ok(RegionSet::Edges(list)) => ("edges", list.len(), Value::Null),
            Err(e) => {
                table.push(vec![name.into(), "cannot be used".into(), 0.into(), Value::Null, e.to_string().into()]);
                continue;
            }
        };
        let in_file = if name == group.name { "".into() } else { Value::from(group.name.clone()) };
        table.push(vec![name.into(), of.into(), members.into(), size, in_file]);
    }
    table
}

/// The worst of each number, and where it is.
fn quality(mesh: &Mesh) -> Table {
    let mut table = Table::new("quality", &["what", "smallest", "in", "largest", "in "]);
    let cells: Vec<_> = mesh.cells().collect();
    let sizes = element_sizes(mesh, &cells);
    let shapes = cell_shapes(mesh);
    let of = |number: fn(&CellShape) -> f64| shapes.iter().map(number).collect::<Vec<f64>>();
    let mut row = |what: &str, low: &[f64], high: &[f64]| {
        let end = |values: &[f64], sign: f64| {
            let least = (0..values.len()).min_by(|a, b| (sign * values[*a]).total_cmp(&(sign * values[*b])));
            let found = least.map(|k| (values[k], mesh.numbers().cell(cells[k]).to_string()));
            found.map_or([Value::Null, Value::Null], |(x, cell)| [digits(x), cell.into()])
        };
        let ([a, b], [c, d]) = (end(low, 1.0), end(high, -1.0));
        table.push(vec![what.into(), a, b, c, d]);
    };
    row("size", &sizes, &sizes);
    if mesh.dim() > 1 {
        row("angle", &of(|s| s.angles[0]), &of(|s| s.angles[1]));
        row("aspect", &of(|s| s.aspect), &of(|s| s.aspect));
    }
    row("jacobian ratio", &of(|s| s.jacobian), &of(|s| s.jacobian));
    table
}

/// Four digits: these numbers are looked at.
fn digits(x: f64) -> Value {
    format!("{x:.3e}").parse::<f64>().map_or(Value::Null, Value::from)
}

/// What is odd but no error.
fn odd(mesh: &Mesh, topology: &Topology) -> Table {
    let told = mesh.warnings();
    let mut table = Table::new("odd", &["what", "how many", "the first"]);
    let pairs = facets_against(mesh, topology);
    let divided = divided_facets(mesh, &pairs);
    if let Some(first) = divided.iter().find(|d| d.hanging.is_some()).or(divided.first()) {
        let cells = first.parts.iter().map(|part| mesh.numbers().cell(part.cell).to_string());
        let cells =
            format!("{} against {}", mesh.numbers().cell(first.whole.cell), cells.collect::<Vec<_>>().join(" and "));
        let what = "faces against parts of others: a field on both sides is refused (E409)";
        table.push(vec![what.into(), divided.len().into(), cells.into()]);
    } else if let Some(pair) = pairs.first() {
        let [here, there] = [pair.large, pair.small].map(|facet| mesh.numbers().cell(facet.cell));
        let what = "pairs of faces at one place that are not joined: bodies that touch, or a torn mesh (W405)";
        table.push(vec![what.into(), pairs.len().into(), format!("{here} and {there}").into()]);
    }
    if let Some((a, b)) = told.duplicate_nodes.first() {
        let first = format!("{} and {}", mesh.numbers().node(*a), mesh.numbers().node(*b));
        let what = "pairs of nodes of one body at one place: it is torn there (W405)";
        table.push(vec![what.into(), told.duplicate_nodes.len().into(), first.into()]);
    }
    if let Some(cell) = told.turned_cells.first() {
        let what = "cells that ran clockwise and were turned (W423)";
        table.push(vec![what.into(), told.turned_cells.len().into(), mesh.numbers().cell(*cell).to_string().into()]);
    }
    if let Some(node) = told.unused_nodes.first() {
        let first = mesh.numbers().node(*node).to_string();
        table.push(vec!["nodes of no cell".into(), told.unused_nodes.len().into(), first.into()]);
    }
    table
}

/// Contact pairs and ties as statements, by a penalty as these programs have it.
fn scene_lines(mesh: &Mesh, pairs: &[DeckPair]) -> Vec<String> {
    let mut lines = Vec::new();
    if pairs.is_empty() {
        return lines;
    }
    let (low, high) = mesh.bounds();
    let extent = (0..3).map(|d| (high[d] - low[d]).powi(2)).sum::<f64>().sqrt();
    let within = number(format!("{:.0e}", 0.05 * extent).parse().unwrap_or(extent));
    if pairs.iter().any(|p| !p.is_tie) {
        lines.push("use \"sliding\"".to_owned());
    }
    lines.push("param gamma = 1e5    # a penalty: ten times the modulus over the size of a cell".to_owned());
    for (k, pair) in pairs.iter().enumerate() {
        let k = k + 1;
        let [here, there] = [&pair.here, &pair.there].map(|name| region(mesh, name, &mut lines));
        if pair.is_tie {
            lines.push(format!("mapping tie{k} = project from {here} onto {there} within {within}"));
            lines.push(format!(
                "term tie{k} on {here} : gamma*(u - Interpolate(u, tie{k})).(Test_u - Interpolate(Test_u, tie{k}))"
            ));
            continue;
        }
        lines.push(format!("mapping m{k} = raytrace from {here} onto {there} moving with u within {within}"));
        match pair.friction {
            None => lines.push(format!("term contact{k} on {here} : sliding_contact(u, u, m{k}, gamma)")),
            Some(friction) => {
                let law = format!("(u, u, m{k}, elastic{k}, gamma, {})", number(friction));
                lines.push(format!("state elastic{k} : vector on {here} := sliding_elastic{law}"));
                lines.push(format!("term contact{k} on {here} : sliding_friction{law}"));
            }
        }
    }
    lines
}

/// The region of a surface of the deck; a remark where it is none of faces.
fn region(mesh: &Mesh, name: &str, lines: &mut Vec<String>) -> String {
    let own = |g: &&wfl_mesh::mesh::Group| {
        let plain = g.name.eq_ignore_ascii_case(name);
        plain || g.name.to_lowercase().ends_with(&format!("_{}", name.to_lowercase()))
    };
    let found: Vec<_> = mesh.groups().iter().filter(own).collect();
    let faces = found.iter().find(|g| matches!(g.entities, GroupEntities::Facets(_)));
    match faces.or(found.first()) {
        Some(group) => {
            let name = region_name(&group.name);
            if faces.is_none() {
                lines.push(format!(
                    "# `{name}` has nodes alone: a mapping needs faces, region {name}_faces = faces where ..."
                ));
            }
            name
        }
        None => {
            lines.push(format!("# there is no surface `{name}` in the file"));
            region_name(name)
        }
    }
}
