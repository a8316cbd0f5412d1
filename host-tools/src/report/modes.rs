//! The section on modes: the other result that interface forces allow.

use super::markup::push_number;
use super::number::{fixed, significant, with_unit};
use super::page::Section;
use crate::result::{FixedModeDocument, FreeModeDocument, ResultDocument};
use std::fmt::Write;

/// The section, or `None` where no modes were asked for or found.
pub(super) fn section(result: &ResultDocument) -> Option<Section> {
    let (fixed, free) = (&result.fixed_modes, &result.free_modes);
    if fixed.is_empty() && free.is_empty() {
        return None;
    }
    let mut html = String::new();
    if !fixed.is_empty() {
        html.push_str(&fixed_modes(fixed));
    }
    if !free.is_empty() {
        html.push_str(&free_modes(free));
    }
    Some(Section::new("modes", "Modes", html))
}

/// Frequencies, damping and what share of the rigid body each mode moves.
fn fixed_modes(modes: &[FixedModeDocument]) -> String {
    // The share of a mass or inertia that is not positive means nothing.
    let share = |mode: &FixedModeDocument, j: usize| {
        mode.effective_mass_share[j].filter(|share| share.is_finite() && *share > 0.0)
    };
    let seen = |j: &usize| modes.iter().any(|m| share(m, *j).is_some());
    let along: Vec<usize> = (0..3).filter(seen).collect();
    let about: Vec<usize> = (3..6).filter(seen).collect();
    let with_mass = modes.iter().any(|m| m.modal_mass.is_some());
    let mut html = String::from(
        "<h3>On the fixed interface</h3><div class=\"wide\"><table class=\"plain\"><thead><tr>\
         <th scope=\"col\" rowspan=\"2\" class=\"num\">Frequency, Hz</th>\
         <th scope=\"col\" rowspan=\"2\" class=\"num\">Damping, %</th>",
    );
    for (words, axes) in [
        ("Effective mass along", &along),
        ("Effective inertia about", &about),
    ] {
        if !axes.is_empty() {
            let _ = write!(
                html,
                "<th class=\"over\" colspan=\"{}\">{words}</th>",
                axes.len()
            );
        }
    }
    if with_mass {
        html.push_str("<th scope=\"col\" rowspan=\"2\" class=\"num\">Modal mass, kg</th>");
    }
    html.push_str("<th scope=\"col\" rowspan=\"2\" class=\"num\">Purity</th></tr><tr>");
    for j in along.iter().chain(&about) {
        let axis = ["x", "y", "z"][j % 3];
        let _ = write!(html, "<th scope=\"col\" class=\"num\">{axis}</th>");
    }
    html.push_str("</tr></thead><tbody>");
    let percent = |share: f64| with_unit(&fixed(100.0 * share, 1), "%");
    for mode in modes {
        let _ = write!(
            html,
            "<tr><td class=\"num\">{}</td><td class=\"num\">{}</td>",
            fixed(mode.frequency, 2),
            fixed(100.0 * mode.damping, 2)
        );
        for j in along.iter().chain(&about) {
            let text = share(mode, *j).map_or_else(String::new, percent);
            push_number(&mut html, &text);
        }
        if with_mass {
            let text = mode
                .modal_mass
                .map_or_else(String::new, |m| significant(m, 3));
            push_number(&mut html, &text);
        }
        let _ = write!(html, "<td class=\"num\">{}</td></tr>", percent(mode.purity));
    }
    if modes.len() > 1 && !(along.is_empty() && about.is_empty()) {
        html.push_str("<tr><th scope=\"row\" colspan=\"2\">Together</th>");
        for j in along.iter().chain(&about) {
            let sum = modes.iter().filter_map(|m| share(m, *j)).sum();
            push_number(&mut html, &percent(sum));
        }
        let rest = if with_mass { 2 } else { 1 };
        let _ = write!(html, "<td colspan=\"{rest}\"></td></tr>");
    }
    html.push_str(
        "</tbody></table></div><p class=\"small\">Effective masses and inertias are shares of \
         the rigid body's, about the reference point; those of all modes, seen and unseen, \
         add up to 100\u{202f}%. Modal mass is for a shape whose largest deflection at an \
         accelerometer is one. Purity is what a single shape explains of a mode; neighbours \
         that are too close lower it.</p>",
    );
    html
}

fn free_modes(modes: &[FreeModeDocument]) -> String {
    let mut html = String::from(
        "<h3>Of the free structure</h3><div class=\"wide\"><table class=\"plain\"><thead><tr>\
         <th scope=\"col\" class=\"num\">Frequency, Hz</th>\
         <th scope=\"col\" class=\"num\">Damping, %</th></tr></thead><tbody>",
    );
    for mode in modes {
        let _ = write!(
            html,
            "<tr><td class=\"num\">{}</td><td class=\"num\">{}</td></tr>",
            fixed(mode.frequency, 2),
            fixed(100.0 * mode.damping, 2)
        );
    }
    html.push_str("</tbody></table></div>");
    html
}
