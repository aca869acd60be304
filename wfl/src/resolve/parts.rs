//! The parts of statements with their macros expanded and their names checked.

use super::{Allowed, Resolver, names::Kind};
use crate::{
    ast::{
        BoxDivision, Crosspoints, Domain, Expr, ExprKind, Ident, MappingKind, MeshFile, MeshSource, OptionItem,
        OptionValue, Place, Placing, Rank,
    },
    ast::{Refine, RegionExpr, Space},
    codes::Code,
    diag::Diagnostic,
    script::{DataValue, Field, FieldKind},
    source::Span,
};

impl Resolver<'_> {
    pub(super) fn optional(&mut self, e: Option<&Expr>) -> Option<Option<Expr>> {
        match e {
            None => Some(None),
            Some(e) => self.expr(e).map(Some),
        }
    }

    pub(super) fn mesh_source(&mut self, source: &MeshSource) -> Option<MeshSource> {
        Some(match source {
            MeshSource::Files(files) => {
                MeshSource::Files(files.iter().map(|f| self.mesh_file(f)).collect::<Option<_>>()?)
            }
            MeshSource::Box { from, to, division, shape } => MeshSource::Box {
                from: self.expr(from)?,
                to: self.expr(to)?,
                division: match division {
                    BoxDivision::Cells(e) => BoxDivision::Cells(self.expr(e)?),
                    BoxDivision::Size(e) => BoxDivision::Size(self.expr(e)?),
                },
                shape: *shape,
            },
        })
    }

    fn mesh_file(&mut self, file: &MeshFile) -> Option<MeshFile> {
        let step = |placing: &Placing| {
            Some(match placing {
                Placing::Moved(e) => Placing::Moved(self.expr(e)?),
                Placing::Turned(e, axis) => Placing::Turned(self.expr(e)?, self.optional(axis.as_ref())?),
                Placing::Scaled(e) => Placing::Scaled(self.expr(e)?),
            })
        };
        let placed = file.placed.iter().map(step).collect::<Option<_>>()?;
        Some(MeshFile { path: file.path.clone(), span: file.span, placed })
    }

    pub(super) fn refine(&mut self, what: &Refine) -> Option<Refine> {
        let places = self.places(&what.places, Allowed::Regions);
        let condition = what.condition.as_ref().map(|c| self.cond(c));
        let times = self.optional(what.times.as_ref());
        Some(Refine {
            places: places?,
            condition: condition.transpose_option()?,
            times: times?,
            along: what.along.clone(),
        })
    }

    pub(super) fn region(&mut self, region: &RegionExpr) -> Option<RegionExpr> {
        Some(match region {
            RegionExpr::Name(name) => RegionExpr::Name(self.place(name, Allowed::Regions)?),
            RegionExpr::Interface { from, to, span } => {
                let (from, to) = (self.place(from, Allowed::Regions), self.place(to, Allowed::Regions));
                RegionExpr::Interface { from: from?, to: to?, span: *span }
            }
            RegionExpr::Along { surface, towards, span } => {
                let (surface, towards) = (self.place(surface, Allowed::Regions), self.optional(towards.as_ref()));
                RegionExpr::Along { surface: surface?, towards: towards?, span: *span }
            }
            RegionExpr::Picked { entity, of, condition, span } => {
                let of = of.as_ref().map(|o| self.place(o, Allowed::Regions));
                let condition = condition.as_ref().map(|c| self.cond(c));
                let (of, condition) = (of.transpose_option()?, condition.transpose_option()?);
                RegionExpr::Picked { entity: *entity, of, condition, span: *span }
            }
            RegionExpr::Combine(first, rest) => {
                let first = self.region(first);
                let rest: Vec<_> = rest.iter().map(|(op, r)| Some((*op, self.region(r)?))).collect();
                RegionExpr::Combine(Box::new(first?), rest.into_iter().collect::<Option<_>>()?)
            }
        })
    }

    pub(super) fn mapping(&mut self, kind: &MappingKind) -> Option<MappingKind> {
        Some(match kind {
            MappingKind::Point(e) => MappingKind::Point(self.expr(e)?),
            MappingKind::Search { raytrace, from, onto, moving, within } => {
                let (from, onto) = (self.place(from, Allowed::Regions), self.place(onto, Allowed::Regions));
                let within = self.optional(within.as_ref())?;
                self.all_fields(moving, "a mapping moves with unknown displacements", |k| k == Kind::Unknown)?;
                MappingKind::Search { raytrace: *raytrace, from: from?, onto: onto?, moving: moving.clone(), within }
            }
        })
    }

    pub(super) fn domain(&mut self, domain: &Domain) -> Option<Domain> {
        Some(match domain {
            Domain::Range(a, b) => Domain::Range(self.expr(a)?, self.expr(b)?),
            Domain::Set(values) => Domain::Set(values.iter().map(|v| self.expr(v)).collect::<Option<_>>()?),
        })
    }

    pub(super) fn field(&mut self, name: &Ident, space: &Space, kind: Option<FieldKind>, span: Span) -> Option<()> {
        let rank = match &space.rank {
            Rank::Scalar => Some(Rank::Scalar),
            Rank::Vector(n) => self.optional(n.as_ref()).map(Rank::Vector),
            Rank::Matrix(None) => Some(Rank::Matrix(None)),
            Rank::Matrix(Some((m, n))) => {
                let (m, n) = (self.expr(m), self.expr(n));
                m.zip(n).map(|sizes| Rank::Matrix(Some(sizes)))
            }
        };
        let place = match &space.place {
            Place::On(places) => self.places(places, Allowed::Regions).map(Place::On),
            other => Some(other.clone()),
        };
        let (element, unit) = (space.element.clone(), space.unit.clone());
        let space = Space { rank: rank?, element, place: place?, unit, span: space.span };
        self.script.fields.push(Field { name: name.clone(), kind: kind?, space, span });
        Some(())
    }

    pub(super) fn multiplier(&mut self, options: &[OptionItem]) -> Option<FieldKind> {
        let mut crosspoints = Crosspoints::Drop;
        for option in self.options("multiplier", options)? {
            let value = match &option.value {
                Some(OptionValue::Expr(Expr { kind: ExprKind::Name(word), .. })) => word.as_str(),
                _ => "",
            };
            crosspoints = match value {
                "keep" => Crosspoints::Keep,
                "follow" => Crosspoints::Follow,
                "drop" => Crosspoints::Drop,
                _ => {
                    let d = Diagnostic::new(Code::E211, "`crosspoints` is `keep`, `follow` or `drop`");
                    self.diagnostics.push(d.at(option.name.span, ""));
                    return None;
                }
            };
        }
        Some(FieldKind::Multiplier { crosspoints })
    }

    pub(super) fn data(&mut self, value: Option<&OptionValue>) -> Option<FieldKind> {
        let value = match value {
            None => DataValue::Missing,
            Some(OptionValue::Text(path, span)) => DataValue::File(path.clone(), *span),
            Some(OptionValue::Expr(e)) => DataValue::Formula(self.expr(e)?),
        };
        Some(FieldKind::Data { value })
    }
}

/// `None` if there is something that failed.
pub(super) trait TransposeOption<T> {
    fn transpose_option(self) -> Option<Option<T>>;
}

impl<T> TransposeOption<T> for Option<Option<T>> {
    fn transpose_option(self) -> Option<Option<T>> {
        match self {
            None => Some(None),
            Some(inner) => inner.map(Some),
        }
    }
}
