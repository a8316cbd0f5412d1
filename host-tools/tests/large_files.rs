//! Recordings of any length in every format take the same memory.
//!
//! `cargo test --release -p massline --test large_files -- --ignored --nocapture` reads 2 GB of each
//! and prints the table of the manual; with `MASSLINE_ACCEPT=1` it writes the table there.
#![cfg(target_os = "linux")]

mod bench;
#[allow(dead_code)]
#[path = "formats/hdf5.rs"]
mod hdf5;
#[path = "bench/watched.rs"]
mod watched;
#[allow(dead_code)]
#[path = "formats/write.rs"]
mod write;

use bench::{Bench, RECORDINGS, command};
use flate2::write::GzEncoder;
use hdf5::{Variable, write_mat73};
use massline::recording::Recording;
use parquet::basic::Compression;
use parquet::data_type::FloatType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use watched::watched;
use write::Numbers;

/// Most memory that a command may take for a recording of any length, bytes.
const MOST: u64 = 64 << 20;

/// A minute of nineteen channels, which files repeat.
struct Minute {
    names: Vec<String>,
    readings: Vec<Vec<f32>>,
    text: String,
}

impl Minute {
    fn of_fork() -> Self {
        let text = std::fs::read_to_string(Bench::fork().file(RECORDINGS[0])).unwrap();
        let mut lines = text.lines();
        let names = lines.next().unwrap().split(',').map(str::to_owned);
        let names: Vec<String> = names.collect();
        let mut readings = vec![Vec::new(); names.len()];
        for line in lines {
            for (channel, field) in readings.iter_mut().zip(line.split(',')) {
                channel.push(field.parse().unwrap());
            }
        }
        Self {
            names,
            readings,
            text,
        }
    }
}

fn csv(minute: &Minute, times: usize, out: &mut dyn Write) {
    let (header, rows) = minute.text.split_once('\n').unwrap();
    writeln!(out, "{header}").unwrap();
    (0..times).for_each(|_| out.write_all(rows.as_bytes()).unwrap());
}

fn csv_gz(minute: &Minute, times: usize, out: &mut dyn Write) {
    let mut encoder = GzEncoder::new(out, flate2::Compression::fast());
    csv(minute, times, &mut encoder);
    encoder.finish().unwrap();
}

fn uff(minute: &Minute, times: usize, out: &mut dyn Write, numbers: Numbers) {
    for (name, readings) in minute.names.iter().zip(&minute.readings) {
        let set = write::set58(name, 0, 0, readings, numbers);
        // The delimiter, the number and eleven lines.
        let ends = set.iter().enumerate().filter(|(_, byte)| **byte == b'\n');
        let head = ends.map(|(at, _)| at + 1).nth(12).unwrap();
        let data = &set[head..set.len() - "    -1\n".len()];
        let count = readings.len();
        let text = std::str::from_utf8(&set[..head]).unwrap();
        let text = text.replacen(&format!("{count:10}"), &format!("{:10}", count * times), 1);
        let size = data.len();
        let text = text.replacen(&format!("{size:12}"), &format!("{:12}", size * times), 1);
        out.write_all(text.as_bytes()).unwrap();
        (0..times).for_each(|_| out.write_all(data).unwrap());
        out.write_all(b"    -1\n").unwrap();
    }
}

/// The readings over and over, each by up to a thousandth larger, so that they cannot be packed
/// better than readings can.
fn varied(readings: &[f32], times: usize) -> Vec<f32> {
    let mut state = 1_u32;
    let mut share = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        1.0 + 1e-3 * (state >> 8) as f32 / (1 << 24) as f32
    };
    let all = readings.iter().cycle().take(readings.len() * times);
    all.map(|x| x * share()).collect()
}

fn mat5(minute: &Minute, times: usize, out: &mut dyn Write) {
    for (k, (name, readings)) in minute.names.iter().zip(&minute.readings).enumerate() {
        let varied = varied(readings, times);
        let wide: Vec<f64> = varied.into_iter().map(f64::from).collect();
        let file = write::mat(&[write::matrix(name, wide.len(), &wide, true)], true);
        // The header of a file is 128 bytes.
        let begin = if k == 0 { 0 } else { 128 };
        out.write_all(&file[begin..]).unwrap();
    }
}

fn mat73(minute: &Minute, times: usize, out: &mut BufWriter<File>, chunk: Option<usize>) {
    let channels = minute.names.iter().zip(&minute.readings);
    let channels = channels.map(|(name, r)| Variable::vector(name, &varied(r, times), true));
    write_mat73(out, channels.chain([Variable::rate()]), chunk);
}

fn tdms(minute: &Minute, times: usize, out: &mut dyn Write) {
    let raw = write::Raw {
        interleaved: false,
        big: false,
        segment: minute.readings[0].len(),
    };
    // A file may be continued by another one.
    let file = write::tdms(&minute.names, &minute.readings, raw);
    (0..times).for_each(|_| out.write_all(&file).unwrap());
}

fn wav(minute: &Minute, times: usize, out: &mut BufWriter<File>) {
    let spec = hound::WavSpec {
        channels: minute.names.len() as u16,
        sample_rate: write::RATE as u32,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::new(out, spec).unwrap();
    for n in (0..minute.readings[0].len())
        .cycle()
        .take(times * minute.readings[0].len())
    {
        for channel in &minute.readings {
            writer.write_sample(channel[n]).unwrap();
        }
    }
    writer.finalize().unwrap();
}

/// Groups of rows and pages as the crate's own defaults make them, which are those of other writers.
fn parquet(minute: &Minute, times: usize, out: &mut BufWriter<File>) {
    let field = |name: &String| format!("required float {};", name.replace(':', "_"));
    let fields: String = minute.names.iter().map(field).collect();
    let schema = parse_message_type(&format!("message recording {{ {fields} }}")).unwrap();
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY);
    let mut file =
        SerializedFileWriter::new(out, schema.into(), properties.build().into()).unwrap();
    let channels = minute.readings.iter().map(|r| varied(r, times));
    let channels: Vec<Vec<f32>> = channels.collect();
    for first in (0..channels[0].len()).step_by(1 << 20) {
        let mut group = file.next_row_group().unwrap();
        for channel in &channels {
            let rows = &channel[first..channel.len().min(first + (1 << 20))];
            let mut column = group.next_column().unwrap().unwrap();
            let written = column.typed::<FloatType>().write_batch(rows, None, None);
            assert_eq!(written.unwrap(), rows.len());
            column.close().unwrap();
        }
        group.close().unwrap();
    }
    file.close().unwrap();
}

type Form = fn(&Minute, usize, &mut BufWriter<File>);

/// Formats, and the writer of each.
const FORMS: [(&str, Form); 10] = [
    ("CSV", |m, n, out| csv(m, n, out)),
    ("CSV, gzip", |m, n, out| csv_gz(m, n, out)),
    ("UFF 58", |m, n, out| uff(m, n, out, Numbers::Double)),
    ("UFF 58b", |m, n, out| {
        uff(m, n, out, Numbers::Binary { big: false });
    }),
    ("MAT 5, compressed", |m, n, out| mat5(m, n, out)),
    ("MAT 7.3, compressed chunks", |m, n, out| {
        mat73(m, n, out, Some(8192));
    }),
    ("MAT 7.3, in one piece", |m, n, out| mat73(m, n, out, None)),
    ("Parquet, snappy", |m, n, out| parquet(m, n, out)),
    ("TDMS", |m, n, out| tdms(m, n, out)),
    ("WAV, 32-bit float", |m, n, out| wav(m, n, out)),
];

/// One run of the fork whose recording is a file elsewhere.
fn bench(minute: &Minute, file: &Path, numbered: bool) -> Bench {
    Bench::fork().edit("setup.toml", |text| {
        let mut text = text.rsplitn(3, "[[run]]").last().unwrap().to_owned();
        text = text.replace(RECORDINGS[0], file.to_str().unwrap());
        for (n, name) in minute.names.iter().enumerate().filter(|_| numbered) {
            for key in ["channel", "reference"] {
                let old = format!("{key} = \"{name}\"");
                text = text.replace(&old, &format!("{key} = \"{}\"", n + 1));
            }
        }
        text
    })
}

/// Size of a file in bytes, and the most memory that `identify` takes for it.
fn measured(minute: &Minute, form: Form, name: &str, file: &Path, times: usize) -> (u64, u64) {
    let mut out = BufWriter::new(File::create(file).unwrap());
    form(minute, times, &mut out);
    out.flush().unwrap();
    drop(out);
    let size = std::fs::metadata(file).unwrap().len();
    let test = bench(minute, file, name.starts_with("WAV"));
    let identify = ["identify", "setup.toml"];
    let identify = identify.iter().chain(&bench::BAND);
    let (peak, success, said) = watched(command(test.path(), identify));
    assert!(success, "{name}: {said}");
    (size, peak)
}

/// Seconds that this process and its threads have had of a processor.
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    // Fields 14 and 15, in hundredths; the second one may have blanks.
    let fields = stat.rsplit_once(')').unwrap().1.split_whitespace().skip(11);
    fields
        .take(2)
        .map(|x| x.parse::<f64>().unwrap())
        .sum::<f64>()
        / 100.0
}

#[test]
fn memory_does_not_grow_with_the_file() {
    let minute = Minute::of_fork();
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let file = folder.path().join("large");
    for (name, form) in FORMS {
        // A page and a dictionary of Parquet are full after 262,144 readings, which is 86 times.
        let begin = if name.starts_with("Parquet") { 100 } else { 10 };
        // Peaks of the same short recording are 12.3 to 14.1 MB: threads take their memory in another order.
        let short = (0..3)
            .map(|_| measured(&minute, form, name, &file, begin).1)
            .max();
        let short = short.unwrap();
        let (size, long) = measured(&minute, form, name, &file, begin + 90);
        println!("{name}: {size} bytes, {short} and {long} resident");
        assert!(long < MOST, "{name}: {long}");
        // A tenth of the readings that were added, which is more than chance leaves.
        let bound = 19 * 4 * 3072 * 90 / 10;
        assert!(long < short + bound, "{name}: {short} bytes grew to {long}");
    }
}

#[test]
#[ignore = "some minutes, and 2 GB of disk"]
fn two_gigabytes_of_each_format() {
    let minute = Minute::of_fork();
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let file = folder.path().join("large");
    let mut table = String::from(
        "| format | size of the file | megabytes per second | most memory |\n| --- | --- | --- | --- |\n",
    );
    for (name, form) in FORMS {
        // A small file tells the number of repetitions, where pages and dictionaries are full.
        let (small, _) = measured(&minute, form, name, &file, 200);
        let times = (2_000_000_000 / (small / 200)) as usize;
        let (size, peak) = measured(&minute, form, name, &file, times);
        let names = Recording::open(&file, &[]).unwrap();
        let names: Vec<String> = names.in_file().iter().map(|c| c.name.clone()).collect();
        let wanted: Vec<&str> = names.iter().map(String::as_str).collect();
        // An eighth of the samples tells the speed.
        let rows = (times * minute.readings[0].len() / 8) as u64;
        let begin = processor_time();
        let mut recording = Recording::open(&file, &wanted).unwrap();
        recording.limit(Some(rows));
        recording.settle_rate(Some(write::RATE)).unwrap();
        let mut row = vec![0.0; wanted.len()];
        while recording.next_row(&mut row).unwrap() {}
        assert_eq!(recording.rows(), rows);
        let speed = size as f64 / 8e6 / (processor_time() - begin);
        println!("{name}: {size} bytes, {speed:.0} MB/s, {peak} resident");
        assert!(peak < MOST, "{name}: {peak}");
        let (giga, mebi) = (size as f64 / 1e9, peak as f64 / f64::from(1 << 20));
        writeln!(
            table,
            "| {name} | {giga:.2} GB | {speed:.0} | {mebi:.0} MiB |"
        )
        .unwrap();
    }
    println!("{table}");
    if std::env::var_os("MASSLINE_ACCEPT").is_some_and(|value| value == "1") {
        let manual = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
        let text = std::fs::read_to_string(&manual).unwrap();
        let [begin, end] = ["<!-- readers: begin -->\n\n", "\n<!-- readers: end -->"];
        let (before, rest) = text.split_once(begin).unwrap();
        let (_, after) = rest.split_once(end).unwrap();
        std::fs::write(&manual, format!("{before}{begin}{table}{end}{after}")).unwrap();
    }
}
