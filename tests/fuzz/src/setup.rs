//! A set-up file.

use crate::bench::{Bench, Shelf};
use crate::client::{Answering, wired};
use crate::scratch::{Scratch, assert_message};
use massline::box_runs::BoxTest;
use massline::device::{Client, ClientMemory};
use massline::setup::Setup;
use massline_core::masslines::Method;
use std::path::Path;

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let found = match std::str::from_utf8(bytes) {
        Ok(text) => Setup::from_str(text, Path::new("folder/setup.toml")),
        Err(_) => Setup::read(&Scratch::new().file("setup.toml", bytes)),
    };
    let setup = match found {
        Ok(setup) => setup,
        Err(error) => return assert_message(&error.to_string()),
    };
    let text = setup.to_toml();
    match Setup::from_str(&text, Path::new("folder/setup.toml")) {
        Ok(again) => assert_eq!(again, setup, "{text}"),
        Err(error) => panic!("{error}\nin what this program wrote:\n{text}"),
    }
    use_it(&setup);
}

/// Uses a set-up as a command does before it reads a recording.
fn use_it(setup: &Setup) {
    for run in &setup.runs {
        assert!(setup.recording_path(run).ends_with(&run.recording));
    }
    let Some(processing) = &setup.processing else {
        return;
    };
    for rate in [processing.sample_rate.unwrap_or(512.0), 1e-3, 512.0, 1e9] {
        let kept = processing.kept_up_to(Some(rate));
        assert!(kept.is_finite() && kept >= processing.averaging_band[1]);
        if let Err(error) = processing.check_bands(rate) {
            assert_message(&error.to_string());
            continue;
        }
        let grid = processing.spectrum(rate);
        match grid.within(processing.averaging_band) {
            Ok(lines) => assert!(lines.indices().end <= processing.block_length / 2),
            Err(error) => assert_message(&error.to_string()),
        }
    }
    upload(setup);
}

/// Sends the set-up to a box, or asserts a message.
fn upload(setup: &Setup) {
    let mut shelf = Shelf::default();
    let box_ = Answering::new(&[], Some(Bench::new(&mut shelf)));
    let mut memory = ClientMemory::new();
    let mut client = Client::new(box_, &mut memory);
    let accelerometers = setup.accelerometers.iter().map(|a| &a.channel);
    let channels = accelerometers.chain(setup.load_cells.iter().map(|l| &l.channel));
    let drives = setup.runs.iter().flat_map(|run| &run.references);
    let wired = wired(channels.chain(drives).map(String::as_str));
    let test = BoxTest::new(&mut client, setup, &wired, Method::ApparentMass, true);
    let loaded = test.and_then(|test| test.load(&mut client));
    if let Err(error) = loaded {
        assert_message(&error.to_string());
    }
}
