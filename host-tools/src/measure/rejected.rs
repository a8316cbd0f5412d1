//! Samples that are not to be believed, and the blocks they fall into.

use crate::recording::fault_words;
use massline_core::spectra::BlockSettings;
use massline_firmware::wire::Health;
use std::collections::BTreeMap;

/// Blocks and samples that were left out of an average, by fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejected {
    /// Blocks that hold a faulty sample, also by way of a filter's memory.
    pub blocks: u32,
    /// Blocks for each fault, by the bits of [`Health`]; a block with two faults counts twice.
    pub by_fault: [u32; Health::KINDS],
    /// Faulty samples.
    pub samples: u64,
    /// Samples that never came, among them.
    pub missing: u64,
}

impl Rejected {
    /// Blocks left out for each fault that occurred, by its word.
    #[must_use]
    pub fn by_word(&self) -> BTreeMap<String, u32> {
        blocks_by_word(self.by_fault)
    }

    /// The faults in words with their blocks, most frequent first: `checksum (4), missing (1)`.
    #[must_use]
    pub fn reasons(&self) -> String {
        let mut all: Vec<_> = self.by_fault.into_iter().zip(fault_words()).collect();
        all.retain(|(blocks, _)| *blocks > 0);
        all.sort_by_key(|(blocks, _)| core::cmp::Reverse(*blocks));
        let words = all
            .iter()
            .map(|(blocks, word)| format!("{word} ({blocks})"));
        words.collect::<Vec<_>>().join(", ")
    }
}

/// Blocks for each fault that occurred, by its word; `by_fault` is in the order of [`Health`]'s
/// bits.
#[must_use]
pub fn blocks_by_word(by_fault: [u32; Health::KINDS]) -> BTreeMap<String, u32> {
    let words = fault_words().into_iter().map(str::to_owned).zip(by_fault);
    words.filter(|(_, blocks)| *blocks > 0).collect()
}

/// Watches which blocks hold a faulty sample.
pub(super) struct Gate {
    support: u64,
    rows: u64,
    /// Rows up to and with the last one with each fault.
    faulty: [u64; Health::KINDS],
    /// The same for faults without a name.
    unnamed: u64,
    pub(super) rejected: Rejected,
}

impl Gate {
    pub(super) fn new(settings: &BlockSettings) -> Self {
        Self {
            support: settings.support() as u64,
            rows: 0,
            faulty: [0; Health::KINDS],
            unnamed: 0,
            rejected: Rejected::default(),
        }
    }

    /// Takes note of the next sample.
    pub(super) fn sample(&mut self, health: Health) {
        self.rows += 1;
        if health.is_good() {
            return;
        }
        self.rejected.samples += 1;
        self.rejected.missing += u64::from(health.contains(Health::MISSING));
        self.unnamed = self.rows;
        for (kind, last) in self.faulty.iter_mut().enumerate() {
            if health.contains(Health(1 << kind)) {
                *last = self.rows;
            }
        }
    }

    /// `true` if the block that ends with the sample noted last may be averaged.
    pub(super) fn admits(&mut self) -> bool {
        let first = self.rows.saturating_sub(self.support);
        if self.unnamed <= first {
            return true;
        }
        self.rejected.blocks += 1;
        for (last, blocks) in self.faulty.iter().zip(&mut self.rejected.by_fault) {
            *blocks += u32::from(*last > first);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_core::spectra::Window;

    #[test]
    fn a_fault_spoils_the_blocks_it_has_a_part_in_and_no_other() {
        let settings = BlockSettings::new(256, 0.5, Window::Hann, 256.0, [1.0, 20.0]).unwrap();
        let support = settings.support() as u64;
        for at in [1_u64, support, 3 * support] {
            let mut gate = Gate::new(&settings);
            for row in 1..5 * support {
                let health = if row == at {
                    Health::CHECKSUM.union(Health::MISSING)
                } else {
                    Health::GOOD
                };
                gate.sample(health);
                // As if a block ended here.
                let inside = row >= at && row - at < support;
                assert_eq!(gate.admits(), !inside, "{at} {row}");
            }
            assert_eq!(gate.rejected.blocks as u64, support);
            assert_eq!((gate.rejected.samples, gate.rejected.missing), (1, 1));
            let both = format!("missing ({support}), checksum ({support})");
            assert_eq!(gate.rejected.reasons(), both);
        }
    }

    #[test]
    fn a_fault_without_a_name_spoils_too() {
        let settings = BlockSettings::new(256, 0.5, Window::Hann, 256.0, [1.0, 20.0]).unwrap();
        let mut gate = Gate::new(&settings);
        gate.sample(Health(1 << 15));
        assert!(!gate.admits());
    }
}
