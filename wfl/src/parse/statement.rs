//! Pairs of the grammar to statements of the syntax tree.

mod gradient;

use super::{
    Pair, Parsed, Rule, habits, slip, span_at,
    terminal::{comparison, entity, rank, reduction, region_op},
};
use crate::{
    ast::{
        Cond, CondKind, Domain, Expr, Ident, Item, ItemKind, MacroDef, MappingKind, MeasureAt, OptionItem, OptionValue,
        OutputItem, Place, QuadratureRule, Reduction, Refine, RegionExpr, Space, Target, TargetPart, Unit,
    },
    codes::Code,
    diag::Diagnostic,
    keywords::is_keyword,
    source::{SourceId, Span},
};

/// Reads the pairs of one statement. `masked` is the text that was parsed; it starts at byte `base` of `source`.
pub(super) struct Reader<'t> {
    pub(super) masked: &'t str,
    pub(super) base: usize,
    pub(super) source: SourceId,
}

/// The inner pairs of a statement, taken in order.
pub(super) struct Parts<'i>(pub(super) std::iter::Peekable<std::vec::IntoIter<Pair<'i>>>);

impl<'i> Parts<'i> {
    /// The next part, which the grammar promises.
    pub(super) fn next(&mut self) -> Pair<'i> {
        self.0.next().expect("the grammar promises this part")
    }

    /// The next part if it is of this rule.
    pub(super) fn take(&mut self, rule: Rule) -> Option<Pair<'i>> {
        self.0.next_if(|p| p.as_rule() == rule)
    }

    /// All next parts of this rule.
    pub(super) fn take_all(&mut self, rule: Rule) -> Vec<Pair<'i>> {
        std::iter::from_fn(|| self.take(rule)).collect()
    }
}

/// Words and signs that say nothing beyond the rule they stand in.
const TOKENS: &[Rule] = {
    use Rule as R;
    &[
        R::EOI,
        R::k_wfl,
        R::k_use,
        R::k_mesh,
        R::k_box,
        R::k_cells,
        R::k_size,
        R::k_file,
        R::k_moved,
        R::k_turned,
        R::k_scaled,
        R::k_about,
        R::k_map,
        R::k_region,
        R::k_refine,
        R::k_times,
        R::k_iface,
        R::k_mapping,
        R::k_point,
        R::k_param,
        R::k_unknown,
        R::k_mult,
        R::k_data,
        R::k_state,
        R::k_split,
        R::k_across,
        R::k_def,
        R::k_Def,
        R::k_term,
        R::k_energy,
        R::k_fix,
        R::k_load,
        R::k_start,
        R::k_steps,
        R::k_scheme,
        R::k_solver,
        R::k_quad,
        R::k_measure,
        R::k_expect,
        R::k_balance,
        R::k_gradient,
        R::k_field,
        R::k_event,
        R::k_when,
        R::k_output,
        R::k_Normal,
        R::k_on,
        R::k_in,
        R::k_from,
        R::k_to,
        R::k_by,
        R::k_onto,
        R::k_of,
        R::k_where,
        R::k_with,
        R::k_as,
        R::k_along,
        R::k_towards,
        R::k_moving,
        R::k_within,
        R::k_degree,
        R::k_segments,
        R::k_every,
        R::k_at,
        R::k_nodes,
        R::k_if,
        R::k_then,
        R::k_else,
        R::t_eq,
        R::t_assign,
        R::t_colon,
        R::t_comma,
        R::t_semi,
        R::t_open,
        R::t_close,
        R::t_row_end,
        R::t_set_end,
        R::t_range,
        R::t_dot,
    ]
};

fn is_token(pair: &Pair<'_>) -> bool {
    TOKENS.contains(&pair.as_rule())
}

impl Reader<'_> {
    /// The parts of a pair without its words and signs.
    pub(super) fn parts<'i>(&self, pair: Pair<'i>) -> Vec<Pair<'i>> {
        pair.into_inner().filter(|p| !is_token(p)).collect()
    }

    pub(super) fn open<'i>(&self, pair: Pair<'i>) -> Parts<'i> {
        Parts(self.parts(pair).into_iter().peekable())
    }

    pub(super) fn only<'i>(&self, pair: Pair<'i>) -> Pair<'i> {
        self.open(pair).next()
    }

    /// The place of a pair, without the space that a missing optional part leaves at its end.
    pub(super) fn span(&self, pair: &Pair<'_>) -> Span {
        let s = pair.as_span();
        let end = s.start() + self.masked[s.start()..s.end()].trim_end().len();
        span_at(self.source, self.base, s.start(), end)
    }

    fn ident(&self, pair: &Pair<'_>) -> Ident {
        Ident { name: pair.as_str().to_owned(), span: self.span(pair) }
    }

    fn idents(&self, pairs: &[Pair<'_>]) -> Vec<Ident> {
        pairs.iter().map(|p| self.ident(p)).collect()
    }

    /// A word being declared: no keyword.
    fn name(&self, pair: &Pair<'_>) -> Parsed<Ident> {
        if is_keyword(pair.as_str()) {
            return Err(Box::new(slip::keyword_as_name(pair.as_str()).at(self.span(pair), "")));
        }
        Ok(self.ident(pair))
    }

    /// The characters between the quotes.
    pub(super) fn text(&self, pair: &Pair<'_>) -> String {
        pair.as_str().trim_matches('"').to_owned()
    }

    fn places(&self, pair: Pair<'_>) -> Vec<Ident> {
        self.idents(&self.parts(pair))
    }

    /// The statement inside the rule `statement`.
    pub(super) fn statement(&self, pair: Pair<'_>) -> Parsed<Item> {
        let inner = self.only(pair);
        let span = self.span(&inner);
        Ok(Item { kind: self.kind(inner)?, span })
    }

    fn kind(&self, pair: Pair<'_>) -> Parsed<ItemKind> {
        let rule = pair.as_rule();
        let mut p = self.open(pair);
        Ok(match rule {
            Rule::version => ItemKind::Version(self.number(&p.next())?),
            Rule::include => ItemKind::Use { path: self.text(&p.next()) },
            Rule::mesh => self.mesh(p)?,
            Rule::refine => self.refine(p)?,
            Rule::region => ItemKind::Region { name: self.name(&p.next())?, region: self.region(p.next())? },
            Rule::mapping => ItemKind::Mapping {
                name: self.name(&p.next())?,
                kind: self.mapping(p.next())?,
                options: self.options(&mut p)?,
            },
            Rule::param => self.param(p)?,
            Rule::unknown => ItemKind::Unknown { name: self.name(&p.next())?, space: self.space(p.next())? },
            Rule::multiplier => ItemKind::Multiplier {
                name: self.name(&p.next())?,
                space: self.space(p.next())?,
                options: self.options(&mut p)?,
            },
            Rule::data => ItemKind::Data {
                name: self.name(&p.next())?,
                space: self.space(p.next())?,
                value: p.0.next().map(|v| self.option_value(v)).transpose()?,
            },
            Rule::state => ItemKind::State {
                name: self.name(&p.next())?,
                space: self.space(p.next())?,
                update: self.value(p.next())?,
            },
            Rule::split => ItemKind::Split(self.idents(&p.take_all(Rule::ident)), self.places(p.next())),
            Rule::def => ItemKind::Def(self.macro_def(p)?),
            Rule::term | Rule::energy => self.term(rule, p)?,
            Rule::fix | Rule::load => self.condition_on(rule, p)?,
            Rule::start => self.start(p.next())?,
            Rule::steps => ItemKind::Steps {
                variable: self.name(&p.next())?,
                from: self.value(p.next())?,
                to: self.value(p.next())?,
                by: self.value(p.next())?,
                unit: p.take(Rule::unit).map(|u| self.unit(u)).transpose()?,
                options: self.options(&mut p)?,
            },
            Rule::scheme => {
                ItemKind::Scheme { name: self.ident(&p.next()), options: self.option_list(p.take_all(Rule::option))? }
            }
            Rule::solver => ItemKind::Solver { name: self.ident(&p.next()), options: self.options(&mut p)? },
            Rule::quadrature => self.quadrature(p)?,
            Rule::measure => self.measure(p)?,
            Rule::balance => ItemKind::Balance { name: self.name(&p.next())?, fields: self.places(p.next()) },
            Rule::event => self.event(p)?,
            Rule::gradient => ItemKind::Gradient(self.gradient(p)?),
            Rule::expect => ItemKind::Expect(self.cond(p.next())?),
            _ => self.output(p)?,
        })
    }

    fn measure(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let name = self.name(&p.next())?;
        let word = p.next();
        if word.as_rule() == Rule::computed {
            let mut p = self.open(word);
            let expr = self.value(p.next())?;
            let places = p.take(Rule::option_on).map(|on| self.places(on)).unwrap_or_default();
            return Ok(ItemKind::Computed(name, expr, places));
        }
        let (reduction, expr) = (reduction(word.as_str()), self.value(p.next())?);
        let (places, at) = match p.take(Rule::measure_at) {
            None => (self.places(p.next()), MeasureAt::Rule),
            Some(at) => {
                let mut at = self.open(at);
                match at.take(Rule::at_nodes) {
                    Some(nodes) => (self.places(self.only(nodes)), MeasureAt::Nodes),
                    None => (Vec::new(), MeasureAt::Point(self.value(at.next())?)),
                }
            }
        };
        let is_possible = match &at {
            MeasureAt::Rule => reduction != Reduction::Value,
            MeasureAt::Nodes => matches!(reduction, Reduction::Max | Reduction::Min),
            MeasureAt::Point(_) => reduction == Reduction::Value,
        };
        if is_possible {
            return Ok(ItemKind::Measure { name, reduction, expr, places, at });
        }
        let d = Diagnostic::new(Code::E113, format!("`{}` is not taken there", word.as_str())).at(self.span(&word), "");
        let help = "value(expression) at [0,1] is that of one point, max or min(expression) at nodes of region of all \
                    nodes; mean, max, min and integral(expression) on region use its integration points, reaction(u(1)) on \
                    region the nodes with prescribed values";
        Err(Box::new(d.help(help)))
    }

    fn refine(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let places = p.take(Rule::refine_on).map(|on| self.places(self.only(on)));
        Ok(ItemKind::Refine(Refine {
            places: places.unwrap_or_default(),
            condition: p.take(Rule::pick_where).map(|w| self.cond(self.only(w))).transpose()?,
            times: p.take(Rule::refine_times).map(|t| self.value(self.only(t))).transpose()?,
            along: p.take(Rule::refine_along).map(|a| self.places(a)).unwrap_or_default(),
        }))
    }

    fn region(&self, pair: Pair<'_>) -> Parsed<RegionExpr> {
        let span = self.span(&pair);
        let mut p = self.open(pair.clone());
        match pair.as_rule() {
            Rule::region_expr => {
                let first = self.region(p.next())?;
                let mut rest = Vec::new();
                while let Some(op) = p.take(Rule::region_op) {
                    rest.push((region_op(op.as_str()), self.region(p.next())?));
                }
                Ok(if rest.is_empty() { first } else { RegionExpr::Combine(Box::new(first), rest) })
            }
            Rule::interface => {
                if let Some(surface) = p.take(Rule::surface) {
                    let mut p = self.open(surface);
                    let surface = self.ident(&p.next());
                    let towards = p.take(Rule::direction).map(|d| self.value(d)).transpose()?;
                    return Ok(RegionExpr::Along { surface, towards, span });
                }
                Ok(RegionExpr::Interface { from: self.ident(&p.next()), to: self.ident(&p.next()), span })
            }
            Rule::picked => Ok(RegionExpr::Picked {
                entity: entity(p.next().as_str()),
                of: p.take(Rule::pick_of).map(|o| self.ident(&self.only(o))),
                condition: p.take(Rule::pick_where).map(|w| self.cond(self.only(w))).transpose()?,
                span,
            }),
            _ => Ok(RegionExpr::Name(self.ident(&pair))),
        }
    }

    fn mapping(&self, pair: Pair<'_>) -> Parsed<MappingKind> {
        let is_point = pair.as_rule() == Rule::map_point;
        let mut p = self.open(pair);
        if is_point {
            return Ok(MappingKind::Point(self.value(p.next())?));
        }
        Ok(MappingKind::Search {
            raytrace: p.next().as_str() == "raytrace",
            from: self.ident(&p.next()),
            onto: self.ident(&p.next()),
            moving: p.take(Rule::map_moving).map(|m| self.idents(&self.parts(m))).unwrap_or_default(),
            within: p.take(Rule::expr).map(|e| self.value(e)).transpose()?,
        })
    }

    fn param(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        Ok(ItemKind::Param {
            name: self.name(&p.next())?,
            value: self.value(p.next())?,
            unit: p.take(Rule::unit).map(|u| self.unit(u)).transpose()?,
            domain: p.take(Rule::domain).map(|d| self.domain(self.only(d))).transpose()?,
            text: p.take(Rule::string).map(|s| self.text(&s)),
        })
    }

    fn domain(&self, pair: Pair<'_>) -> Parsed<Domain> {
        let is_set = pair.as_rule() == Rule::set;
        let mut values = self.parts(pair).into_iter().map(|v| self.value(v)).collect::<Parsed<Vec<Expr>>>()?;
        if is_set {
            return Ok(Domain::Set(values));
        }
        let high = values.pop().expect("a range has two ends");
        Ok(Domain::Range(values.pop().expect("a range has two ends"), high))
    }

    fn unit(&self, pair: Pair<'_>) -> Parsed<Unit> {
        let span = self.span(&pair);
        let mut factors: Vec<(String, i32)> = Vec::new();
        let mut places = Vec::new();
        // a blank between factors is `*`, but behind a `/` it can be read in two ways
        let (mut sign, mut divided, mut behind_op) = (1, false, true);
        for part in self.parts(pair) {
            if part.as_rule() == Rule::unit_op {
                sign = if part.as_str() == "/" { -1 } else { 1 };
                (divided, behind_op) = (divided || sign < 0, true);
                continue;
            }
            if !behind_op && divided {
                let d = Diagnostic::new(Code::E113, "a blank behind `/` can be read in two ways");
                let d = d.at(self.span(&part), "multiplied, or divided by?");
                return Err(Box::new(d.help("[J/kg/K] divides by both, [J/kg*K] by the one behind `/`")));
            }
            if !std::mem::take(&mut behind_op) {
                sign = 1;
            }
            let mut p = self.open(part);
            let base = p.next();
            let power = match p.take(Rule::unit_power) {
                None => 1,
                Some(power) => power.as_str().parse::<i8>().map_err(|_| {
                    let d =
                        Diagnostic::new(Code::E120, format!("the power `{}` of a unit is too large", power.as_str()));
                    Box::new(d.at(self.span(&power), "at most 127"))
                })?,
            };
            if base.as_rule() == Rule::unit_name {
                factors.push((base.as_str().to_owned(), sign * i32::from(power)));
                places.push(self.span(&base));
            }
        }
        Ok(Unit { factors, places, span })
    }

    fn space(&self, pair: Pair<'_>) -> Parsed<Space> {
        let span = self.span(&pair);
        let mut p = self.open(pair);
        let rank_word = p.next();
        let sizes = p.take(Rule::rank_sizes);
        let sizes_span = sizes.as_ref().map(|s| self.span(s));
        let values = match sizes {
            Some(s) => self.parts(s).into_iter().map(|v| self.value(v)).collect::<Parsed<Vec<Expr>>>()?,
            None => Vec::new(),
        };
        let rank = rank(rank_word.as_str(), values).map_err(|wanted| {
            let d = Diagnostic::new(Code::E113, format!("`{}` takes {wanted}", rank_word.as_str()));
            Box::new(d.at(sizes_span.unwrap_or(span), ""))
        })?;
        let element = p.take(Rule::element).map(|e| self.ident(&e));
        let place = match p.take(Rule::place) {
            None => Place::Everywhere,
            Some(place) => {
                let span = self.span(&place);
                let inner = self.only(place);
                match inner.as_rule() {
                    Rule::k_global => Place::Global(span),
                    _ => Place::On(self.places(inner)),
                }
            }
        };
        let unit = p.take(Rule::unit).map(|u| self.unit(u)).transpose()?;
        Ok(Space { rank, element, place, unit, span })
    }

    /// `name formals? body`, whose words are already dropped.
    fn macro_def(&self, mut p: Parts<'_>) -> Parsed<MacroDef> {
        let name = self.name(&p.next())?;
        let mut head = name.span;
        let mut formals = Vec::new();
        if let Some(f) = p.take(Rule::formals) {
            head = head.to(self.span(&f));
            for formal in self.parts(f) {
                formals.push(self.name(&formal)?);
            }
        }
        Ok(MacroDef { name, formals, body: self.value(p.next())?, head })
    }

    /// The same for a term, where an equation is no condition but a residual that is written with its right side.
    fn residual(&self, rule: Rule, parts: Vec<Pair<'_>>) -> Parsed<(Vec<MacroDef>, Expr)> {
        let equation = parts.last().filter(|_| rule == Rule::term).and_then(|p| habits::equation_in(p));
        self.defs_and_value(parts).map_err(|d| match equation {
            Some((at, sign)) if d.code == Code::E122 => {
                let code = self.masked.trim_end();
                let right = code[at + sign..].trim();
                let side = span_at(self.source, self.base, self.masked[..at].trim_end().len(), code.len());
                let at = span_at(self.source, self.base, at, at + sign);
                Box::new(habits::equation_as_term("==", right, side).at(at, ""))
            }
            _ => d,
        })
    }

    /// Local macros and the expression behind them.
    pub(super) fn defs_and_value(&self, parts: Vec<Pair<'_>>) -> Parsed<(Vec<MacroDef>, Expr)> {
        let mut p = Parts(parts.into_iter().peekable());
        let mut defs = Vec::new();
        for d in p.take_all(Rule::local_def) {
            defs.push(self.macro_def(self.open(d))?);
        }
        Ok((defs, self.value(p.next())?))
    }

    fn term(&self, rule: Rule, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let name = p.take(Rule::name).map(|n| self.name(&n)).transpose()?;
        let places = self.places(p.next());
        let (defs, expr) = self.residual(rule, p.0.collect())?;
        Ok(ItemKind::Term { energy: rule == Rule::energy, name, places, defs, expr })
    }

    fn condition_on(&self, rule: Rule, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let targets = p.take_all(Rule::target).into_iter().map(|t| self.target(t)).collect::<Parsed<Vec<Target>>>()?;
        let value = self.value(p.next())?;
        let places = self.places(p.next());
        Ok(match rule {
            Rule::fix => ItemKind::Fix { targets, value, places },
            _ => ItemKind::Load { targets, value, places },
        })
    }

    fn target(&self, pair: Pair<'_>) -> Parsed<Target> {
        let span = self.span(&pair);
        let mut p = self.open(pair);
        let field = self.ident(&p.next());
        let part = match p.0.next() {
            None => TargetPart::Whole,
            Some(c) if c.as_rule() == Rule::component => TargetPart::Component(self.value(self.only(c))?),
            Some(_) => TargetPart::Normal,
        };
        Ok(Target { field, part, span })
    }

    fn start(&self, pair: Pair<'_>) -> Parsed<ItemKind> {
        let is_file = pair.as_rule() == Rule::start_file;
        let mut p = self.open(pair);
        let first = p.next();
        if is_file {
            return Ok(ItemKind::StartFrom { path: self.text(&first), path_span: self.span(&first) });
        }
        Ok(ItemKind::Start { field: self.ident(&first), value: self.value(p.next())? })
    }

    /// `on r degree n`, or `on r segments of m degree n`.
    fn quadrature(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let places = self.places(p.next());
        let segments = p.take(Rule::quad_segments).map(|pair| self.ident(&self.only(pair)));
        Ok(ItemKind::Quadrature { places, segments, rule: self.rule(p.next())? })
    }

    fn rule(&self, pair: Pair<'_>) -> Parsed<QuadratureRule> {
        match pair.as_rule() {
            Rule::k_vertex => Ok(QuadratureRule::Vertex),
            _ => Ok(QuadratureRule::Degree(self.value(self.only(pair))?)),
        }
    }

    /// `name = a > b on r`, or `name = a on r > b`.
    fn event(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let name = self.name(&p.next())?;
        let first = p.next();
        let start = self.span(&first);
        let mut places = p.take(Rule::option_on).map(|on| self.places(on)).unwrap_or_default();
        let condition = match p.take(Rule::event_side) {
            None => self.cond(first)?,
            Some(side) => {
                let mut q = self.open(side);
                let op = comparison(q.next().as_str());
                let second = self.value(q.next())?;
                places.extend(q.take(Rule::option_on).map(|on| self.places(on)).unwrap_or_default());
                let span = start.to(second.span);
                Cond { kind: CondKind::Compare(Box::new(self.value(first)?), vec![(op, second)]), span }
            }
        };
        Ok(ItemKind::Event { name, condition, places })
    }

    fn output(&self, mut p: Parts<'_>) -> Parsed<ItemKind> {
        let format = self.ident(&p.next());
        let file = self.text(&p.next());
        let every = p.take(Rule::every).map(|e| self.value(self.only(e))).transpose()?;
        let when = p.take(Rule::when).map(|e| self.ident(&self.only(e)));
        let mut items = Vec::new();
        for item in p.take_all(Rule::outitem) {
            let mut q = self.open(item);
            let expr = self.value(q.next())?;
            items.push(OutputItem { expr, name: q.take(Rule::name).map(|n| self.name(&n)).transpose()? });
        }
        let along = match p.take(Rule::along) {
            None => None,
            Some(a) => {
                let mut q = self.open(a);
                Some((self.value(q.next())?, self.value(q.next())?))
            }
        };
        let at = match p.take(Rule::at) {
            None => Vec::new(),
            Some(at) => self.parts(at).into_iter().map(|x| self.value(x)).collect::<Parsed<Vec<Expr>>>()?,
        };
        Ok(ItemKind::Output { format, file, every, when, items, along, at, options: self.options(&mut p)? })
    }

    pub(super) fn options(&self, p: &mut Parts<'_>) -> Parsed<Vec<OptionItem>> {
        let Some(options) = p.take(Rule::options) else {
            return Ok(Vec::new());
        };
        self.option_list(self.parts(options))
    }

    fn option_list<'p>(&self, options: impl IntoIterator<Item = Pair<'p>>) -> Parsed<Vec<OptionItem>> {
        let mut list = Vec::new();
        for option in options {
            let mut q = self.open(option);
            let name = self.ident(&q.next());
            let value = q.0.next().map(|v| self.option_value(v)).transpose()?;
            let places = q.take(Rule::option_on).map(|on| self.places(on)).unwrap_or_default();
            list.push(OptionItem { name, value, places });
        }
        Ok(list)
    }

    fn option_value(&self, pair: Pair<'_>) -> Parsed<OptionValue> {
        match pair.as_rule() {
            Rule::string => Ok(OptionValue::Text(self.text(&pair), self.span(&pair))),
            _ => Ok(OptionValue::Expr(self.value(pair)?)),
        }
    }
}
