//! Tables of readings in a file: its datasets of numbers, found group by group.

use super::attributes::{self, Attribute};
use super::dataset::Dataset;
use super::file::File;
use super::links;
use super::names::{self, Labels};
use super::object::Object;
use super::types::Element;
use crate::limits;
use crate::printable::printable;
use crate::recording::number::Coding;
use crate::recording::some_of;
use crate::recording::testlab::{Part, Signals};
use crate::recording::{RecordingError, rate};
use std::collections::{BTreeMap, HashSet};

/// Deepest nest of groups.
const DEEPEST: usize = 16;
/// Most bytes of a text.
const LONGEST: u64 = 4096;

/// A dataset whose columns or rows are channels.
pub(super) struct Table {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) dataset: Dataset,
    pub(super) coding: Coding,
    /// Dimension of time.
    pub(super) time: usize,
    pub(super) samples: u64,
    /// Number of channels.
    pub(super) across: u64,
    /// Sample rate in Hz, where the file states it.
    pub(super) rate: Option<f64>,
    pub(super) labels: Labels,
}

/// Tables of a file, and notes on datasets that are not read.
pub(super) struct Found {
    pub(super) tables: Vec<Table>,
    pub(super) notes: Vec<String>,
}

/// The tables of a file; `matlab`: of its top level, with the dimensions the other way round.
///
/// # Errors
/// [`RecordingError`] of the structure.
pub(super) fn tables(file: &File, matlab: bool) -> Result<Found, RecordingError> {
    let mut walk = Walk {
        file,
        matlab,
        seen: HashSet::new(),
        tables: Vec::new(),
        numbers: BTreeMap::new(),
        texts: Vec::new(),
        left_out: BTreeMap::new(),
    };
    let root = Object::read(file, file.root)?;
    walk.seen.insert(file.root);
    walk.group(&root, "", None, 0)?;
    walk.signals()?;
    let Walk {
        mut tables,
        left_out,
        ..
    } = walk;
    let mut notes = Vec::new();
    // The controller's other datasets are its specifications and averages.
    if tables.iter().any(|table| table.labels.of_controller) {
        tables.retain(|table| table.labels.of_controller);
        let others: Vec<&String> = tables.iter().skip(1).map(|table| &table.name).collect();
        if !others.is_empty() {
            let others = some_of(others.into_iter());
            notes.push(format!(
                "later streams not read: {others}; each is a recording of its own: write it to a file of its own"
            ));
        }
        tables.truncate(1);
    } else {
        for (reason, names) in left_out {
            notes.push(format!("not read: {}: {reason}", some_of(names.iter())));
        }
    }
    Ok(Found { tables, notes })
}

struct Walk<'a> {
    file: &'a File,
    matlab: bool,
    /// Addresses of the objects that were looked at: links may form circles.
    seen: HashSet<u64>,
    tables: Vec<Table>,
    /// Single numbers and texts within the structs of MATLAB, by the names of their fields.
    numbers: BTreeMap<String, f64>,
    texts: Vec<(String, String)>,
    /// Names of the datasets that are not read, by the reason.
    left_out: BTreeMap<String, Vec<String>>,
}

impl Walk<'_> {
    fn group(
        &mut self,
        group: &Object,
        path: &str,
        above: Option<f64>,
        depth: usize,
    ) -> Result<(), RecordingError> {
        let file = self.file;
        let links = links::links(file, group)?;
        let own = attributes::attributes(file, group)?;
        let mut rate = rate_of(&own).or(above);
        let first = self.tables.len();
        let table = names::channel_table(file, &links)?;
        for (name, at) in links {
            // MATLAB keeps what variables refer to under such names.
            if !self.seen.insert(at) || (self.matlab && name.starts_with('#')) {
                continue;
            }
            if self.seen.len() > limits::COLUMNS {
                return Err(RecordingError::TooManyColumns {
                    file: file.bytes.file.clone(),
                    found: self.seen.len(),
                });
            }
            let object = Object::read(file, at)?;
            if links::is_group(&object) {
                let inner = match self.matlab {
                    true => format!("{path}{name}."),
                    false => format!("{path}{name}/"),
                };
                let own = attributes::attributes(file, &object)?;
                if self.matlab && own.iter().any(|a| a.name == "MATLAB_sparse") {
                    self.note(&format!("{path}{name}"), "a sparse matrix");
                } else if depth == DEEPEST {
                    self.note(&inner, "groups within groups");
                } else {
                    self.group(&object, &inner, rate, depth + 1)?;
                }
                continue;
            }
            let dataset = match Dataset::read(file, &object)? {
                None => continue,
                Some(Ok(dataset)) => dataset,
                Some(Err(reason)) => {
                    self.note(&format!("{path}{name}"), &reason);
                    continue;
                }
            };
            let own = attributes::attributes(file, &object)?;
            if names::is_dimension(file, &own)? {
                continue;
            }
            if own.iter().any(is_scaling) {
                return Err(RecordingError::OtherKind {
                    file: file.bytes.file.clone(),
                    kind: format!(
                        "a file whose dataset {} has packed values, by `scale_factor` or `add_offset`",
                        printable(&format!("{path}{name}"))
                    ),
                    advice: "write the unpacked values, or take the attributes out and state `scale` in the setup",
                });
            }
            let is_field = self.matlab && !path.is_empty();
            if is_field && let Some(text) = text(file, &dataset, &own)? {
                self.texts.push((format!("{path}{name}"), text));
                continue;
            }
            if let Some(number) = scalar(file, &dataset)? {
                rate = rate::stated(&name, || Some(number)).or(rate);
                if is_field {
                    self.numbers.insert(format!("{path}{name}"), number);
                }
                continue;
            }
            let mut labels = names::labels(file, &own)?;
            if let Some(table) = &table {
                labels = table.labels(labels, &name);
            }
            match self.table(dataset, &own, labels)? {
                // The fields of MATLAB's structs are called by their whole path.
                Ok(table) if self.matlab => self.tables.push(Table {
                    name: format!("{path}{name}"),
                    rate: rate_of(&own),
                    ..table
                }),
                Ok(table) => self.tables.push(Table {
                    group: path.to_owned(),
                    name,
                    rate: rate_of(&own),
                    ..table
                }),
                Err(reason) => self.note(&format!("{path}{name}"), reason),
            }
        }
        // A scalar may stand behind the datasets that it is for.
        for table in self.tables.iter_mut().skip(first) {
            table.rate = table.rate.or(rate);
        }
        Ok(())
    }

    /// Gives the structs of Simcenter Testlab their names, units and rates, and leaves out what stands beside them.
    fn signals(&mut self) -> Result<(), RecordingError> {
        let names = self.tables.iter().map(|table| &*table.name);
        let number = |name: &str| Ok(self.numbers.get(name).copied());
        let signals = Signals::of(names, &self.texts, number)?;
        let of_field = |(name, number): (&String, &f64)| {
            let (_, field) = name.rsplit_once('.')?;
            rate::stated(field, || Some(*number))
        };
        // A field states the rate for all structs that have none of their own.
        let stated = self.numbers.iter().find_map(of_field);
        let mut first = None;
        for mut table in std::mem::take(&mut self.tables) {
            let name = table.name.clone();
            match signals.part(&name) {
                None => {
                    table.rate = table.rate.or(stated);
                    self.tables.push(table);
                }
                Some(Part::Beside) => {}
                Some(Part::Samples(owner, signal)) => match signal.rate(first) {
                    Err(why) => self.note(owner, &why),
                    Ok(rate) => {
                        first.get_or_insert(rate);
                        table.rate = Some(rate);
                        let labels = signal.labels(owner, table.across as usize);
                        let (names, units): (Vec<String>, Vec<Option<String>>) =
                            labels.into_iter().unzip();
                        table.labels.units =
                            units.into_iter().map(Option::unwrap_or_default).collect();
                        if let [name] = &*names {
                            table.name.clone_from(name);
                        }
                        table.labels.names = names;
                        self.tables.push(table);
                    }
                },
            }
        }
        Ok(())
    }

    fn note(&mut self, name: &str, reason: &str) {
        let names = self.left_out.entry(reason.to_owned()).or_default();
        names.push(name.to_owned());
    }

    /// A dataset as a table; or why it is none.
    fn table(
        &self,
        dataset: Dataset,
        own: &[Attribute],
        labels: Labels,
    ) -> Result<Result<Table, &'static str>, RecordingError> {
        if self.matlab {
            match class(self.file, own)?.as_deref() {
                Some("char") => return Ok(Err("text")),
                Some("cell") => return Ok(Err("a cell array")),
                Some("logical") => return Ok(Err("logical values")),
                Some("double" | "single") | None => {}
                Some(class) if class.starts_with("int") || class.starts_with("uint") => {}
                Some(_) => return Ok(Err("an object")),
            }
            if own
                .iter()
                .any(|a| a.name == "MATLAB_empty" && a.number() == Some(1.0))
            {
                return Ok(Err("it is empty"));
            }
        }
        let coding = match dataset.datatype.element {
            Element::Number(coding) => coding,
            Element::Text | Element::TextElsewhere => return Ok(Err("text")),
            Element::Other(kind) => return Ok(Err(kind)),
        };
        let shape = dataset.space.shape.as_slice();
        // Of two equal sides MATLAB's rows are time, which are its second dimension here.
        let (time, samples, across) = match *shape {
            [] => return Ok(Err("a single value")),
            [samples] => (0, samples, 1),
            [a, b] if a > b || (a == b && !self.matlab) => (0, a, b),
            [a, b] => (1, b, a),
            _ => return Ok(Err("it has more than two dimensions")),
        };
        if samples == 0 || across == 0 || dataset.size().is_none() {
            return Ok(Err("it is empty"));
        }
        Ok(Ok(Table {
            group: String::new(),
            name: String::new(),
            dataset,
            coding,
            time,
            samples,
            across,
            rate: None,
            labels,
        }))
    }
}

/// `true` for an attribute by which values are to be multiplied or shifted (conventions of netCDF).
fn is_scaling(attribute: &Attribute) -> bool {
    match &*attribute.name {
        "scale_factor" => attribute.number() != Some(1.0),
        "add_offset" => attribute.number() != Some(0.0),
        _ => false,
    }
}

/// The sample rate that attributes state.
fn rate_of(attributes: &[Attribute]) -> Option<f64> {
    let mut all = attributes.iter();
    all.find_map(|a| rate::stated(&a.name, || a.number()))
}

/// The class of a variable of MATLAB.
fn class(file: &File, own: &[Attribute]) -> Result<Option<String>, RecordingError> {
    let class = own.iter().find(|a| a.name == "MATLAB_class");
    let texts = class.map(|class| class.texts(file)).transpose()?.flatten();
    Ok(texts.and_then(|texts| texts.into_iter().next()))
}

/// The text of a dataset that MATLAB calls one; `None` of another one, and of a long one.
fn text(
    file: &File,
    dataset: &Dataset,
    own: &[Attribute],
) -> Result<Option<String>, RecordingError> {
    let is_text = class(file, own)?.as_deref() == Some("char");
    let short = dataset.size().is_some_and(|size| size <= LONGEST);
    match dataset.datatype.element {
        Element::Number(coding) if is_text && short => {
            let elements = dataset.elements(file)?;
            let units = elements.map(|elements| {
                let units = elements.chunks_exact(coding.kind.size());
                units
                    .map(|unit| coding.value(unit) as u16)
                    .collect::<Vec<_>>()
            });
            Ok(units.map(|units| String::from_utf16_lossy(&units)))
        }
        _ => Ok(None),
    }
}

/// The number of a dataset that has one.
fn scalar(file: &File, dataset: &Dataset) -> Result<Option<f64>, RecordingError> {
    match dataset.datatype.element {
        Element::Number(coding) if dataset.space.count() == Some(1) => {
            let elements = dataset.elements(file)?;
            Ok(elements.map(|elements| coding.value(&elements)))
        }
        _ => Ok(None),
    }
}
