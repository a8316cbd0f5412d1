//! Recordings that pyuff, scipy, h5py, netCDF4 and npTDMS wrote, by `tests/fixtures/formats/make.py`, and
//! pyarrow, pandas, Polars and DuckDB, by `make_parquet.py` there.

use massline::recording::Recording;
use massline::setup::Setup;
use massline_firmware::wire::Health;
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/fixtures/formats")
        .join(name)
}

/// All readings of these channels, sample by sample, and the sample rate of the file.
fn read(name: &str, channels: &[&str]) -> (Vec<Vec<f64>>, f64) {
    let mut recording = Recording::open(&fixture(name), channels).unwrap();
    let rate = recording.settle_rate(None).unwrap();
    let mut rows = Vec::new();
    let mut row = vec![0.0; channels.len()];
    while recording.next_row_f64(|c, x| row[c] = x).unwrap() {
        rows.push(row.clone());
    }
    (rows, rate)
}

/// The readings that all files have, with all their digits.
fn expected() -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(fixture("expected.csv")).unwrap();
    let row = |line: &str| line.split(',').map(|x| x.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

/// Asserts equal readings within a share of each (0: equal bits), and the rate to six digits, as
/// universal files print it.
#[track_caller]
fn check(name: &str, channels: [&str; 3], share: f64) {
    let (found, rate) = read(name, &channels);
    assert!((rate / 512.0 - 1.0).abs() < 3e-6, "{name}: {rate} Hz");
    let expected = expected();
    assert_eq!(found.len(), expected.len(), "{name}");
    for (n, (found, expected)) in found.iter().zip(&expected).enumerate() {
        for (found, expected) in found.iter().zip(expected) {
            let off = (found - expected).abs();
            assert!(
                off <= share * expected.abs(),
                "{name}, sample {n}: {found}, not {expected}"
            );
        }
    }
}

const NAMES: [&str; 3] = ["a1", "a2", "fx"];

/// `catman.uff`, `milestone.uff` and `response.uff` are of the test data of pyuff (MIT licence), which
/// users sent to it: programs wrote them that we cannot run.
#[test]
fn files_of_recorders() {
    let text = std::fs::read_to_string(fixture("catman.uff")).unwrap();
    let single: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [("wide.uff", text.as_bytes()), ("single.uff", &single)] {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        let mut recording = Recording::open(&file, &["1x : m/s²"]).unwrap();
        assert_eq!(recording.in_file()[0].unit.as_deref(), Some("m/s²"));
        let rate = recording.settle_rate(None).unwrap();
        assert!((rate / 2e4 - 1.0).abs() < 1e-12, "{rate} Hz");
        let mut row = [0.0];
        let mut all = Vec::new();
        while recording.next_row_f64(|_, x| row[0] = x).unwrap() {
            all.push(row[0]);
        }
        assert_eq!((all.len(), all[0], all[12]), (13, -3.81956, -5.84096));
    }

    // Of two and a half million samples there are 42, and the data end without the end of a line.
    let file = fixture("milestone.uff");
    let cut = match Recording::open(&file, &["PWL Mic:1:+X"]) {
        Err(error) => error,
        Ok(mut recording) => {
            recording.settle_rate(None).unwrap();
            loop {
                match recording.next_row_f64(|_, _| {}) {
                    Ok(true) => {}
                    Ok(false) => panic!("read to its end"),
                    Err(error) => break error,
                }
            }
        }
    };
    let said = cut.to_string();
    assert!(said.contains("milestone.uff, line"), "{said}");
    assert!(said.contains("2508876"), "{said}");

    let recording = Recording::open(&fixture("response.uff"), &[]).unwrap();
    let names: Vec<_> = recording
        .in_file()
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    assert_eq!(names, ["ref6_23_Mar.re", "ref6_23_Mar.im", "frequency"]);
    assert_eq!(recording.in_file()[0].unit.as_deref(), Some("(1/N)*(m/s²)"));
}

#[test]
fn pyuff() {
    let nodes = ["11:+Z", "12:-X", "13:+Y"];
    // Twelve and six significant digits: half of the last one.
    check("double.uff", nodes, 5e-12);
    check("named.uff", NAMES, 5e-12);
    check("single.uff", nodes, 5e-6);
    check("uneven.uff", nodes, 5e-12);
    check("binary.uff", NAMES, 0.0);
    let recording = Recording::open(&fixture("double.uff"), &nodes).unwrap();
    let units: Vec<Option<&str>> = nodes.iter().map(|name| recording.unit(name)).collect();
    assert_eq!(units, [Some("m/s^2"), Some("g"), Some("N")]);
    assert_eq!(recording.in_file()[1].direction, Some([-1.0, 0.0, 0.0]));
}

/// Structs as Simcenter Testlab exports them, and those that people make themselves.
#[test]
fn structs_of_mat_files() {
    // A list of names is not read from version 7.3, and the struct's own stands for one.
    let listed = ["a1", "Signal_1", "fx"];
    for (file, names) in [("testlab.mat", NAMES), ("testlab-73.mat", listed)] {
        check(file, names, 0.0);
        let recording = Recording::open(&fixture(file), &names).unwrap();
        let units = names.map(|name| recording.unit(name));
        assert_eq!(units, [Some("m/s^2"), Some("g"), Some("N")]);
        // Numbers beside the samples are no channels.
        assert_eq!(recording.in_file().len(), 3);
        let mut notes = Vec::new();
        recording.notice_columns(&mut notes);
        let notes = notes.join("\n");
        for note in [
            "256 samples per second, and those before it have 512",
            "its numbers are those over Hz, of no time",
        ] {
            assert!(notes.contains(note), "{notes}");
        }
    }
    check("testlab-group.mat", NAMES, 0.0);

    check(
        "struct.mat",
        ["data.acc.a1", "data.acc.a2", "data.force(1).fx"],
        0.0,
    );
    let recording = Recording::open(&fixture("struct.mat"), &[]).unwrap();
    let names: Vec<_> = recording.in_file().iter().map(|c| &*c.name).collect();
    let all = [
        "data.acc.a1",
        "data.acc.a2",
        "data.acc.t",
        "data.force(1).fx",
        "data.force(2).fx",
    ];
    assert_eq!(names, all);
    let mut notes = Vec::new();
    recording.notice_columns(&mut notes);
    let notes = notes.join("\n");
    check(
        "struct-73.mat",
        ["data.acc.a1", "data.acc.a2", "data.fx"],
        0.0,
    );
    let complex = "variable `data.settings.sine` not read: its numbers are complex";
    assert!(notes.contains(complex), "{notes}");
}

#[test]
fn scipy_mat() {
    for name in ["matrix.mat", "matrix-plain.mat"] {
        check(name, ["data:1", "data:2", "data:3"], 0.0);
        let recording = Recording::open(&fixture(name), &["data:1"]).unwrap();
        let mut notes = Vec::new();
        recording.notice_columns(&mut notes);
        let notes = notes.join("\n");
        assert!(notes.contains("variable `note` not read: text"), "{notes}");
        // The matrix of another length can be asked for, and is refused then.
        let mut other = Recording::open(&fixture(name), &["data:1", "gains:1"]).unwrap();
        let error = other.next_row(&mut [0.0; 2]).unwrap_err().to_string();
        assert!(
            error.contains("channel `gains:1`: 2 samples, expected 40"),
            "{error}"
        );
    }
    check("vectors.mat", NAMES, 0.0);
    check("single.mat", NAMES, 0.0);
    let (rows, rate) = read("counts.mat", &["a1", "a2"]);
    assert_eq!(rate, 512.0);
    assert!(
        rows.iter()
            .enumerate()
            .all(|(n, row)| *row == [n as f64; 2]),
        "{rows:?}"
    );
}

fn notes(name: &str) -> String {
    let recording = Recording::open(&fixture(name), &[]).unwrap();
    let mut notes = Vec::new();
    recording.notice_columns(&mut notes);
    notes.join("\n")
}

fn refusal(name: &str, channel: &str) -> String {
    match Recording::open(&fixture(name), &[channel]) {
        Err(error) => error.to_string(),
        Ok(mut recording) => loop {
            match recording.next_row(&mut [0.0]) {
                Ok(more) => assert!(more, "{channel} was read"),
                Err(error) => break error.to_string(),
            }
        },
    }
}

/// Each form of superblock, group, index and filter.
#[test]
fn h5py() {
    check("vectors.h5", NAMES, 0.0);
    let tables = [
        "tree.h5",
        "growing.h5",
        "growing-gzip.h5",
        "fixed.h5",
        "single.h5",
    ];
    for name in tables {
        check(name, NAMES, 0.0);
        let recording = Recording::open(&fixture(name), &NAMES).unwrap();
        let units = NAMES.map(|channel| recording.unit(channel).unwrap().to_owned());
        assert_eq!(units, ["m/s^2", "g", "N"], "{name}");
    }
    check("dense.h5", ["c00", "c04", "c11"], 0.0);
    check("vectors-73.mat", NAMES, 0.0);
    check("matrix-73.mat", ["data:1", "data:2", "data:3"], 0.0);
    assert!(notes("vectors-73.mat").contains("not read: note: text"));
    // A struct without fields is nothing that would not be read.
    assert!(!notes("matrix-73.mat").contains("settings"));
}

#[test]
fn h5py_of_odd_form() {
    check("odd.h5", ["first/a1", "a2", "first/fx"], 0.0);
    let notes = notes("odd.h5");
    for note in [
        "second/complex: compounds, as complex numbers are",
        "second/flag: values of an enumeration, as logical ones are",
        "second/cube: it has more than two dimensions",
        "not read: lzf: its filter 32000 (lzf) is not read; `h5repack",
    ] {
        assert!(notes.contains(note), "{notes}");
    }
    let short = refusal("odd.h5", "second/fx");
    assert!(
        short.contains("channel `second/fx`: 30 samples, expected 40"),
        "{short}"
    );
    let begun = refusal("odd.h5", "begun");
    assert!(
        begun.contains("sample 21, channel `begun`: a sample that was never written"),
        "{begun}"
    );
}

/// Whole numbers to be multiplied by an attribute, by the conventions of netCDF.
#[test]
fn h5py_of_packed_values() {
    let packed = refusal("packed.h5", "a1");
    let words = "dataset a1 has packed values, by `scale_factor` or `add_offset`";
    assert!(packed.contains(words), "{packed}");
}

/// The first stream of the Rattlesnake controller; its specifications are no channels.
#[test]
fn netcdf4() {
    let nodes = ["11:+Z", "12:-X", "13:+Y"];
    check("controller.nc", nodes, 0.0);
    let recording = Recording::open(&fixture("controller.nc"), &nodes).unwrap();
    let units: Vec<Option<&str>> = nodes.iter().map(|name| recording.unit(name)).collect();
    assert_eq!(units, [Some("m/s^2"), Some("g"), Some("N")]);
    assert_eq!(recording.in_file().len(), 3);
    assert_eq!(recording.in_file()[1].direction, Some([-1.0, 0.0, 0.0]));
    let notes = notes("controller.nc");
    assert!(
        notes.contains("later streams not read: time_data_1;"),
        "{notes}"
    );
}

#[test]
fn nptdms() {
    for name in ["segments.tdms", "single.tdms"] {
        check(name, NAMES, 0.0);
        let recording = Recording::open(&fixture(name), &NAMES).unwrap();
        assert_eq!(recording.unit("a2"), Some("g"));
    }
}

/// Whole numbers are shares of full scale, 2^15 and 2^31, of which scipy was given 32767 and
/// 2147483000: half a step each.
#[test]
fn scipy_wav() {
    check("float.wav", ["1", "2", "3"], 0.0);
    for (name, full, given) in [
        ("pcm16.wav", 32768.0, 32767.0),
        ("pcm32.wav", 2_147_483_648.0, 2_147_483_000.0),
    ] {
        let (rows, rate) = read(name, &["1", "2", "3"]);
        assert_eq!(rate, 512.0);
        assert_eq!(rows.len(), expected().len());
        for (found, expected) in rows.iter().flatten().zip(expected().iter().flatten()) {
            let off = (found * full - expected * given).abs();
            // Beyond half a step there is only the rounding of the products.
            assert!(off <= 0.5 + 1e-6, "{name}: {off} steps");
        }
    }
}

/// A share of full scale is no acceleration: somebody has to say how much full scale is.
#[test]
fn whole_numbers_of_wav_need_a_scale() {
    let open = |file: &str, scale: &str| {
        let text = format!(
            "[[accelerometer]]\nchannel = \"1\"\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\n{scale}[[load_cell]]\nchannel = \"2\"\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\n[processing]\naveraging_band = [1, 2]\n[[run]]\nname = \"x\"\nrecording = \"{}\"\n",
            fixture(file).display()
        );
        let setup = Setup::from_str(&text, Path::new("setup.toml")).unwrap();
        let opened = setup.open_recording(&setup.runs[0], &["1"]);
        opened.map(|_| ()).map_err(|error| error.to_string())
    };
    for scale in ["", "scale = -1.0\n"] {
        let error = open("pcm16.wav", scale).unwrap_err();
        let words = "channel `1`: whole numbers of a WAV file are shares of full scale";
        assert!(error.contains(words), "{error}");
        assert!(
            error.contains("m/s² at full scale ([[accelerometer]]"),
            "{error}"
        );
    }
    assert_eq!(open("pcm16.wav", "scale = 98.1\n"), Ok(()));
    assert_eq!(open("pcm16.wav", "unit = \"g\"\n"), Ok(()));
    assert_eq!(open("float.wav", ""), Ok(()));
}

#[test]
fn parquet_of_others() {
    for name in [
        "snappy.parquet",
        "zstd-v2.parquet",
        "gzip.parquet",
        "split.parquet",
        "polars.parquet",
        "duckdb.parquet",
        "index.parquet",
        "steps.parquet",
    ] {
        check(name, NAMES, 0.0);
    }
    // Without a column of time it has no rate of its own.
    let mut single = Recording::open(&fixture("single.parquet"), &NAMES).unwrap();
    assert_eq!(single.settle_rate(Some(512.0)).unwrap(), 512.0);
    let mut row = [0.0; 3];
    for expected in expected() {
        assert!(single.next_row_f64(|c, x| row[c] = x).unwrap());
        assert_eq!(row.to_vec(), expected);
    }
    for (name, codec) in [("lz4.parquet", "LZ4"), ("brotli.parquet", "Brotli")] {
        let error = Recording::open(&fixture(name), &NAMES).err().unwrap();
        let error = error.to_string();
        assert!(
            error.contains(&format!("compressed by {codec}; write it with")),
            "{error}"
        );
    }
}

/// Instants as time, whole numbers, missing values as faulty samples, and columns that are no channels.
#[test]
fn parquet_of_counts() {
    let mut recording = Recording::open(&fixture("counts.parquet"), &NAMES).unwrap();
    let mut notes = Vec::new();
    recording.notice_columns(&mut notes);
    let notes = notes.join("\n");
    assert!(
        notes.contains("columns that are not numbers are not read: note, parts.list.element"),
        "{notes}"
    );
    let form = recording.described().unwrap();
    assert!(form.contains("time in s in `when`"), "{form}");
    let rate = recording.settle_rate(None).unwrap();
    assert!((rate / 512.0 - 1.0).abs() < 1e-6, "{rate}");
    let mut row = [0.0; 3];
    for (n, expected) in expected().iter().enumerate() {
        assert!(recording.next_row_f64(|c, x| row[c] = x).unwrap());
        if [7, 8].contains(&n) {
            assert_eq!(recording.health(), Health::MISSING, "sample {n}");
            continue;
        }
        assert!(recording.health().is_good(), "sample {n}");
        let counts: Vec<f64> = expected
            .iter()
            .map(|x| (x * 1_048_576.0).round_ties_even())
            .collect();
        assert_eq!(row.to_vec(), counts, "sample {n}");
    }
    assert!(!recording.next_row_f64(|_, _| ()).unwrap());
}

/// Decimals of five and of sixteen bytes, and of whole numbers, by pyarrow.
#[test]
fn parquet_of_decimals() {
    for file in ["decimals.parquet", "whole-decimals.parquet"] {
        let mut recording = Recording::open(&fixture(file), &NAMES).unwrap();
        let mut row = [0.0; 3];
        for (n, expected) in expected().iter().enumerate() {
            assert!(recording.next_row_f64(|c, x| row[c] = x).unwrap());
            let is_missing = [7, 8].contains(&n);
            assert_eq!(recording.health().is_good(), !is_missing, "{file} {n}");
            // Of six decimals, of twenty, and of six; a unit of the quotient in double precision.
            for (c, half) in [(0, 0.5e-6), (1, 0.0), (2, 0.5e-6)] {
                if !is_missing {
                    let off = (row[c] - expected[c]).abs();
                    let bound = half + f64::EPSILON * expected[c].abs();
                    assert!(off <= bound, "{file} {n}: {row:?}, expected {expected:?}");
                }
            }
        }
        assert!(!recording.next_row_f64(|_, _| ()).unwrap());
    }
}
