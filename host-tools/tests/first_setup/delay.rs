//! A channel that comes late: found, corrected by the lines that are printed, and right.

use crate::bench::{BAND, massline};
use crate::test::{Recorded, assert_replayed, recorded, rewrite};

fn late(test: &Recorded, channel: &str, samples: usize) {
    rewrite(test, |header, rows| {
        let column = header.iter().position(|name| name == channel).unwrap();
        for n in (samples..rows.len()).rev() {
            rows[n][column] = rows[n - samples][column].clone();
        }
    });
}

fn mass(test: &Recorded, setup: &str) -> f64 {
    std::fs::write(test.path().join("setup.toml"), setup).unwrap();
    let identify = ["identify", "setup.toml", "--json", "--anyway"];
    let out = massline(test.path(), identify.iter().chain(&BAND));
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    document["mass"]["value"].as_f64().unwrap()
}

#[test]
fn the_lines_that_check_prints_mend_it() {
    let test = recorded();
    let setup = test.setup();
    let clean = mass(&test, &setup.to_toml());
    late(&test, "cell2.z", 3);
    let wrong = mass(&test, &setup.to_toml());
    let out = massline(test.path(), ["check", "setup.toml"]);
    assert_eq!(out.code, Some(1), "{}", out.stderr);
    out.shows("cell2.z … late … [[load_cell]] … channel = \"cell2.z\" … delay = 3");
    // The last line goes into the section that the two before it name.
    let entry = "channel = \"cell2.z\"\n";
    let mended = setup
        .to_toml()
        .replace(entry, &format!("{entry}delay = 3\n"));
    let right = mass(&test, &mended);
    let again = massline(test.path(), ["check", "setup.toml"]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    let said = massline(test.path(), ["identify", "setup.toml", BAND[0], BAND[1]]);
    said.says("the first 0 and the last 3 samples are not used");
    // The box gets the samples that this machine averages, with a delay that is no whole number, too.
    let fraction = setup
        .to_toml()
        .replace(entry, &format!("{entry}delay = 2.75\n"));
    assert_replayed(&test, &fraction, "4");
    // Noise of 1 % decides both; without the first three samples and the last three they differ by
    // less than a tenth of what the delay makes.
    assert!(
        (right - clean).abs() < 0.1 * (wrong - clean).abs(),
        "{clean} {wrong} {right}"
    );
}
