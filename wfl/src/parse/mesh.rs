//! The statement `mesh`.

use super::{
    Pair, Parsed, Rule,
    statement::{Parts, Reader},
    terminal::box_shape,
};
use crate::ast::{BoxDivision, ItemKind, MeshFile, MeshSource, Placing};

impl Reader<'_> {
    pub(super) fn mesh(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let source = p.next();
        let source = match source.as_rule() {
            Rule::mesh_box => self.mesh_box(self.open(source))?,
            _ => {
                let mut p = self.open(source);
                let files = p.take_all(Rule::file_part);
                MeshSource::Files(files.into_iter().map(|f| self.mesh_file(f)).collect::<Parsed<_>>()?)
            }
        };
        let map = p.take(Rule::mesh_map).map(|m| self.value(self.only(m))).transpose()?;
        Ok(ItemKind::Mesh { source, map, options: self.options(&mut p)? })
    }

    fn mesh_file(&self, file: Pair<'_>) -> Parsed<MeshFile> {
        let mut p = self.open(file);
        let path = p.next();
        let mut placed = Vec::new();
        for step in p.0 {
            let rule = step.as_rule();
            let mut step = self.open(step);
            let value = self.value(step.next())?;
            let axis = step.take(Rule::turn_about).map(|a| self.value(self.only(a))).transpose()?;
            placed.push(match rule {
                Rule::moved => Placing::Moved(value),
                Rule::turned => Placing::Turned(value, axis),
                _ => Placing::Scaled(value),
            });
        }
        Ok(MeshFile { path: self.text(&path), span: self.span(&path), placed })
    }

    fn mesh_box(&self, mut p: Parts<'_>) -> Parsed<MeshSource> {
        let (from, to) = (self.value(p.next())?, self.value(p.next())?);
        let division = p.next();
        let by_cells = division.as_rule() == Rule::mesh_cells;
        let size = self.value(self.only(division))?;
        let division = if by_cells { BoxDivision::Cells(size) } else { BoxDivision::Size(size) };
        let shape = p.take(Rule::shape).map(|s| (box_shape(s.as_str()), self.span(&s)));
        Ok(MeshSource::Box { from, to, division, shape })
    }
}
