//! Grids that ranks hold in parts: `.pvtu`, a list of `.vtu` files with the arrays that all of them have.
//!
//! Promises: a list names plain files of its own folder only, when it is written and when it is read. Does not write the
//! parts, and does not join their nodes.

use std::{
    collections::BTreeSet,
    io::{self, Write},
};

use wfl_host::input::{InputKind, read_input};

use super::names::step_beginning;
use super::vtu::{Outline, XML_DECLARATION, escape};
use super::{OutputDir, OutputError, VtuError, check_name, step_name};

/// Whether a part has the pieces and the arrays of the first one: viewers take only arrays that all parts have.
pub(super) fn same_outline(part: usize, first: &Outline, own: &Outline) -> Result<(), VtuError> {
    if first.n_pieces != own.n_pieces {
        return Err(VtuError::PartPieces { part, expected: first.n_pieces, found: own.n_pieces });
    }
    for (a, b) in [(&first.point_data, &own.point_data), (&first.cell_data, &own.cell_data)] {
        let n = a.len().max(b.len());
        if let Some(k) = (0..n).find(|k| a.get(*k) != b.get(*k)) {
            let name = b.get(k).or(a.get(k)).map(|(name, _)| name.clone()).unwrap_or_default();
            return Err(VtuError::PartArrays { part, name });
        }
    }
    Ok(())
}

/// Writes the list of the parts of a step.
pub(super) fn write_pvtu(out: &mut dyn Write, time: f64, outline: &Outline, files: &[String]) -> io::Result<()> {
    out.write_all(XML_DECLARATION.as_bytes())?;
    writeln!(
        out,
        "<VTKFile type=\"PUnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )?;
    writeln!(out, "<PUnstructuredGrid GhostLevel=\"0\">\n<FieldData>")?;
    writeln!(
        out,
        "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{time:?}</DataArray>"
    )?;
    writeln!(out, "</FieldData>")?;
    let points = [("Points".to_owned(), 3)];
    let sections: [(&str, &[(String, usize)]); 3] =
        [("PPoints", &points), ("PPointData", &outline.point_data), ("PCellData", &outline.cell_data)];
    for (section, arrays) in sections {
        writeln!(out, "<{section}>")?;
        for (name, width) in arrays {
            let name = escape(name);
            writeln!(out, "<PDataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"{width}\"/>")?;
        }
        writeln!(out, "</{section}>")?;
    }
    for file in files {
        writeln!(out, "<Piece Source=\"{}\"/>", escape(file))?;
    }
    writeln!(out, "</PUnstructuredGrid>\n</VTKFile>")
}

/// The files that a list of parts names, in its order; `None` for a text that is no list as it is written here, or names
/// what is no plain file name, or one file twice: what is read is no more than what lies in the folder.
#[must_use]
pub fn sources(pvtu: &str) -> Option<Vec<String>> {
    pvtu.strip_suffix("</PUnstructuredGrid>\n</VTKFile>\n")?;
    let rest = |line| str::strip_prefix(line, "<Piece Source=\"");
    // of what a name of an attribute escapes a file name can have these two
    let name = |rest: &str| Some(rest.strip_suffix("\"/>")?.replace("&apos;", "'").replace("&amp;", "&"));
    let names = pvtu.lines().filter_map(rest).map(name).collect::<Option<Vec<String>>>()?;
    let distinct: BTreeSet<&String> = names.iter().collect();
    let each_once = distinct.len() == names.len();
    (!names.is_empty() && each_once && names.iter().all(|name| check_name(name).is_ok())).then_some(names)
}

/// The names of the files of a step that this writer has written: that of the whole grid, or those of the parts and of
/// their list. Of a step that is gone the one that the index would name.
pub(super) fn files_of_step(dir: &OutputDir, base: &str, number: usize) -> Result<Vec<String>, OutputError> {
    let [whole, list] = ["vtu", "pvtu"].map(|extension| step_name(base, number, extension));
    let own = dir.own_files_of(&step_beginning(base, number));
    let found = if own.contains(&list) { dir.verify(&list)? } else { None };
    let Some(file) = found else {
        let gone = own.contains(&list) && !own.contains(&whole);
        return Ok(vec![if gone { list } else { whole }]);
    };
    let text = read_input(&file, InputKind::Results).ok().and_then(|bytes| String::from_utf8(bytes).ok());
    let parts = text.as_deref().and_then(sources);
    let mut names = parts.ok_or(OutputError::Damaged { file, what: "it is no list of parts".to_owned() })?;
    names.push(list);
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_names_a_part_twice_is_none() {
        let list = |names: &[&str]| {
            let files: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let mut text = Vec::new();
            let outline = Outline { n_pieces: 1, point_data: Vec::new(), cell_data: Vec::new() };
            write_pvtu(&mut text, 0.0, &outline, &files).unwrap();
            String::from_utf8(text).unwrap()
        };
        let own = ["f_0000.p0000.vtu", "f_0000.p0001.vtu"];
        assert_eq!(sources(&list(&own)).unwrap(), own);
        assert_eq!(sources(&list(&[own[0]; 20_000])), None);
    }
}
