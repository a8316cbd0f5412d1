//! Channels that are late: their phase against the motion of the interface grows with frequency.

use nalgebra::Complex;

use super::evidence::Evidence;
use super::hypothesis::places;
use super::model::Kind;
use super::table::{Gauge, Line, Regression};

/// Delays that are tried, samples on both sides in halves.
const LATEST: i32 = 24;
/// Unexplained share of a channel at its best delay, over that without one, below which it may be
/// late.
const HALVED: f64 = 0.5;
/// What taking a delay out must lower the sum of the logarithms of all unexplained shares by.
const GAIN: f64 = 1.5;
/// Most delays that are taken out.
const MOST: usize = 2;

/// The lines with some channels earlier by a phase that grows with frequency.
fn earlier(lines: &[Line], channels: &[usize], phase: f64) -> Vec<Line> {
    let mut all = lines.to_vec();
    for line in &mut all {
        let (sin, cos) = libm::sincos(line.frequency * phase);
        let turn = Complex::new(cos, sin);
        for &channel in channels {
            line.products
                .row_mut(channel)
                .iter_mut()
                .for_each(|z| *z *= turn);
            line.products
                .column_mut(channel)
                .iter_mut()
                .for_each(|z| *z *= turn.conj());
        }
    }
    all
}

impl Evidence {
    fn terms(&self, channel: usize) -> usize {
        match self.sensors[channel].kind {
            Kind::Interface => 1,
            _ => 3,
        }
    }

    fn live(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.sensors.len()).filter(|i| !self.dead.contains(i))
    }

    /// Sum of the logarithms of the shares that the motion leaves of each channel.
    fn unexplained(&self, lines: &[Line]) -> Option<f64> {
        let gauge = Gauge::of(lines, &self.moving(None))?;
        let regression = Regression::new(lines, &gauge, self.runs)?;
        self.live()
            .map(|i| {
                Some(
                    regression
                        .fit(i, self.terms(i), 0.0)?
                        .unexplained
                        .max(1e-12)
                        .ln(),
                )
            })
            .sum()
    }

    /// The delay of a channel against the others, as a phase at the highest line, where one of at
    /// least half a sample halves what they do not explain of it.
    fn lateness(&self, lines: &[Line], channel: usize) -> Option<f64> {
        let gauge = Gauge::of(lines, &self.moving(Some(channel)))?;
        let regression = Regression::new(lines, &gauge, self.runs)?;
        let left = |halves: i32| {
            let phase = f64::from(halves) * 0.5 * self.sample;
            Some(
                regression
                    .fit(channel, self.terms(channel), phase)?
                    .unexplained,
            )
        };
        let now = left(0)?;
        let best = (-LATEST..=LATEST)
            .filter_map(|halves| Some((halves, left(halves)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.0 != 0 && best.1 < HALVED * now).then(|| f64::from(best.0) * 0.5 * self.sample)
    }

    /// Takes out the delays of channels, of all at a place, or of all load cells.
    pub(super) fn without_delays(mut self) -> Self {
        for _ in 0..MOST {
            let Some((channels, phase)) = self.latest() else {
                break;
            };
            self.lines = earlier(&self.lines, &channels, phase);
            self.delays.push((channels, phase / self.sample));
        }
        self
    }

    /// The delay that explains most.
    fn latest(&self) -> Option<(Vec<usize>, f64)> {
        let before = self.unexplained(&self.lines)?;
        let mut groups: Vec<Vec<usize>> = self.live().map(|i| vec![i]).collect();
        groups.extend(places(&self.sensors, &|i| !self.dead.contains(&i)));
        groups.push(
            self.live()
                .filter(|&i| self.sensors[i].kind.is_cell())
                .collect(),
        );
        groups.retain(|group| !group.is_empty());
        let mut best: Option<(f64, Vec<usize>, f64)> = None;
        let late: Vec<Option<f64>> = (0..self.sensors.len())
            .map(|i| self.lateness(&self.lines, i))
            .collect();
        for group in groups {
            let mut phases: Vec<f64> = group.iter().filter_map(|&i| late[i]).collect();
            if phases.len() * 2 <= group.len() {
                continue;
            }
            phases.sort_by(f64::total_cmp);
            let phase = phases[phases.len() / 2];
            let Some(after) = self.unexplained(&earlier(&self.lines, &group, phase)) else {
                continue;
            };
            let gain = before - after;
            if gain > GAIN && best.as_ref().is_none_or(|(most, ..)| gain > *most) {
                best = Some((gain, group, phase));
            }
        }
        best.map(|(_, group, phase)| (group, phase))
    }
}
