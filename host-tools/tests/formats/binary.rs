//! Universal files, MAT, HDF5, TDMS and WAV.

use crate::bench::{Bench, RECORDINGS};
use crate::hdf5::{Variable, mat73};
use crate::write::{Numbers, RATE, Raw, mat, matrix, object, set58, tdms};
use crate::{Table, close, offered, same};
use std::io::Cursor;

/// Without the rate of the setup, so that the file's counts.
fn of_file(bench: Bench) -> Bench {
    bench.setup("sample_rate", "# sample_rate")
}

fn uff(table: &Table, numbers: Numbers) -> Vec<u8> {
    let channels = table.names.iter().zip(table.readings());
    let sets = channels.map(|(name, readings)| set58(name, 0, 0, &readings, numbers));
    sets.flatten().collect()
}

/// Twelve decimals and binary numbers keep all bits of single precision; five decimals are within
/// 3e-6 of a reading's size by its RMS, 3e-4 of the noise of 1 %: a hundredth of the standard
/// deviation is thirty times that.
#[test]
fn universal_files() {
    same(&offered(|table| uff(&table, Numbers::Double)));
    for big in [false, true] {
        same(&offered(|table| uff(&table, Numbers::Binary { big })));
        same(&offered(|table| uff(&table, Numbers::Wide { big })));
    }
    close(&offered(|table| uff(&table, Numbers::Single)), 0.01);
    // The step is printed with six digits, so that the rate is 512.001 Hz.
    close(
        &of_file(offered(|table| uff(&table, Numbers::Double))),
        0.01,
    );
    // CR and LF; a line that is filled up with zeros, blanks and datasets of others around.
    let crlf = |table: Table| {
        String::from_utf8(uff(&table, Numbers::Double))
            .unwrap()
            .replace('\n', "\r\n")
    };
    same(&offered(|table| crlf(table).into_bytes()));
    let around = |table: Table| {
        let other =
            "    -1\n    15\n         1         0         0        11  0.0  0.0  0.0\n    -1\n";
        let mut readings = table.readings();
        // 3071 readings leave one field of the last line.
        readings.iter_mut().for_each(|r| r.truncate(3071));
        let set = |(name, r): (&String, &Vec<f32>)| {
            let text = String::from_utf8(set58(name, 0, 0, r, Numbers::Double)).unwrap();
            text.replace("\n    -1\n", "  0.000000000000E+00   \n    -1\n")
        };
        let sets: String = table.names.iter().zip(&readings).map(set).collect();
        format!("{other}{sets}{other}").into_bytes()
    };
    let finished = offered(around).identify(&["--verbose"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.says("positions of nodes not read: no dataset 164 states their unit");
    finished.says("lateral-x.csv: read as universal file, 19 of dataset 58 (0 binary)");
}

#[test]
fn universal_files_that_are_spoilt() {
    let text = |table: &Table| String::from_utf8(uff(table, Numbers::Double)).unwrap();
    let refused = |change: fn(&str) -> String, words: &str| {
        let bench = Bench::fork().edit(RECORDINGS[0], |csv| change(&text(&Table::of(csv))));
        bench.refused_input(&format!("lateral-x.csv, {words}"));
    };
    let cut = |text: &str| text[..text.len() / 2].to_owned();
    refused(
        cut,
        "line … the file ends within its data … expected -1 … copy or export it again",
    );
    // Another line in place of one; the 100th line of data of the first channel is line 113.
    static LINE: fn(&str, usize, &str) -> String = |text, number, new| {
        let lines = text.lines().enumerate();
        let lines = lines.map(|(n, old)| if n + 1 == number { new } else { old });
        lines
            .filter(|line| *line != "gone")
            .flat_map(|line| [line, "\n"])
            .collect()
    };
    refused(
        |text| LINE(text, 113, "  1.0E+00  x"),
        "line 113, channel `drive`: `x`, expected a number",
    );
    refused(
        |text| LINE(text, 113, "gone"),
        "line 781, channel `drive`: the data end behind 3068 points, expected 3072 points",
    );
    refused(
        |text| LINE(text, 781, "  1.0 2.0 3.0 4.0 5.0"),
        "line … channel `drive`: there are more numbers, expected 3072 points",
    );
    refused(
        |text| LINE(text, 9, "  2  0  1  0 0 0"),
        "line 9: `2  0  1  0 0 0`, expected at least one point",
    );
    refused(
        |text| {
            text.replacen("    -1\n    58", "    -1\n    fifty", 2)
                .replacen("fifty", "58", 1)
        },
        "line 784: `fifty`, expected the number of a dataset",
    );
    // Another length in one channel, and one that says more than the file has.
    let short = |csv: &str| {
        let table = Table::of(csv);
        let mut sets = Vec::new();
        for (name, readings) in table.names.iter().zip(table.readings()) {
            let end = if name == "a3" { 3000 } else { 3072 };
            sets.extend(set58(name, 0, 0, &readings[..end], Numbers::Double));
        }
        String::from_utf8(sets).unwrap()
    };
    Bench::fork().edit(RECORDINGS[0], short).refused_input(
        "lateral-x.csv, line … channel `a3`: 3000 points every 0.00195312 s … expected 3072 points … export the others",
    );
    let huge = |table: Table| {
        let binary = uff(&table, Numbers::Binary { big: false });
        let text: Vec<u8> = binary
            .iter()
            .map(|b| if b.is_ascii() { *b } else { b'?' })
            .collect();
        let at = String::from_utf8(text)
            .unwrap()
            .find("       12288 ")
            .unwrap();
        let mut changed = binary;
        changed[at..at + 12].copy_from_slice(b" 99999999999");
        changed
    };
    offered(huge).refused_input(
        "lateral-x.csv, byte … 99999999999 bytes of data, and … expected those of 3072 points",
    );
    offered(|_| b"    -1\n    55\n    -1\n".to_vec())
        .refused_input("lateral-x.csv: 1 of dataset 55 not read: data at nodes, expected time histories … export the time histories");
}

fn vectors(table: &Table, single: bool) -> Vec<Vec<u8>> {
    let channels = table.names.iter().zip(table.readings());
    let channels = channels.map(|(name, readings)| {
        let wide: Vec<f64> = readings.into_iter().map(f64::from).collect();
        matrix(name, wide.len(), &wide, single)
    });
    channels.chain([matrix("Fs", 1, &[RATE], false)]).collect()
}

/// The setup's channels by their numbers in the file, with this text before them.
fn numbered(bench: Bench, before: &str) -> Bench {
    let csv = std::fs::read_to_string(Bench::fork().file(RECORDINGS[0])).unwrap();
    let names = Table::of(&csv).names;
    bench.edit("setup.toml", |text| {
        let named = |text: String, (n, name): (usize, &String)| {
            let number = format!("\"{before}{}\"", n + 1);
            text.replace(
                &format!("channel = \"{name}\""),
                &format!("channel = {number}"),
            )
            .replace(
                &format!("reference = \"{name}\""),
                &format!("reference = {number}"),
            )
        };
        names.iter().enumerate().fold(text.to_owned(), named)
    })
}

#[test]
fn mat_files() {
    for (single, compressed) in [(true, true), (true, false), (false, true), (false, false)] {
        let file = |table: Table| mat(&vectors(&table, single), compressed);
        same(&of_file(offered(file)));
        // A matrix of samples and channels, and of channels and samples.
        for transposed in [false, true] {
            let file = |table: Table| {
                let readings = table.readings();
                let (channels, samples) = (readings.len(), readings[0].len());
                let values: Vec<f64> = match transposed {
                    false => readings.iter().flatten().map(|x| f64::from(*x)).collect(),
                    true => (0..samples)
                        .flat_map(|n| readings.iter().map(move |r| f64::from(r[n])))
                        .collect(),
                };
                let rows = if transposed { channels } else { samples };
                let all = [
                    matrix("data", rows, &values, single),
                    matrix("Fs", 1, &[RATE], false),
                ];
                mat(&all, compressed)
            };
            close(&of_file(numbered(offered(file), "data:")), 0.0);
        }
    }
}

/// Tables and strings of MATLAB are noted, and take nothing else with them.
#[test]
fn mat_files_with_objects() {
    let file = |table: Table| mat(&[object("log"), vectors(&table, true).concat()], false);
    let bench = of_file(offered(file));
    let finished = bench.identify(&[]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.says("variable `log` not read: a table, a string or another object");
    assert!(
        !finished.stderr.contains("columns not used"),
        "{}",
        finished.stderr
    );
    close(&bench, 0.0);
}

#[test]
fn mat_files_that_are_spoilt() {
    let spoilt = |change: &dyn Fn(&mut Vec<u8>), compressed: bool, words: &str| {
        let file = |table: Table| {
            let mut file = mat(&vectors(&table, true), compressed);
            change(&mut file);
            file
        };
        offered(file).refused_input(&format!("lateral-x.csv, byte {words}"));
    };
    // Header 128, tag 8, flags 16, dimensions 16, tag of the name 8 with 8 bytes, tag of numbers.
    spoilt(
        &|file| file.truncate(20_000),
        false,
        "… bytes up to the end of the file, expected 12",
    );
    spoilt(
        &|file| file[128] = 99,
        false,
        "128: an element of type 99, expected a variable",
    );
    spoilt(
        &|file| file[165] = 1,
        false,
        "128: 12288 bytes for 3072 x … expected as many as they take",
    );
    spoilt(
        &|file| file[184] = 77,
        false,
        "128: numbers of type 77 in variable `drive`",
    );
    spoilt(
        &|file| file[173] = 0xff,
        false,
        "128: an element of type 1 and",
    );
    spoilt(
        &|file| file[136] = 0xff,
        true,
        "128: … damaged … copy or export it again",
    );
    let short = |table: Table| {
        let mut readings = table.readings();
        readings[3].truncate(3000);
        let channels = table.names.iter().zip(readings);
        let channels = channels.map(|(name, readings)| {
            let wide: Vec<f64> = readings.into_iter().map(f64::from).collect();
            matrix(name, wide.len(), &wide, true)
        });
        mat(&channels.collect::<Vec<_>>(), true)
    };
    offered(short)
        .refused_input("channel `a3`: 3000 samples, expected 3072 as the other channels have");
    offered(|_| mat(&[matrix("Fs", 1, &[RATE], false)], true))
        .refused_input("lateral-x.csv: no numeric vector or matrix, expected vectors");
}

fn variables(table: &Table, single: bool) -> Vec<Variable> {
    let channels = table.names.iter().zip(table.readings());
    let channels = channels.map(|(name, readings)| Variable::vector(name, &readings, single));
    channels.chain([Variable::rate()]).collect()
}

/// In one piece, in chunks that end with the samples, and in chunks that do not.
#[test]
fn mat_files_of_version_7_3() {
    for (single, chunk) in [
        (true, None),
        (false, None),
        (false, Some(512)),
        (true, Some(700)),
    ] {
        let file = |table: Table| mat73(&variables(&table, single), chunk);
        same(&of_file(offered(file)));
        // A matrix of samples and channels.
        let file = |table: Table| {
            let readings = table.readings();
            let matrix = Variable {
                name: "data".to_owned(),
                shape: [readings[0].len(), readings.len()],
                values: readings.iter().flatten().map(|x| f64::from(*x)).collect(),
                single,
            };
            mat73(&[matrix, Variable::rate()], chunk)
        };
        close(&of_file(numbered(offered(file), "data:")), 0.0);
    }
}

#[test]
fn mat_files_of_version_7_3_that_are_spoilt() {
    let spoilt = |change: &dyn Fn(&mut Vec<u8>), chunk: Option<usize>, words: &str| {
        let file = |table: Table| {
            let mut file = mat73(&variables(&table, false), chunk);
            change(&mut file);
            file
        };
        offered(file).refused_input(&format!("lateral-x.csv, {words}"));
    };
    spoilt(
        &|file| file.truncate(20_000),
        None,
        "byte … beyond the end of the file, expected bytes of the file, which was cut",
    );
    spoilt(
        &|file| file[520] = 9,
        None,
        "byte 512: a superblock of version 9, expected",
    );
    // The first numbers lie behind the superblock: here packed, the byte of their kind first.
    spoilt(
        &|file| file[608] ^= 0xff,
        Some(512),
        "byte 608, channel `drive`: compressed numbers that break off … expected the 4096 bytes of a chunk",
    );
    let short = |table: Table| {
        let mut all = variables(&table, true);
        let at = all
            .iter()
            .position(|variable| variable.name == "a3")
            .unwrap();
        all[at].values.truncate(3000);
        all[at].shape[0] = 3000;
        mat73(&all, None)
    };
    offered(short)
        .refused_input("channel `a3`: 3000 samples, expected 3072 as the other channels have");
    offered(|_| mat73(&[Variable::rate()], None))
        .refused_input("lateral-x.csv: no dataset of numbers, expected vectors");
    // One chunk has to fit beside those of all other channels.
    let large = |mut table: Table| {
        let row = table.rows[0].clone();
        table.rows.resize(600_000, row);
        mat73(&variables(&table, false), Some(600_000))
    };
    offered(large).refused_input(
        "compressed chunks of … bytes at a time, expected 32 MiB at most; … h5repack",
    );
}

#[test]
fn tdms_files() {
    for interleaved in [false, true] {
        for big in [false, true] {
            for segment in [5000, 1024, 700] {
                let raw = Raw {
                    interleaved,
                    big,
                    segment,
                };
                let file = |table: Table| tdms(&table.names, &table.readings(), raw);
                same(&of_file(offered(file)));
            }
        }
    }
}

#[test]
fn tdms_files_that_are_spoilt() {
    let raw = Raw {
        interleaved: false,
        big: false,
        segment: 1024,
    };
    let spoilt = |change: &dyn Fn(&mut Vec<u8>), words: &str| {
        let file = |table: Table| {
            let mut file = tdms(&table.names, &table.readings(), raw);
            change(&mut file);
            file
        };
        offered(file).refused_input(&format!("lateral-x.csv{words}"));
    };
    spoilt(
        &|file| file.truncate(20_000),
        ", byte 0: 19972 bytes up to the end of the file, expected",
    );
    spoilt(
        &|file| file[4] |= 0x80,
        ": this is a TDMS file with raw data of DAQmx … save it with scaled data",
    );
    spoilt(
        &|file| file[22] = 2,
        ", byte 0: metadata of … in a segment of",
    );
    // The index of the first channel, behind 28 bytes of lead, 4 of the count, 13 of the file,
    // and the path.
    let index = |file: &[u8]| 28 + 4 + 13 + 4 + file[45] as usize;
    spoilt(
        &|file| {
            let at = index(file);
            file[at..at + 4].copy_from_slice(&[0x69, 0x12, 0, 0]);
        },
        ", byte 28: raw data of DAQmx",
    );
    spoilt(
        &|file| {
            let at = index(file);
            file[at + 4] = 0x77;
        },
        ", byte … channel `drive`: values of type 0x77",
    );
    spoilt(
        &|file| {
            let at = index(file);
            file[at + 19] = 0xff;
        },
        ", byte … channel `drive`: … values in a chunk",
    );
    // A recorder that was stopped: the last segment has no length and half of its samples, which
    // are no whole chunk and are left out with a note.
    let stopped = |table: Table| {
        let mut file = tdms(&table.names, &table.readings(), raw);
        let chunk = 19 * 1024 * 4 + 28;
        let at = file.len() - chunk;
        file[at + 12..at + 20].fill(0xff);
        file.truncate(at + chunk / 2);
        file
    };
    let finished = offered(stopped).identify(&[]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.says("bytes from byte … on are left out: they are no whole chunk of all channels");
    // Many segments that hold no whole chunk are one note: raw data like those before, 10 bytes each.
    let crumbs = |table: Table| {
        let mut file = tdms(&table.names, &table.readings(), raw);
        let mut lead = b"TDSm".to_vec();
        lead.extend([8, 0, 0, 0, 0x69, 0x12, 0, 0]);
        lead.extend([10_u64.to_le_bytes(), 0_u64.to_le_bytes()].concat());
        lead.extend([0; 10]);
        for _ in 0..1000 {
            file.extend(&lead);
        }
        file
    };
    let finished = offered(crumbs).identify(&[]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished
        .says("10000 bytes at the ends of 1000 segments, the first from byte … on, are left out");
    // One a recording, not one a segment.
    let notes = finished.stderr.matches("are left out").count();
    assert!(notes < 10, "{notes}");
}

fn wav(readings: &[Vec<f32>], scales: Option<&[f32]>) -> Vec<u8> {
    let spec = hound::WavSpec {
        channels: readings.len() as u16,
        sample_rate: RATE as u32,
        bits_per_sample: if scales.is_some() { 16 } else { 32 },
        sample_format: if scales.is_some() {
            hound::SampleFormat::Int
        } else {
            hound::SampleFormat::Float
        },
    };
    let mut out = Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut out, spec).unwrap();
    for n in 0..readings[0].len() {
        for (c, channel) in readings.iter().enumerate() {
            match scales {
                None => writer.write_sample(channel[n]).unwrap(),
                Some(scales) => {
                    let whole = (channel[n] / scales[c] * 32768.0)
                        .round()
                        .clamp(-32768.0, 32767.0);
                    writer.write_sample(whole as i16).unwrap();
                }
            }
        }
    }
    writer.finalize().unwrap();
    out.into_inner()
}

/// Sixteen bits of a full scale at the peak, which is four times the RMS, have a rounding of
/// 4 / 32768 / sqrt 12 of the RMS, 3.5e-5; the noise has 1 %, so that the numbers move by some
/// 0.35 % of their standard deviations. A twentieth is fourteen times that.
#[test]
fn wav_files() {
    close(
        &of_file(numbered(offered(|table| wav(&table.readings(), None)), "")),
        0.0,
    );
    // One full scale a channel, whatever the run.
    let fork = Bench::fork();
    let mut scales = [0.0_f32; 19];
    for name in RECORDINGS {
        let text = std::fs::read_to_string(fork.file(name)).unwrap();
        for (scale, readings) in scales.iter_mut().zip(Table::of(&text).readings()) {
            *scale = readings.iter().fold(*scale, |most, x| most.max(x.abs()));
        }
    }
    let bench = offered(|table| wav(&table.readings(), Some(&scales)));
    let bench = of_file(numbered(bench, "")).edit("setup.toml", |text| {
        let scaled = |text: String, (n, scale): (usize, &f32)| {
            let channel = format!("channel = \"{}\"\n", n + 1);
            text.replace(&channel, &format!("{channel}scale = {scale}\n"))
        };
        scales.iter().enumerate().fold(text.to_owned(), scaled)
    });
    close(&bench, 0.05);
    let cut = offered(|table| {
        let mut file = wav(&table.readings(), None);
        file.truncate(100_000);
        file
    });
    numbered(cut, "").refused_input("lateral-x.csv, sample 13");
}

/// Channels that lie one after the other cannot be read while gzip unpacks them.
#[test]
fn formats_that_need_a_plain_file_say_so() {
    let zipped = |bytes: Vec<u8>| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut encoder, &bytes).unwrap();
        encoder.finish().unwrap()
    };
    offered(|table| zipped(uff(&table, Numbers::Double))).refused_input(
        "lateral-x.csv: this is a universal file compressed by gzip … unpack it first",
    );
    close(
        &numbered(offered(|table| zipped(wav(&table.readings(), None))), ""),
        0.0,
    );
}
