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

/// A row of the table: the scene is the file of that kind in `wfl/new`.
macro_rules! template {
    ($kind:literal, $title:literal) => {
        Template { kind: $kind, title: $title, text: include_str!(concat!("../new/", $kind, ".wfl")) }
    };
}

/// All scenes to start from, the simple ones first.
pub const TEMPLATES: &[Template] = &[
    template!("poisson", "diffusion on a square, with a value on one side and a flux on another"),
    template!("heat", "heat in a wall over time"),
    template!("beam", "linear elasticity with units: a clamped beam"),
    template!("stokes", "slow flow in a channel, velocity and pressure"),
    template!("hyperelastic", "a block of rubber at finite strain, from its energy"),
    template!("signorini", "a body pressed on a rigid floor, with friction, by Nitsche's method"),
    template!("hertz", "a cylinder pressed into a block, beside the closed form"),
    template!("fault", "two blocks with Coulomb friction on a fault, pushed until they slip"),
    template!("crack", "a crack in a plate opened by a pressure, with `split`"),
];
