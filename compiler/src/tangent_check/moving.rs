//! Tangents through a mapping that moves are exact, and no part of their formulas can be left out.

use super::*;
use crate::{
    build::Env,
    image::mutants::{OF_CLOSEST, OF_RAYS, PARTS, without},
    interp::InterpreterBackend,
    term::{TermSource, compile_term},
    test_law::{field, place},
    types::{FieldKind, FieldSig, ImageBy, MappingSig, Moves, PlaceKind, Shape},
};
use wfl::{SourceMap, ast::Expansions, parse_expr};

const CURRENT: &str = "Transformed_unit_vector(Grad_u, Normal)";
const GAP: &str = "((Interpolate(X, m) + Interpolate(u, m) - X - u).Transformed_unit_vector(Grad_u, Normal))";
const THEIRS: &str = "Transformed_unit_vector(Interpolate(Grad_u, m), Interpolate(Normal, m))";
const DEPTH: &str = "((Interpolate(X, m) + Interpolate(u, m) - X - u).THEIRS)";
/// What a law of penalty with friction reads, laws that read gradients and normals of the other body.
const LAWS: [&str; 4] = [
    "(9*pos_part(-GAP)*CURRENT + Interpolate(g, m)*(u - Previous_u - Interpolate(u, m) + Interpolate(Previous_u, m)))\
     .(Test_u - Interpolate(Test_u, m))",
    "(Interpolate(Grad_u, m)*Interpolate(Normal, m)).Test_u + GAP*(Interpolate(Grad_u, m):Interpolate(Grad_Test_u, m))",
    "(pos_part(9*GAP - (Grad_u*Normal).CURRENT)*CURRENT).(Test_u - Interpolate(Test_u, m))",
    "(-9*pos_part(DEPTH)*THEIRS).(Test_u - Interpolate(Test_u, m))",
];

/// A law on faces of a body in space of dimension `dim`, with an unknown `u` and data `g` on both sides of a mapping.
fn law(text: &str, dim: usize, by: ImageBy) -> TermLaw {
    let sig = |name, shape, kind| FieldSig { degree: 2, ..field(name, shape, kind) };
    let fields = [sig("u", Shape::vector(dim), FieldKind::Unknown), sig("g", Shape::SCALAR, FieldKind::Data)];
    let place = place(PlaceKind::Facets, fields.len());
    let u = FieldId::new(0);
    let mapping = MappingSig {
        name: "m".to_owned(),
        there: vec![true; 2],
        has_normal: true,
        moves: Some(Moves { by, here: u, there: u }),
        description: "a mapping".to_owned(),
    };
    let env = Env {
        dim,
        fields: &fields,
        mappings: &[mapping],
        params: &BTreeMap::new(),
        expansions: &Expansions::default(),
        step_variable: Some("s"),
        rates: &[],
        tables: &[],
        equal_within: 0.0,
    };
    let text = text.replace("GAP", GAP).replace("CURRENT", CURRENT).replace("DEPTH", DEPTH).replace("THEIRS", THEIRS);
    let mut sources = SourceMap::new();
    let id = sources.add("law", text);
    let expr = parse_expr(&sources, id).value.unwrap();
    let compiled = compile_term(&env, &place, "law", TermSource::Residual(&expr));
    compiled.value.unwrap_or_else(|| panic!("{:?}", compiled.diagnostics))
}

fn error(law: &TermLaw) -> f64 {
    let sampling = TangentSampling { samples: 12, ..TangentSampling::default() };
    check_tangent(law, &sampling, &InterpreterBackend).unwrap().unwrap().error()
}

#[test]
fn tangents_through_images_that_move_are_exact() {
    for (dim, by) in [(2, ImageBy::Ray), (3, ImageBy::Ray), (2, ImageBy::Closest), (3, ImageBy::Closest)] {
        for text in LAWS {
            let found = error(&law(text, dim, by));
            assert!(found < 1e-11, "{found} in {dim}-D, {by:?}: {text}");
        }
    }
}

#[test]
fn no_part_of_the_shift_and_of_what_it_moves_can_be_left_out() {
    for (by, own) in [(ImageBy::Ray, &OF_RAYS[..]), (ImageBy::Closest, &OF_CLOSEST[..])] {
        for part in own.iter().chain(&PARTS) {
            // with all parts the errors are below 1e-11, as the other test says
            let worst = LAWS.iter().map(|text| error(&without(Some(part), || law(text, 3, by)))).fold(0.0, f64::max);
            assert!(worst > 1e-2, "{by:?} without {part}: the error is {worst}");
        }
    }
}

#[test]
fn a_term_through_images_that_move_is_not_linear() {
    let found = law("Interpolate(g, m)*(CURRENT.Interpolate(Test_u, m))", 2, ImageBy::Ray);
    assert_eq!((found.class, found.symmetric), (crate::law::Class::Nonlinear, false));
}
