//! Characters outside ASCII: how a message names them, and what to type for each.

/// A character as shown in a message: itself if it can be seen, and its code.
pub(super) fn character_name(c: char) -> String {
    let code = format!("U+{:04X}", c as u32);
    let named = match c {
        '\u{2212}' => "minus sign",
        '\u{2010}'..='\u{2015}' => "dash",
        '\u{201c}'..='\u{201f}' | '\u{ab}' | '\u{bb}' => "typographic quote",
        '\u{2018}'..='\u{201b}' => "typographic apostrophe",
        '\u{a0}' | '\u{2002}'..='\u{200a}' | '\u{202f}' => return format!("{code} (a wide or fixed space)"),
        '\u{200b}'..='\u{200f}' | '\u{2060}' | '\u{feff}' => return format!("{code} (it has no width)"),
        _ if c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}') => {
            return format!("{code} (a control character)");
        }
        _ => return format!("`{c}` ({code})"),
    };
    format!("`{c}` ({code}, {named})")
}

/// What to type for a character outside ASCII.
#[derive(Clone, Copy)]
pub(super) struct Plain {
    /// Ready to stand behind "write".
    pub(super) text: &'static str,
    /// What stands for it, where that is sure.
    pub(super) meant: Meant,
}

/// What stands for a character outside ASCII.
#[derive(Clone, Copy)]
pub(super) enum Meant {
    /// It depends.
    Unknown,
    /// This in its place.
    Sign(&'static str),
    /// `"` for it and for the others on its line.
    Quotes,
    /// A call with what stands between it and its partner.
    Call { function: &'static str, partner: char },
}

/// What to type for characters outside ASCII, ready to stand behind "write".
const PLAIN: &[(&str, &str, Meant)] = &[
    ("\u{2212}\u{2010}\u{2011}\u{2012}\u{2013}\u{2014}\u{2015}\u{fe63}\u{ff0d}", "`-`", Meant::Sign("-")),
    ("\u{201c}\u{201d}\u{201e}\u{201f}\u{ab}\u{bb}", "`\"`", Meant::Quotes),
    ("\u{2018}\u{2019}\u{201a}\u{201b}\u{2032}\u{b4}", "`'`", Meant::Sign("'")),
    (
        "\u{a0}\u{2002}\u{2003}\u{2004}\u{2005}\u{2006}\u{2007}\u{2008}\u{2009}\u{200a}\u{202f}\u{3000}",
        "an ordinary space",
        Meant::Sign(" "),
    ),
    ("×∗", "`*`", Meant::Sign("*")),
    ("·⋅∙", "`.` for the scalar product or `*`", Meant::Sign(".")),
    ("÷∕", "`/`", Meant::Sign("/")),
    ("⊗", "`@`", Meant::Sign("@")),
    ("∶", "`:`", Meant::Sign(":")),
    ("≤", "`<=`", Meant::Sign("<=")),
    ("≥", "`>=`", Meant::Sign(">=")),
    ("≠", "`!=`", Meant::Sign("!=")),
    ("²", "`^2`", Meant::Sign("^2")),
    ("³", "`^3`", Meant::Sign("^3")),
    ("⁰¹⁴⁵⁶⁷⁸⁹ⁿ", "a power with `^`: x^4", Meant::Unknown),
    ("⁻", "a negative power as `^(-1)`, the inverse of a matrix as `Inv(A)`", Meant::Unknown),
    ("ᵀ⊤", "`'` behind what is transposed: A'", Meant::Unknown),
    ("₀₁₂₃₄₅₆₇₈₉ₙₜᵢⱼ", "a component as u(1); in a name the plain digit or letter", Meant::Unknown),
    ("∂", "a derivative along x as `Grad_u(1)`, of component i as `Grad_u(i,1)`", Meant::Unknown),
    ("∈", "`in` for the range of a param, `on` for a region", Meant::Sign("in")),
    ("∞", "a finite number; leave out what is to have no limit", Meant::Unknown),
    ("∑Σ", "the sum out; sums over indices are `a.b` and `A:B`", Meant::Unknown),
    ("\u{2016}", "`Norm(v)`", Meant::Call { function: "Norm", partner: '\u{2016}' }),
    ("∥", "`Norm(v)`", Meant::Call { function: "Norm", partner: '∥' }),
    ("⟦⟧", "the jump as `u - Interpolate(u, neighbor_element)`", Meant::Unknown),
    ("⟨⟩", "`pos_part(t)` for the positive part", Meant::Call { function: "pos_part", partner: '⟩' }),
    ("→⇒", "`=` to give a value", Meant::Unknown),
    ("…", "`..` for a range", Meant::Sign("..")),
    ("≈", "a comparison: abs(a - b) < 1e-6", Meant::Unknown),
    ("∧", "`and`", Meant::Sign(" and ")),
    ("∨", "`or`", Meant::Sign(" or ")),
    ("¬", "`not`", Meant::Sign(" not ")),
    ("℃‰％", "the number in base units", Meant::Unknown),
    ("½", "`1/2`", Meant::Sign("(1/2)")),
    ("√", "`sqrt(...)`", Meant::Unknown),
    ("∇", "`Grad_u`, and `Div_u` for the divergence", Meant::Unknown),
    ("∫", "`term on place : ...`", Meant::Unknown),
    ("π", "`pi`", Meant::Sign("pi")),
    ("µμ", "`mu` (in units `u`, as in `um`)", Meant::Unknown),
    ("°", "the angle in radians", Meant::Unknown),
    ("α", "`alpha`", Meant::Sign("alpha")),
    ("β", "`beta`", Meant::Sign("beta")),
    ("γ", "`gamma`", Meant::Sign("gamma")),
    ("δ", "`delta`", Meant::Sign("delta")),
    ("Δ∆", "`delta` in a name; the weak form of the Laplacian is Grad_u.Grad_Test_u", Meant::Unknown),
    ("εϵ", "`eps`", Meant::Sign("eps")),
    ("η", "`eta`", Meant::Sign("eta")),
    ("θϑ", "`theta`", Meant::Sign("theta")),
    ("κ", "`kappa`", Meant::Sign("kappa")),
    ("λ", "`lambda`", Meant::Sign("lambda")),
    ("ν", "`nu`", Meant::Sign("nu")),
    ("ρ", "`rho`", Meant::Sign("rho")),
    ("σς", "`sigma`", Meant::Sign("sigma")),
    ("τ", "`tau`", Meant::Sign("tau")),
    ("φϕ", "`phi`", Meant::Sign("phi")),
    ("ψ", "`psi`", Meant::Sign("psi")),
    ("ω", "`omega`", Meant::Sign("omega")),
    ("ζ", "`zeta`", Meant::Sign("zeta")),
    ("ξ", "`xi`", Meant::Sign("xi")),
    ("χ", "`chi`", Meant::Sign("chi")),
    ("Γ", "`Gamma`", Meant::Sign("Gamma")),
    ("Ω", "`Omega`", Meant::Sign("Omega")),
    ("Λ", "`Lambda`", Meant::Sign("Lambda")),
    ("Φ", "`Phi`", Meant::Sign("Phi")),
    ("Ψ", "`Psi`", Meant::Sign("Psi")),
    ("Θ", "`Theta`", Meant::Sign("Theta")),
    ("ℓ", "`l`", Meant::Sign("l")),
];

/// What to type for a character outside ASCII.
pub(super) fn ascii_for(c: char) -> Option<Plain> {
    if let Some((text, sign)) = full_width(c) {
        return Some(Plain { text, meant: Meant::Sign(sign) });
    }
    if ('\u{400}'..='\u{4ff}').contains(&c) {
        let text = "the Latin letter; this one is Cyrillic, although it may look the same";
        return Some(Plain { text, meant: Meant::Unknown });
    }
    let row = PLAIN.iter().find(|(characters, ..)| characters.contains(c));
    row.map(|(_, text, meant)| Plain { text, meant: *meant })
}

/// The ASCII sign of a wide one, as some keyboards type them.
fn full_width(c: char) -> Option<(&'static str, &'static str)> {
    const SIGNS: &[(char, &str, &str)] = &[
        ('（', "`(`", "("),
        ('）', "`)`", ")"),
        ('［', "`[`", "["),
        ('］', "`]`", "]"),
        ('，', "`,`", ","),
        ('：', "`:`", ":"),
        ('；', "`;`", ";"),
        ('＝', "`=`", "="),
        ('＋', "`+`", "+"),
        ('＊', "`*`", "*"),
        ('／', "`/`", "/"),
        ('．', "`.`", "."),
        ('。', "`.`", "."),
        ('＜', "`<`", "<"),
        ('＞', "`>`", ">"),
    ];
    SIGNS.iter().find(|(wide, ..)| *wide == c).map(|(_, plain, sign)| (*plain, *sign))
}
