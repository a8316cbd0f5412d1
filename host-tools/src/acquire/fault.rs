//! Faults of the box itself, as it tells them while it works.

use massline_firmware::wire::{Fault, FaultKind};
use std::collections::BTreeMap;

/// A fault in words, with what to do about it.
#[must_use]
pub fn fault_text(fault: &Fault) -> String {
    let part = fault.part.map(|part| format!(" {part}"));
    let part = part.unwrap_or_default();
    let what = match fault.kind {
        FaultKind::Overrun => "the box was too late for a sample".to_owned(),
        FaultKind::Converter => {
            format!("converter{part} does not answer; see its supply and its wires")
        }
        FaultKind::Storage => "settings cannot be read or written".to_owned(),
        FaultKind::Clock => {
            "the crystal has failed, the box runs by its internal oscillator".to_owned()
        }
        FaultKind::Stack => "the stack is close to its guard; report this".to_owned(),
    };
    format!("sample {}: {what}", fault.sample)
}

/// The name of a kind of fault, as documents have it.
#[must_use]
pub const fn fault_name(kind: FaultKind) -> &'static str {
    match kind {
        FaultKind::Overrun => "overrun",
        FaultKind::Converter => "converter",
        FaultKind::Storage => "storage",
        FaultKind::Clock => "clock",
        FaultKind::Stack => "stack",
    }
}

/// Faults by the names of their kinds.
#[must_use]
pub fn count_faults(faults: &[Fault]) -> BTreeMap<&'static str, u64> {
    let mut counts = BTreeMap::new();
    for fault in faults {
        *counts.entry(fault_name(fault.kind)).or_default() += 1;
    }
    counts
}
