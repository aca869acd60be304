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

/// What to type for characters outside ASCII, ready to stand behind "write".
const PLAIN: &[(&str, &str)] = &[
    ("\u{2212}\u{2010}\u{2011}\u{2012}\u{2013}\u{2014}\u{2015}\u{fe63}\u{ff0d}", "`-`"),
    ("\u{201c}\u{201d}\u{201e}\u{201f}\u{ab}\u{bb}", "`\"`"),
    ("\u{2018}\u{2019}\u{201a}\u{201b}\u{2032}\u{b4}", "`'`"),
    (
        "\u{a0}\u{2002}\u{2003}\u{2004}\u{2005}\u{2006}\u{2007}\u{2008}\u{2009}\u{200a}\u{202f}\u{3000}",
        "an ordinary space",
    ),
    ("×∗", "`*`"),
    ("·⋅∙", "`.` for the scalar product or `*`"),
    ("÷∕", "`/`"),
    ("⊗", "`@`"),
    ("∶", "`:`"),
    ("≤", "`<=`"),
    ("≥", "`>=`"),
    ("≠", "`!=`"),
    ("²", "`^2`"),
    ("³", "`^3`"),
    ("⁰¹⁴⁵⁶⁷⁸⁹ⁿ", "a power with `^`: x^4"),
    ("⁻", "a negative power as `^(-1)`, the inverse of a matrix as `Inv(A)`"),
    ("ᵀ⊤", "`'` behind what is transposed: A'"),
    ("₀₁₂₃₄₅₆₇₈₉ₙₜᵢⱼ", "a component as u(1); in a name the plain digit or letter"),
    ("∂", "a derivative along x as `Grad_u(1)`, of component i as `Grad_u(i,1)`"),
    ("∈", "`in` for the range of a param, `on` for a region"),
    ("∞", "a finite number; leave out what is to have no limit"),
    ("∑Σ", "the sum out; sums over indices are `a.b` and `A:B`"),
    ("\u{2016}∥", "`Norm(v)`"),
    ("⟦⟧", "the jump as `u - Interpolate(u, neighbor_element)`"),
    ("⟨⟩", "`pos_part(t)` for the positive part"),
    ("→⇒", "`=` to give a value"),
    ("…", "`..` for a range"),
    ("≈", "a comparison: abs(a - b) < 1e-6"),
    ("∧", "`and`"),
    ("∨", "`or`"),
    ("¬", "`not`"),
    ("℃‰％", "the number in base units"),
    ("½", "`1/2`"),
    ("√", "`sqrt(...)`"),
    ("∇", "`Grad_u`, and `Div_u` for the divergence"),
    ("∫", "`term on place : ...`"),
    ("π", "`pi`"),
    ("µμ", "`mu` (in units `u`, as in `um`)"),
    ("°", "the angle in radians"),
    ("α", "`alpha`"),
    ("β", "`beta`"),
    ("γ", "`gamma`"),
    ("δ", "`delta`"),
    ("Δ∆", "`delta` in a name; the weak form of the Laplacian is Grad_u.Grad_Test_u"),
    ("εϵ", "`eps`"),
    ("η", "`eta`"),
    ("θϑ", "`theta`"),
    ("κ", "`kappa`"),
    ("λ", "`lambda`"),
    ("ν", "`nu`"),
    ("ρ", "`rho`"),
    ("σς", "`sigma`"),
    ("τ", "`tau`"),
    ("φϕ", "`phi`"),
    ("ψ", "`psi`"),
    ("ω", "`omega`"),
    ("ζ", "`zeta`"),
    ("ξ", "`xi`"),
    ("χ", "`chi`"),
    ("Γ", "`Gamma`"),
    ("Ω", "`Omega`"),
    ("Λ", "`Lambda`"),
    ("Φ", "`Phi`"),
    ("Ψ", "`Psi`"),
    ("Θ", "`Theta`"),
    ("ℓ", "`l`"),
];

/// What to type for a character outside ASCII, ready to stand behind "write".
pub(super) fn ascii_for(c: char) -> Option<&'static str> {
    if let Some(plain) = full_width(c) {
        return Some(plain);
    }
    if ('\u{400}'..='\u{4ff}').contains(&c) {
        return Some("the Latin letter; this one is Cyrillic, although it may look the same");
    }
    PLAIN.iter().find(|(characters, _)| characters.contains(c)).map(|(_, plain)| *plain)
}

/// The ASCII sign of a wide one, as some keyboards type them.
fn full_width(c: char) -> Option<&'static str> {
    const SIGNS: &[(char, &str)] = &[
        ('（', "`(`"),
        ('）', "`)`"),
        ('［', "`[`"),
        ('］', "`]`"),
        ('，', "`,`"),
        ('：', "`:`"),
        ('；', "`;`"),
        ('＝', "`=`"),
        ('＋', "`+`"),
        ('＊', "`*`"),
        ('／', "`/`"),
        ('．', "`.`"),
        ('。', "`.`"),
        ('＜', "`<`"),
        ('＞', "`>`"),
    ];
    SIGNS.iter().find(|(wide, _)| *wide == c).map(|(_, plain)| *plain)
}
