//! Runs that share their equations and their way of averaging, read together as lines.

use super::{MeasuredRun, MeasuredSine, Measurement, RunGeometry, Spectra, WINDOW};
use massline_core::masslines::{CrossLines, DriveLines, Lines, MasslineError, SineLines};
use massline_core::spectra::{CrossAverage, CrossSums, LineRange, RunResponses};

/// Runs that condense together: alike in their equations and in what they are referred to.
pub struct Group<'a> {
    members: Members<'a>,
    hop: f64,
    /// Averaging band, as indices into the lines.
    pub band: LineRange,
}

enum Members<'a> {
    Random(Vec<&'a MeasuredRun>),
    Sine(Vec<&'a MeasuredSine>),
}

impl Measurement {
    /// The groups of runs, random ones first.
    #[must_use]
    pub fn groups(&self) -> Vec<Group<'_>> {
        let random = gather(&self.runs, |a, b| {
            alike(&a.geometry, &b.geometry) && a.responses().is_some() == b.responses().is_some()
        });
        let sines = gather(&self.sines, |a, b| alike(&a.geometry, &b.geometry));
        let random = random.into_iter().map(|runs| Group {
            members: Members::Random(runs),
            hop: self.hop,
            band: self.band,
        });
        let sines = sines.into_iter().map(|runs| Group {
            band: runs[0].band,
            members: Members::Sine(runs),
            hop: self.hop,
        });
        random.chain(sines).collect()
    }

    /// A group of one random run.
    #[must_use]
    pub fn group_of<'a>(&'a self, run: &'a MeasuredRun) -> Group<'a> {
        Group {
            members: Members::Random(vec![run]),
            hop: self.hop,
            band: self.band,
        }
    }
}

fn alike(a: &RunGeometry, b: &RunGeometry) -> bool {
    a.equations.alike(&b.equations)
}

fn gather<T>(runs: &[T], alike: impl Fn(&T, &T) -> bool) -> Vec<Vec<&T>> {
    let mut groups: Vec<Vec<&T>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|g| alike(g[0], run)) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

impl<'a> Group<'a> {
    /// Names of the runs.
    #[must_use]
    pub fn names(&self) -> Vec<&'a str> {
        match &self.members {
            Members::Random(runs) => runs.iter().map(|r| r.name.as_str()).collect(),
            Members::Sine(runs) => runs.iter().map(|r| r.name.as_str()).collect(),
        }
    }

    /// The sensors, which the runs share as far as it matters.
    #[must_use]
    pub fn geometry(&self) -> &'a RunGeometry {
        match &self.members {
            Members::Random(runs) => &runs[0].geometry,
            Members::Sine(runs) => &runs[0].geometry,
        }
    }

    /// `true` if each run is a single pair of acceleration and force at every line.
    #[must_use]
    pub fn is_paired(&self) -> bool {
        match &self.members {
            Members::Random(runs) => runs[0].responses().is_some(),
            Members::Sine(_) => true,
        }
    }

    /// Lets `look` see the lines of all runs, or of one.
    ///
    /// # Errors
    /// [`MasslineError`] if they cannot be read together.
    pub fn read<R>(
        &self,
        one: Option<usize>,
        look: impl FnOnce(&dyn Lines) -> R,
    ) -> Result<R, MasslineError> {
        // All of them were averaged by the same settings, and there is at least one.
        let unlike = MasslineError::TooFewRuns {
            needed: 1,
            found: 0,
        };
        let chosen = one.map_or(0..self.names().len(), |k| k..k + 1);
        match &self.members {
            Members::Sine(runs) => {
                let frequencies = &runs[0].frequencies;
                let runs = runs.get(chosen).ok_or(unlike)?;
                let runs: Vec<_> = runs.iter().map(|r| r.run()).collect();
                let lines = SineLines::new(frequencies, &runs);
                lines.map(|lines| look(&lines)).ok_or(unlike)
            }
            Members::Random(runs) => {
                let runs = runs.get(chosen).ok_or(unlike)?;
                let responses: Vec<RunResponses<'_>> =
                    runs.iter().filter_map(|r| r.responses()).collect();
                if responses.len() == runs.len() {
                    let lines = DriveLines::new(&responses, WINDOW);
                    lines.map(|lines| look(&lines)).ok_or(unlike)
                } else {
                    self.read_undriven(runs, look).unwrap_or(Err(unlike))
                }
            }
        }
    }

    fn read_undriven<R>(
        &self,
        runs: &[&MeasuredRun],
        look: impl FnOnce(&dyn Lines) -> R,
    ) -> Option<Result<R, MasslineError>> {
        let settings = *runs.first()?.settings();
        let mut storage: Vec<(Vec<CrossSums>, u32)> = Vec::new();
        for run in runs {
            match &run.spectra {
                Spectra::Cross { sums } => storage.push((sums.clone(), run.blocks)),
                Spectra::Drive { .. } => return None,
            }
        }
        let mut averages = Vec::new();
        for (sums, blocks) in &mut storage {
            averages.push(CrossAverage::resume(&settings, sums, *blocks).ok()?);
        }
        let maps: Vec<_> = runs.iter().map(|r| r.geometry.map.clone()).collect();
        let (grid, hop) = (settings.grid(), self.hop);
        let lines = CrossLines::new(&averages, grid, self.band, WINDOW, hop, &maps);
        Some(lines.map(|lines| {
            let stated: Vec<_> = runs.iter().filter_map(|run| run.stated_noise()).collect();
            look(&lines.or_stated(&stated))
        }))
    }
}
