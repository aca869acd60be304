//! Words and signs of the grammar to their values in the syntax tree. The grammar admits no others.

use crate::ast::{BoxShape, CmpOp, EntityKind, Expr, Rank, Reduction, RegionOp};

/// The rank of a field, or the sizes that the word takes.
pub(super) fn rank(word: &str, mut sizes: Vec<Expr>) -> Result<Rank, &'static str> {
    match (word, sizes.len()) {
        ("scalar", 0) => Ok(Rank::Scalar),
        ("scalar", _) => Err("no size"),
        ("vector", 0 | 1) => Ok(Rank::Vector(sizes.pop())),
        ("vector", _) => Err("one size"),
        (_, 0) => Ok(Rank::Matrix(None)),
        (_, 2) => {
            let columns = sizes.pop().expect("two sizes");
            Ok(Rank::Matrix(Some((sizes.pop().expect("two sizes"), columns))))
        }
        _ => Err("two sizes, rows and columns"),
    }
}

pub(super) fn box_shape(word: &str) -> BoxShape {
    match word {
        "segment" => BoxShape::Segment,
        "tri" => BoxShape::Tri,
        "quad" => BoxShape::Quad,
        "tet" => BoxShape::Tet,
        _ => BoxShape::Hex,
    }
}

pub(super) fn region_op(sign: &str) -> RegionOp {
    match sign {
        "+" => RegionOp::Union,
        "-" => RegionOp::Minus,
        _ => RegionOp::Intersect,
    }
}

pub(super) fn entity(word: &str) -> EntityKind {
    match word {
        "cells" => EntityKind::Cells,
        "faces" => EntityKind::Faces,
        "rim" => EntityKind::Rim,
        "crossings" => EntityKind::Crossings,
        "interior" => EntityKind::Interior,
        _ => EntityKind::Nodes,
    }
}

pub(super) fn reduction(word: &str) -> Reduction {
    match word {
        "mean" => Reduction::Mean,
        "max" => Reduction::Max,
        "min" => Reduction::Min,
        "value" => Reduction::Value,
        "reaction" => Reduction::Reaction,
        _ => Reduction::Integral,
    }
}

/// The operator of a comparison.
pub(super) fn comparison(sign: &str) -> CmpOp {
    match sign {
        "<" => CmpOp::Less,
        "<=" => CmpOp::LessEqual,
        ">" => CmpOp::Greater,
        ">=" => CmpOp::GreaterEqual,
        "==" => CmpOp::Equal,
        _ => CmpOp::NotEqual,
    }
}
