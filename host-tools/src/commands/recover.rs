//! `massline recover`: a recording from what a killed program left.

use super::{Failure, Verbosity, print_json, print_line, warn};
use crate::journal::{Recovered, recover};
use crate::recording::TrueRate;
use serde::Serialize;
use std::path::PathBuf;

/// Make a recording of the rows that a killed or failed `board record` left (.part)
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline recover x.parquet.part\n  massline recover x.parquet.part --out x.csv\n\nPART stays as it is. All rows that `board record` had told of are in it; at most those that\nwere being written are lost. Rows that are damaged are marked as missing in the column\n`health`, so that nothing behind them shifts."
)]
pub struct Arguments {
    /// The file whose name ends in .part
    part: PathBuf,
    /// The recording, .parquet, .csv or .csv.gz; by default the name without .part
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace a file of that name
    #[arg(long)]
    force: bool,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] if there is no recording.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let Arguments {
        part,
        out,
        force,
        json,
    } = arguments;
    let recovered = recover(part, out.as_deref(), *force).map_err(Failure::input)?;
    if *json {
        print_json(&Document::new(&recovered))?;
    } else {
        let file = recovered.file.display();
        print_line(&format!(
            "{file}: {} samples of {} channels",
            recovered.samples,
            recovered.channels.len()
        ))?;
    }
    warn(&notes(&recovered), verbosity);
    Ok(())
}

fn notes(recovered: &Recovered) -> Vec<String> {
    let mut notes = Vec::new();
    let lost = &recovered.lost;
    if lost.bytes > 0 || lost.samples > 0 {
        let places = lost.places.iter();
        let places: Vec<String> = places
            .map(|[at, n]| format!("{n} from byte {at} on"))
            .collect();
        notes.push(format!(
            "{} bytes are damaged ({}): {} samples are lost and marked as missing",
            lost.bytes,
            places.join(", "),
            lost.samples
        ));
    }
    if recovered.unfinished > 0 {
        notes.push(format!(
            "the last {} bytes are of what was being written, and not whole",
            recovered.unfinished
        ));
    }
    if recovered.sample_rate.is_none() {
        notes.push(
            "the true sample rate is not known: write `sample_rate` into the setup".to_owned(),
        );
    }
    notes
}

/// The document of a recovery, `massline/recover/1`.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    file: String,
    channels: &'a [String],
    samples: u64,
    faulty_samples: u64,
    /// Samples that could not be read, among them.
    lost_samples: u64,
    damaged_bytes: u64,
    /// First byte and number of bytes.
    damaged: &'a [[u64; 2]],
    /// Bytes behind the last whole row.
    unfinished_bytes: u64,
    true_sample_rate: Option<&'a TrueRate>,
}

impl<'a> Document<'a> {
    fn new(recovered: &'a Recovered) -> Self {
        Self {
            schema: "massline/recover/1",
            file: recovered.file.display().to_string(),
            channels: &recovered.channels,
            samples: recovered.samples,
            faulty_samples: recovered.faulty,
            lost_samples: recovered.lost.samples,
            damaged_bytes: recovered.lost.bytes,
            damaged: &recovered.lost.places,
            unfinished_bytes: recovered.unfinished,
            true_sample_rate: recovered.sample_rate.as_ref(),
        }
    }
}
