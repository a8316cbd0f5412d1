//! The column `health` of a recording: what was wrong with a sample, in words.

use massline_firmware::wire::Health;

/// Name of the column.
pub const HEALTH_COLUMN: &str = "health";

/// The words, each with its bit of [`Health`].
const WORDS: [(&str, Health); Health::KINDS] = [
    ("overload", Health::OVERLOAD),
    ("missing", Health::MISSING),
    ("checksum", Health::CHECKSUM),
    ("open", Health::OPEN),
    ("stuck", Health::STUCK),
    ("out-of-step", Health::OUT_OF_STEP),
    ("converter-reset", Health::CONVERTER_RESET),
    ("not-finite", Health::NOT_FINITE),
];

/// The word of each bit, lowest first: how [`Health`] is spelt wherever people read it.
#[must_use]
pub fn fault_words() -> [&'static str; Health::KINDS] {
    WORDS.map(|(word, _)| word)
}

/// Faults in words, joined by `+`; nothing for a good sample. Faults of a newer box, which
/// have no word here, are `unknown`, so that no fault is ever written as none.
#[must_use]
pub fn spell(health: Health) -> String {
    let mut known = Health::GOOD;
    let mut words = Vec::new();
    for (word, fault) in WORDS {
        if health.contains(fault) {
            known = known.union(fault);
            words.push(word);
        }
    }
    if known != health {
        words.push(UNKNOWN);
    }
    words.join("+")
}

const UNKNOWN: &str = "unknown";

/// Reads what [`spell`] writes; the word that is none if there is one.
pub(crate) fn read(text: &str) -> Result<Health, String> {
    let mut health = Health::GOOD;
    for word in text.split('+').map(str::trim) {
        let found = WORDS.iter().find(|(known, _)| word == *known);
        health = match found {
            Some((_, fault)) => health.union(*fault),
            None if word == UNKNOWN => health.union(Health(1 << Health::KINDS)),
            None if text.trim().is_empty() => health,
            None => return Err(word.to_owned()),
        };
    }
    Ok(health)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_of_faults_is_read_as_it_was_spelt() {
        for bits in 0..1 << (Health::KINDS + 1) {
            let health = Health(bits);
            assert_eq!(read(&spell(health)), Ok(health), "{}", spell(health));
        }
        assert_eq!(
            spell(Health::MISSING.union(Health::OVERLOAD)),
            "overload+missing"
        );
        assert!(!spell(Health(1 << 15)).is_empty());
    }

    #[test]
    fn a_word_that_is_none_is_named() {
        assert_eq!(read("overload+brocken"), Err("brocken".to_owned()));
        assert_eq!(read("3"), Err("3".to_owned()));
        assert_eq!(read("open+"), Err(String::new()));
        assert_eq!(read(" open + missing "), read("missing+open"));
    }
}
