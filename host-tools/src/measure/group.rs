//! Runs that share their equations and their way of averaging, read together as lines.

use super::{MeasuredRun, MeasuredSine, Measurement, RunGeometry, Spectra, WINDOW};
use crate::setup::Setup;
use massline_core::masslines::{CrossLines, DriveLines, Lines, SineLines};
use massline_core::spectra::{CrossAverage, RunResponses, Sum};
use std::ops::Range;

/// Runs that condense together: alike in their equations and in what they are referred to.
pub struct Group<'a> {
    members: Members<'a>,
    hop: f64,
    /// Averaging band, as indices into the lines.
    pub band: Range<usize>,
}

enum Members<'a> {
    Random(Vec<&'a MeasuredRun>),
    Sine(Vec<&'a MeasuredSine>),
}

impl Measurement {
    /// The groups of runs, random ones first.
    #[must_use]
    pub fn groups(&self, setup: &Setup) -> Vec<Group<'_>> {
        let random = gather(&self.runs, |a, b| {
            alike(&a.geometry, &b.geometry) && a.responses().is_some() == b.responses().is_some()
        });
        let sines = gather(&self.sines, |a, b| alike(&a.geometry, &b.geometry));
        let band = setup.processing.as_ref().map(|p| p.averaging_band);
        let random = random.into_iter().map(|runs| Group {
            members: Members::Random(runs),
            hop: self.hop,
            band: self.band.clone(),
        });
        let sines = sines.into_iter().map(|runs| Group {
            band: band.map_or(0..0, |band| runs[0].within(band)),
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
            band: self.band.clone(),
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

    /// Whether each run is a single pair of acceleration and force at every line.
    #[must_use]
    pub fn is_paired(&self) -> bool {
        match &self.members {
            Members::Random(runs) => runs[0].responses().is_some(),
            Members::Sine(_) => true,
        }
    }

    /// Lets `look` see the lines of all runs, or of one; `None` if they cannot be read
    /// together.
    pub fn read<R>(&self, one: Option<usize>, look: impl FnOnce(&dyn Lines) -> R) -> Option<R> {
        let chosen = one.map_or(0..self.names().len(), |k| k..k + 1);
        match &self.members {
            Members::Sine(runs) => {
                let frequencies = &runs[0].frequencies;
                let runs: Vec<_> = runs.get(chosen)?.iter().map(|r| r.run()).collect();
                SineLines::new(frequencies, &runs).map(|lines| look(&lines))
            }
            Members::Random(runs) => {
                let runs = runs.get(chosen)?;
                let responses: Vec<RunResponses<'_>> =
                    runs.iter().filter_map(|r| r.responses()).collect();
                if responses.len() == runs.len() {
                    DriveLines::new(&responses, WINDOW).map(|lines| look(&lines))
                } else {
                    self.read_undriven(runs, look)
                }
            }
        }
    }

    fn read_undriven<R>(
        &self,
        runs: &[&MeasuredRun],
        look: impl FnOnce(&dyn Lines) -> R,
    ) -> Option<R> {
        let settings = *runs.first()?.settings();
        let mut storage: Vec<(Vec<Sum>, u32)> = Vec::new();
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
        let band = self.band.clone();
        let (grid, hop) = (settings.grid(), self.hop);
        CrossLines::new(&averages, grid, band, WINDOW, hop, &maps).map(|lines| look(&lines))
    }
}
