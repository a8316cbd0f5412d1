//! WAV: samples of all channels, as shares of full scale where they are whole numbers.

use super::input::Input;
use super::source::{Block, Channel, Place, Source, StatedRate};
use super::{Format, Mismatch, Preamble, RecordingError};
use hound::{SampleFormat, WavReader};
use massline_firmware::wire::Health;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |start| {
        matches!(start.get(..4), Some(b"RIFF" | b"RF64")) && start.get(8..12) == Some(b"WAVE")
    },
    open: |input, _| Ok(Box::new(WavFile::open(input)?)),
};

/// A WAV file that is being read.
struct WavFile {
    file: PathBuf,
    reader: WavReader<BufReader<Box<dyn Read>>>,
    channels: Vec<Channel>,
    /// Share of full scale of one step of a whole number; `None`: numbers with fractions.
    step: Option<f64>,
    samples: u64,
    next: u64,
    selected: Vec<usize>,
    frame: Vec<f64>,
    preamble: Preamble,
}

impl WavFile {
    fn open(input: Input) -> Result<Self, RecordingError> {
        let Input { file, content, .. } = input;
        let reader = WavReader::new(BufReader::new(content));
        let reader = reader.map_err(|error| wrong(&file, Place::Byte(0), error))?;
        let spec = reader.spec();
        let channel = |number: u16| Channel {
            name: number.to_string(),
            ..Channel::default()
        };
        let step = match spec.sample_format {
            SampleFormat::Float => None,
            SampleFormat::Int => Some(0.5_f64.powi(i32::from(spec.bits_per_sample) - 1)),
        };
        Ok(Self {
            channels: (1..=spec.channels).map(channel).collect(),
            step,
            samples: u64::from(reader.duration()),
            next: 0,
            selected: Vec::new(),
            frame: vec![0.0; usize::from(spec.channels)],
            preamble: Preamble::default(),
            file,
            reader,
        })
    }

    /// Reads the next reading of all channels.
    fn frame(&mut self) -> Result<(), RecordingError> {
        for slot in &mut self.frame {
            let reading = match self.step {
                None => self
                    .reader
                    .samples::<f32>()
                    .next()
                    .map(|r| r.map(f64::from)),
                Some(step) => {
                    let whole = self.reader.samples::<i32>().next();
                    whole.map(|r| r.map(|whole| f64::from(whole) * step))
                }
            };
            let place = Place::Sample(self.next + 1);
            *slot = match reading {
                Some(reading) => reading.map_err(|error| wrong(&self.file, place, error))?,
                None => return Err(ended(&self.file, place, self.samples)),
            };
        }
        Ok(())
    }
}

/// The file ends before the samples that it states.
fn ended(file: &Path, place: Place, samples: u64) -> RecordingError {
    RecordingError::Malformed {
        file: file.to_owned(),
        place: Some(place),
        mismatch: Box::new(Mismatch {
            channel: String::new(),
            found: "the file ends".to_owned(),
            expected: format!("{samples} samples"),
            advice: "it was cut: copy it again, or record again",
        }),
    }
}

fn wrong(file: &Path, place: Place, error: hound::Error) -> RecordingError {
    match error {
        hound::Error::Unsupported => RecordingError::OtherKind {
            file: file.to_owned(),
            kind: "a WAV file of another coding than PCM of 8 to 32 bits and 32-bit float"
                .to_owned(),
            advice: "save it as PCM or as 32-bit float",
        },
        hound::Error::IoError(error) => RecordingError::Damaged {
            file: file.to_owned(),
            place,
            reason: error.to_string(),
        },
        error => RecordingError::Malformed {
            file: file.to_owned(),
            place: Some(place),
            mismatch: Box::new(Mismatch {
                channel: String::new(),
                found: format!("a header that cannot be read ({error})"),
                expected: "that of a WAV file".to_owned(),
                advice: "copy or export it again",
            }),
        },
    }
}

impl Source for WavFile {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn sample_rate(&self) -> Option<StatedRate> {
        Some(StatedRate {
            value: f64::from(self.reader.spec().sample_rate),
            place: "its header",
        })
    }

    fn samples(&self) -> Option<u64> {
        Some(self.samples)
    }

    fn is_share_of_full_scale(&self) -> bool {
        self.step.is_some()
    }

    fn described(&self) -> Option<String> {
        let spec = self.reader.spec();
        let (bits, channels) = (spec.bits_per_sample, spec.channels);
        Some(match self.step {
            None => format!("WAV, {channels} channels of {bits}-bit float"),
            Some(_) => format!("WAV, {channels} channels of {bits}-bit PCM, full scale as 1"),
        })
    }

    fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    fn select(&mut self, channels: &[usize]) {
        self.selected = channels.to_vec();
    }

    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError> {
        while block.room() > 0 && self.next < self.samples {
            self.frame()?;
            self.next += 1;
            block.push(Place::Sample(self.next), Health::GOOD, |k| {
                let reading = self.selected.get(k).and_then(|c| self.frame.get(*c));
                Ok(reading.copied().unwrap_or(f64::NAN))
            })?;
        }
        Ok(())
    }
}
