//! Bytes of small files are changed, and the files are cut: what is read then are finite readings
//! or an error that names the file.

use massline::recording::{Recording, RecordingError};
use std::path::{Path, PathBuf};

/// Files of a program each, with two of their channels.
const FILES: [(&str, [&str; 2]); 28] = [
    ("double.uff", ["11:+Z", "13:+Y"]),
    ("binary.uff", ["a1", "fx"]),
    ("uneven.uff", ["11:+Z", "13:+Y"]),
    ("vectors.mat", ["a1", "fx"]),
    ("matrix-plain.mat", ["data:1", "data:3"]),
    ("counts.mat", ["a1", "a2"]),
    ("testlab-group.mat", ["a1", "fx"]),
    ("testlab-73.mat", ["a1", "Signal_1"]),
    ("struct.mat", ["data.acc.a1", "data.force(1).fx"]),
    ("vectors.h5", ["a1", "fx"]),
    ("tree.h5", ["a1", "fx"]),
    ("growing.h5", ["a1", "fx"]),
    ("growing-gzip.h5", ["a1", "fx"]),
    ("fixed.h5", ["a1", "fx"]),
    ("dense.h5", ["c00", "c11"]),
    ("odd.h5", ["a2", "first/fx"]),
    ("matrix-73.mat", ["data:1", "data:3"]),
    ("controller.nc", ["11:+Z", "13:+Y"]),
    ("segments.tdms", ["a1", "fx"]),
    ("float.wav", ["1", "3"]),
    ("pcm16.wav", ["1", "3"]),
    ("snappy.parquet", ["a1", "fx"]),
    ("zstd-v2.parquet", ["a1", "fx"]),
    ("gzip.parquet", ["a1", "fx"]),
    ("split.parquet", ["a1", "fx"]),
    ("counts.parquet", ["a1", "fx"]),
    ("decimals.parquet", ["a1", "fx"]),
    ("index.parquet", ["a1", "fx"]),
];

fn read(file: &Path, channels: [&str; 2]) -> Result<u64, RecordingError> {
    let mut recording = Recording::open(file, &channels)?;
    recording.settle_rate(None)?;
    let mut row = [f64::NAN; 2];
    while recording.next_row_f64(|c, x| row[c] = x)? {
        assert!(row.iter().all(|x| x.is_finite()));
    }
    Ok(recording.rows())
}

#[test]
fn bytes_that_are_changed_or_missing() {
    let folder = tempfile::tempdir().unwrap();
    let spoilt: PathBuf = folder.path().join("spoilt");
    for (name, channels) in FILES {
        let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/formats");
        let whole = std::fs::read(fixtures.join(name)).unwrap();
        let (mut sound, mut refused) = (0, 0);
        let mut check = |bytes: &[u8]| {
            std::fs::write(&spoilt, bytes).unwrap();
            match read(&spoilt, channels) {
                // A file may say that it is shorter, or longer by blanks; it is never far longer.
                Ok(rows) => {
                    assert!(rows <= 40 * 256, "{name}: {rows} rows");
                    sound += 1;
                }
                Err(error) => {
                    let text = error.to_string();
                    assert!(text.contains("spoilt") && text.len() < 4000, "{text}");
                    refused += 1;
                }
            }
        };
        // Some 120 places a file, at a distance that is odd so that all bytes of a number have
        // their turn. All places of all files, 145 000 changes, were tried once.
        let step = (whole.len() / 120) | 1;
        for at in (0..whole.len()).step_by(step) {
            for change in [|_| 0xff, |b: u8| b ^ 1, |_| b'9'] {
                let mut bytes = whole.clone();
                bytes[at] = change(bytes[at]);
                check(&bytes);
            }
            check(&whole[..at]);
        }
        println!("{name}: {sound} files read, {refused} refused");
        assert!(sound > 0 && refused > 0, "{name}: {sound} and {refused}");
    }
}
