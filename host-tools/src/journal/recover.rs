//! A recording from the rows that a killed program left: a journal, or the lines of a CSV file.

use super::read::{self, Damage, Part, Reader};
use crate::limits;
use crate::output::{self, Existing, Output, OutputError};
use crate::recording::{About, HEALTH_COLUMN, Rows, TrueRate, Written, spelt};
use massline_firmware::wire::Health;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Places of damage that are listed.
const LISTED: usize = 100;

/// A recording that was recovered.
#[derive(Debug)]
pub struct Recovered {
    /// The recording.
    pub file: PathBuf,
    /// Names of its channels.
    pub channels: Vec<String>,
    /// Rows, those that are lost included.
    pub samples: u64,
    /// Rows with faults, those that are lost included.
    pub faulty: u64,
    /// Damage before the last row.
    pub lost: Lost,
    /// Bytes behind the last whole row: the row or frame that was being written.
    pub unfinished: u64,
    /// The true sample rate as far as it was known.
    pub sample_rate: Option<TrueRate>,
}

/// Damage in the middle.
#[derive(Debug, Default)]
pub struct Lost {
    /// Rows that could not be read and are marked as missing.
    pub samples: u64,
    /// First byte and number of bytes of damaged parts, at most a hundred of them.
    pub places: Vec<[u64; 2]>,
    /// Number of damaged bytes.
    pub bytes: u64,
}

/// Why nothing is recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", part.display())]
    Unreadable {
        /// The file.
        part: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A program is recording to it.
    #[error("{}: a massline is recording to it; let it finish", part.display())]
    InUse {
        /// The file.
        part: PathBuf,
    },
    /// The name of the recording does not follow from its own.
    #[error(
        "{}: its name does not tell the recording's, as that of x.parquet.part does; name one that ends in .parquet, .csv or .csv.gz by --out", part.display()
    )]
    NoName {
        /// The file.
        part: PathBuf,
    },
    /// A name of another ending.
    #[error("{}: a recording's name ends in .parquet, .csv or .csv.gz", file.display())]
    Ending {
        /// The file that was to be written.
        file: PathBuf,
    },
    /// Some other file.
    #[error(
        "{}: this is neither a journal nor the rows of a recording that was not finished; such files have names that end in .part", part.display()
    )]
    Other {
        /// The file.
        part: PathBuf,
    },
    /// No row in it.
    #[error("{}: there is no whole row in it, so that there is nothing to recover", part.display())]
    Nothing {
        /// The file.
        part: PathBuf,
    },
    /// A journal of which no head is left.
    #[error(
        "{}: the names of its channels, which stand at its beginning and before every 64th frame of rows, are damaged wherever they stand", part.display()
    )]
    NoHead {
        /// The file.
        part: PathBuf,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Makes a recording from the rows that a killed program left in `part`, which stays as it is. Without
/// `out` its name is that of `part` without `.part`. With `force` a file of that name is replaced.
///
/// # Errors
/// [`RecoverError`]; then a file of that name is as it was.
pub fn recover(part: &Path, out: Option<&Path>, force: bool) -> Result<Recovered, RecoverError> {
    let unreadable = |source| RecoverError::Unreadable {
        part: part.to_owned(),
        source,
    };
    let metadata = std::fs::metadata(part).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(unreadable(io::Error::other("it is no regular file")));
    }
    if output::is_in_use(part) == Some(true) {
        return Err(RecoverError::InUse {
            part: part.to_owned(),
        });
    }
    let (file, format) = target(part, out)?;
    output::check(&file, [part], Existing::Keep.or_force(force))?;
    let open = || File::open(part).map(BufReader::new);
    let is_journal = open().and_then(read::is_journal).map_err(unreadable)?;
    let mut recovered = Recovered {
        file: file.clone(),
        channels: Vec::new(),
        samples: 0,
        faulty: 0,
        lost: Lost::default(),
        unfinished: 0,
        sample_rate: None,
    };
    let about = if is_journal {
        head(open().map_err(unreadable)?).map_err(unreadable)?
    } else {
        names(open().map_err(unreadable)?, part)?
    };
    let about = about.ok_or_else(|| RecoverError::NoHead {
        part: part.to_owned(),
    })?;
    recovered.channels = about.channels.iter().map(|c| c.name.clone()).collect();
    recovered.sample_rate.clone_from(&about.sample_rate);
    let refused = |source| OutputError::write(&file, source);
    let mut output = Output::create(&file)?;
    {
        let mut growing = Growing {
            rows: Rows::begin(format, &mut output, &about, true).map_err(refused)?,
            recovered: &mut recovered,
            refused: None,
            blank: vec![0.0; about.channels.len()],
        };
        let opened = open().map_err(unreadable)?;
        let read = if is_journal {
            journal(opened, &about, &mut growing)
        } else {
            lines(opened, &mut growing)
        };
        if let Some(source) = growing.refused.take() {
            return Err(refused(source).into());
        }
        read.map_err(unreadable)?;
        growing.rows.finish().map_err(refused)?;
    }
    if recovered.samples == recovered.lost.samples {
        return Err(RecoverError::Nothing {
            part: part.to_owned(),
        });
    }
    output.finish()?.place()?;
    Ok(recovered)
}

/// The recording's name and format.
fn target(part: &Path, out: Option<&Path>) -> Result<(PathBuf, Written), RecoverError> {
    if let Some(file) = out {
        let format = Written::of(file).ok_or_else(|| RecoverError::Ending {
            file: file.to_owned(),
        })?;
        return Ok((file.to_owned(), format));
    }
    let is_part = part.extension().is_some_and(|e| e == output::GROWING);
    let file = part.with_extension("");
    let format = Written::of(&file).filter(|_| is_part);
    let format = format.ok_or_else(|| RecoverError::NoName {
        part: part.to_owned(),
    })?;
    Ok((file, format))
}

/// The recording that is being written, and the file system's refusal.
struct Growing<'a, 'w> {
    rows: Rows<'w>,
    recovered: &'a mut Recovered,
    refused: Option<io::Error>,
    blank: Vec<f32>,
}

impl Growing<'_, '_> {
    fn row(&mut self, si: &[f32], health: Health) -> io::Result<()> {
        if let Err(error) = self.rows.row(si, health) {
            self.refused = Some(error);
            return Err(io::ErrorKind::Other.into());
        }
        self.recovered.samples += 1;
        self.recovered.faulty += u64::from(!health.is_good());
        Ok(())
    }

    /// Adds rows that are lost.
    fn lose(&mut self, count: u64) -> io::Result<()> {
        let blank = std::mem::take(&mut self.blank);
        let done = (0..count).try_for_each(|_| self.row(&blank, Health::MISSING));
        self.blank = blank;
        self.recovered.lost.samples += count;
        done
    }

    fn damage(&mut self, at: u64, bytes: u64) {
        let lost = &mut self.recovered.lost;
        lost.bytes += bytes;
        if lost.places.len() < LISTED {
            lost.places.push([at, bytes]);
        }
    }
}

/// Description of its recording in a journal; `None` if it has none.
fn head(file: impl Read) -> io::Result<Option<About>> {
    let mut reader = Reader::new(file);
    let (mut about, mut rate) = (None, None);
    while let Some(part) = reader.next()? {
        match part {
            Part::Head(found) => about = about.or(Some(found)),
            Part::Rate(found) => rate = Some(found),
            Part::Rows { .. } | Part::Damage(_) => {}
        }
    }
    Ok(about.map(|about| About {
        sample_rate: rate.or(about.sample_rate.clone()),
        ..*about
    }))
}

/// Writes the rows of a journal. Rows that are missing between two frames are marked so.
fn journal(file: impl Read, about: &About, out: &mut Growing<'_, '_>) -> io::Result<()> {
    let mut reader = Reader::new(file);
    let width = about.channels.len();
    // Beyond the damaged bytes, a gap is no longer than a recording bridges.
    let rate = about.nominal_sample_rate.unwrap_or(1.0);
    let bridged = (limits::LONGEST_GAP * rate) as u64;
    let mut damaged = 0;
    let mut row = Vec::with_capacity(width);
    while let Some(part) = reader.next()? {
        match part {
            Part::Head(_) | Part::Rate(_) => {}
            Part::Damage(Damage { bytes, is_end, .. }) if is_end => {
                out.recovered.unfinished = bytes;
            }
            Part::Damage(Damage { at, bytes, .. }) => {
                damaged += bytes;
                out.damage(at, bytes);
            }
            Part::Rows {
                first,
                width: found,
                content,
            } => {
                let next = out.recovered.samples;
                let missing = first.saturating_sub(next);
                let most = bridged + damaged / (2 + 4 * width as u64);
                if found != width || missing > most {
                    // Of another recording.
                    continue;
                }
                out.lose(missing)?;
                damaged = 0;
                let known = next.saturating_sub(first);
                let rows = read::rows(content);
                for (health, readings) in rows.skip(usize::try_from(known).unwrap_or(usize::MAX)) {
                    row.clear();
                    row.extend(readings);
                    out.row(&row, health)?;
                }
            }
        }
    }
    Ok(())
}

/// Length of the whole lines of a file.
fn whole_lines(file: &mut (impl Read + Seek)) -> io::Result<u64> {
    let mut end = file.seek(SeekFrom::End(0))?;
    let mut piece = Vec::new();
    while end > 0 {
        let begin = end.saturating_sub(4096);
        file.seek(SeekFrom::Start(begin))?;
        piece.clear();
        file.take(end - begin).read_to_end(&mut piece)?;
        if let Some(at) = piece.iter().rposition(|byte| *byte == b'\n') {
            end = begin + at as u64 + 1;
            break;
        }
        end = begin;
    }
    file.rewind()?;
    Ok(end)
}

fn records(file: impl Read) -> csv::Reader<impl Read> {
    let mut builder = csv::ReaderBuilder::new();
    builder.has_headers(false).flexible(true).from_reader(file)
}

/// The names of the channels of lines, which end in the faults.
fn names(mut file: BufReader<File>, part: &Path) -> Result<Option<About>, RecoverError> {
    let unreadable = |source| RecoverError::Unreadable {
        part: part.to_owned(),
        source,
    };
    let whole = whole_lines(&mut file).map_err(unreadable)?;
    let mut record = csv::StringRecord::new();
    let mut reader = records(file.take(whole.min(limits::ROW)));
    let other = || RecoverError::Other {
        part: part.to_owned(),
    };
    if !reader.read_record(&mut record).map_err(|_| other())? {
        return Err(other());
    }
    let mut names: Vec<&str> = record.iter().collect();
    if names.pop() != Some(HEALTH_COLUMN) {
        return Err(other());
    }
    Ok(Some(About::of_names(names)))
}

/// Writes the rows of whole lines. A line that cannot be read is a row that is lost, or several by its length.
fn lines(mut file: BufReader<File>, out: &mut Growing<'_, '_>) -> io::Result<()> {
    let length = file.get_ref().metadata()?.len();
    let whole = whole_lines(&mut file)?;
    out.recovered.unfinished = length - whole;
    let mut reader = records(file.take(whole));
    let mut record = csv::ByteRecord::new();
    let width = out.recovered.channels.len();
    let mut row = Vec::with_capacity(width);
    let mut is_header = true;
    let (mut whole_rows, mut damaged) = (Length::default(), Length::default());
    while reader.read_byte_record(&mut record)? {
        if std::mem::take(&mut is_header) {
            continue;
        }
        row.clear();
        let at = record.position().map_or(0, csv::Position::byte);
        let bytes = reader.position().byte().saturating_sub(at);
        match parsed(&record, width, &mut row) {
            Some(health) => {
                out.lose(std::mem::take(&mut damaged).rows_of(&whole_rows))?;
                whole_rows.add(&record, bytes);
                out.row(&row, health)?;
            }
            None => {
                damaged.add(&record, bytes);
                out.damage(at, bytes);
            }
        }
    }
    out.lose(damaged.rows_of(&whole_rows))
}

/// Lines and their bytes.
#[derive(Default)]
struct Length {
    lines: u64,
    bytes: u64,
    /// Bytes that no line of numbers has.
    foreign: u64,
}

impl Length {
    fn add(&mut self, record: &csv::ByteRecord, bytes: u64) {
        let foreign = |byte: &&u8| !(byte.is_ascii_graphic() || byte.is_ascii_whitespace());
        self.lines += 1;
        self.bytes += bytes;
        self.foreign += record.as_slice().iter().filter(foreign).count() as u64;
    }

    /// Rows that these lines were: where damage took more than a row of the mean length of others, and ends of lines
    /// with it, as many as their bytes are.
    fn rows_of(&self, others: &Self) -> u64 {
        if others.lines == 0 || self.foreign * others.lines <= others.bytes {
            return self.lines;
        }
        let mean = others.bytes as f64 / others.lines as f64;
        (self.bytes as f64 / mean).round() as u64
    }
}

/// The faults of a line, and its readings; `None` if it is none.
fn parsed(record: &csv::ByteRecord, width: usize, row: &mut Vec<f32>) -> Option<Health> {
    let text = |at: usize| {
        record
            .get(at)
            .and_then(|bytes| std::str::from_utf8(bytes).ok())
    };
    if record.len() != width + 1 {
        return None;
    }
    let health = spelt(text(width)?).ok()?;
    for column in 0..width {
        let missing = health.contains(Health::MISSING);
        let reading = match text(column)? {
            "" if missing => 0.0,
            number => number.parse().ok()?,
        };
        row.push(Some(reading).filter(|x: &f32| x.is_finite())?);
    }
    Some(health)
}
