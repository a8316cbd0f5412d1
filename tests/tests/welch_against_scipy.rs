//! The project's Welch and cross spectra against `scipy.signal` on the same samples.

use massline::measure::BlockStorage;
use massline::recording::Recording;
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{
    Average, BlockSettings, CrossAverage, CrossSums, DriveAverage, Sum, Window,
};
use massline_tests::fixture;
use serde_json::Value;

struct Case {
    settings: BlockSettings,
    channels: Vec<String>,
    /// Results of scipy: cross[i][j][line], real and imaginary part, units² per Hz.
    cross: Vec<Vec<Vec<(f64, f64)>>>,
}

fn cases() -> Vec<Case> {
    let text = std::fs::read_to_string(fixture("scipy/welch.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    let rate = document["sample_rate"].as_f64().unwrap();
    let list = |v: &Value| -> Vec<f64> {
        v.as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect()
    };
    let of_case = |case: &Value| {
        let length = case["length"].as_u64().unwrap() as usize;
        let window = match case["window"].as_str().unwrap() {
            "hann" => Window::Hann,
            "blackman" => Window::Blackman,
            _ => Window::Rectangular,
        };
        let spacing = rate / length as f64;
        let last = (length / 8 - 1) as f64;
        let band = [spacing, last * spacing];
        let overlap = case["overlap"].as_f64().unwrap();
        let rows = case["cross"].as_array().unwrap();
        Case {
            settings: BlockSettings::new(length, overlap, window, rate, band)
                .unwrap()
                .without_decimation(),
            channels: case["channels"]
                .as_array()
                .unwrap()
                .iter()
                .map(|c| c.as_str().unwrap().to_owned())
                .collect(),
            cross: rows
                .iter()
                .map(|row| {
                    row.as_array()
                        .unwrap()
                        .iter()
                        .map(|pair| {
                            list(&pair["re"])
                                .into_iter()
                                .zip(list(&pair["im"]))
                                .collect()
                        })
                        .collect()
                })
                .collect(),
        }
    };
    document["cases"]
        .as_array()
        .unwrap()
        .iter()
        .map(of_case)
        .collect()
}

/// Feeds the recording to an average whose blocks have `channels` channels.
fn feed(case: &Case, channels: usize, average: &mut dyn Average) {
    let names: Vec<&str> = case.channels.iter().map(String::as_str).collect();
    let mut recording = Recording::open(&fixture("fork/lateral-x.csv.gz"), &names).unwrap();
    let mut storage = BlockStorage::new(case.settings, channels);
    let mut blocks = storage.blocks().unwrap();
    let mut sample = vec![0.0; names.len()];
    while recording.next_row(&mut sample).unwrap() {
        if let Some(block) = blocks.push(&sample) {
            average.add(&block);
        }
    }
}

/// The transforms are f32: each line of a block errs by about 4e-7 of the block's RMS
/// spectrum (measured for this FFT), and the RMS is up to ten times the lines in the
/// structure's antiresonances. Averaging does not add to it. So: 4e-6 of the geometric
/// mean of both auto spectra, averaged over the lines.
const BOUND: f64 = 4e-6;

fn rms(case: &Case, i: usize) -> f64 {
    let auto = &case.cross[i][i];
    auto.iter().map(|(re, _)| re).sum::<f64>() / auto.len() as f64
}

#[test]
fn the_cross_spectral_matrix_is_scipys() {
    for case in cases() {
        let mut sums = vec![CrossSums::default(); case.settings.grid().count];
        let mut average = CrossAverage::new(&case.settings, &mut sums).unwrap();
        feed(&case, RESULTANTS, &mut average);
        let scale = case.settings.density() / f64::from(average.blocks());
        for i in 0..case.channels.len() {
            for j in 0..case.channels.len() {
                let size = (rms(&case, i) * rms(&case, j)).sqrt();
                for (k, (re, im)) in case.cross[i][j].iter().enumerate() {
                    let ours = average.cross(i, j, k);
                    let error = (ours.0 * scale - re).hypot(ours.1 * scale - im) / size;
                    assert!(error < BOUND, "{i} {j} line {k}: {error}");
                }
            }
        }
    }
}

#[test]
fn drive_referred_spectra_are_scipys() {
    for case in cases() {
        let responses = case.channels.len() - 1;
        let len = DriveAverage::storage_len(&case.settings, responses);
        let mut sums = vec![Sum::ZERO; len];
        let mut average = DriveAverage::new(&case.settings, responses, &mut sums).unwrap();
        feed(&case, responses + 1, &mut average);
        let scale = case.settings.density() / f64::from(average.blocks());
        for c in 0..responses {
            let size = (rms(&case, 0) * rms(&case, c + 1)).sqrt();
            for (k, (re, im)) in case.cross[c + 1][0].iter().enumerate() {
                let ours = average.cross(c, k);
                let error = (ours.0 * scale - re).hypot(ours.1 * scale - im) / size;
                assert!(error < BOUND, "{c} line {k}: {error}");
                let power = average.power(c, k) * scale;
                let error = (power - case.cross[c + 1][c + 1][k].0).abs() / rms(&case, c + 1);
                assert!(error < BOUND, "{c} line {k}: {error}");
            }
        }
    }
}
