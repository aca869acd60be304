//! Scenes to start from: the text of `wfl new KIND`. Each is complete, explains itself in comments and runs as it is.

/// A scene to start from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Template {
    /// What it is asked for by, a word; also the name of the file that is written.
    pub kind: &'static str,
    /// What it solves, one line, lower case, no full stop.
    pub title: &'static str,
    /// The scene.
    pub text: &'static str,
}

/// All scenes to start from, the simple ones first.
pub const TEMPLATES: &[Template] = &[
    Template {
        kind: "poisson",
        title: "diffusion on a square, with a value on one side and a flux on another",
        text: include_str!("../new/poisson.wfl"),
    },
    Template { kind: "heat", title: "heat in a wall over time", text: include_str!("../new/heat.wfl") },
    Template {
        kind: "beam",
        title: "linear elasticity with units: a clamped beam",
        text: include_str!("../new/beam.wfl"),
    },
    Template {
        kind: "stokes",
        title: "slow flow in a channel, velocity and pressure",
        text: include_str!("../new/stokes.wfl"),
    },
    Template {
        kind: "hyperelastic",
        title: "a block of rubber at finite strain, from its energy",
        text: include_str!("../new/hyperelastic.wfl"),
    },
    Template {
        kind: "signorini",
        title: "a body pressed on a rigid floor, with friction, by Nitsche's method",
        text: include_str!("../new/signorini.wfl"),
    },
    Template {
        kind: "hertz",
        title: "a cylinder pressed into a block, beside the closed form",
        text: include_str!("../new/hertz.wfl"),
    },
    Template {
        kind: "fault",
        title: "two blocks with Coulomb friction on a fault, pushed until they slip",
        text: include_str!("../new/fault.wfl"),
    },
    Template {
        kind: "crack",
        title: "a crack in a plate opened by a pressure, with `split`",
        text: include_str!("../new/crack.wfl"),
    },
];
