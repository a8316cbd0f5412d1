//! A file of inputs.

use crate::scratch::{Scratch, assert_message};
use massline::inputs::{self, InputEntry};
use massline::setup::DocumentError;
use massline_firmware::calibration::Certificate;
use massline_firmware::wire::Health;

/// Extremes of a converter of 24 bits, and counts beyond them.
const COUNTS: [i32; 9] = [
    i32::MIN,
    -8_388_609,
    -8_388_608,
    -1,
    0,
    1,
    8_388_607,
    8_388_608,
    i32::MAX,
];

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let scratch = Scratch::new();
    let read = |bytes: &[u8]| -> Result<Vec<InputEntry>, DocumentError> {
        inputs::read(&scratch.file("inputs.toml", bytes))
    };
    let entries = match read(bytes) {
        Ok(entries) => entries,
        Err(error) => return assert_message(&error.to_string()),
    };
    let text = inputs::to_toml(&entries);
    match read(text.as_bytes()) {
        Ok(again) => assert_eq!(again, entries, "{text}"),
        Err(error) => panic!("{error}\nin what this program wrote:\n{text}"),
    }
    for entry in &entries {
        assert!(!entry.column().is_empty());
        let setting = entry.setting();
        assert_eq!(Certificate::new(&setting), Ok(entry.certificate.clone()));
        let mut channel = entry.certificate.channel(512.0);
        for count in COUNTS {
            let (reading, _) = channel.count(count, Health::GOOD);
            assert!(reading.is_finite(), "{count} is {reading} by {setting:?}");
        }
    }
}
