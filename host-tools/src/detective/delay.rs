//! Channels that are late: their phase against the motion of the interface grows with frequency.

use nalgebra::Complex;

use super::evidence::{Evidence, Mounted};
use super::hypothesis::places;
use super::sensor::Kind;
use super::table::{Gauge, Line, Regression};

/// Delays that are tried first, samples on both sides in halves.
const LATEST: i32 = 24;
/// Parts of half a sample to which delays are rounded.
const ROUNDED: f64 = 50.0;
/// Phase at the highest line, rad, that sensors and amplifiers usually differ by: half a degree.
const LEAST: f64 = 0.0087;
/// Unexplained share of a channel at its best delay, over that without one, below which it may be
/// late.
const HALVED: f64 = 0.5;
/// Least decrease of the sum of the logarithms of all unexplained shares for a delay to be taken out.
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
        (0..self.sensors.len()).filter(|i| !self.quiet.contains(i))
    }

    /// Number of motions in each mounting.
    fn counted(&self, all: &[Vec<Line>]) -> Option<Vec<usize>> {
        let of = |(mounted, lines): (&Mounted, &Vec<Line>)| {
            Some(Gauge::of(lines, &self.moving(mounted))?.motions())
        };
        self.mountings.iter().zip(all).map(of).collect()
    }

    /// Sum of the logarithms of the shares that so many motions leave of each channel, mean over the
    /// mountings. A late channel would be a motion of its own, which explains the channel.
    fn unexplained(&self, all: &[Vec<Line>], motions: &[usize]) -> Option<f64> {
        let mut sum = 0.0;
        for ((mounted, lines), &most) in self.mountings.iter().zip(all).zip(motions) {
            let gauge = Gauge::of_at_most(lines, &self.moving(mounted), most)?;
            let regression = Regression::new(lines, &gauge, mounted.equations)?;
            for i in self.live() {
                let fit = regression.fit(i, self.terms(i), 0.0)?;
                sum += fit.unexplained.max(1e-12).ln();
            }
        }
        Some(sum / self.mountings.len() as f64)
    }

    /// The delay of a channel against the others, as a phase at the highest line, where it halves what they do not explain
    /// of it.
    fn lateness(&self, channel: usize) -> Option<f64> {
        let loud = |m: &&Mounted| !m.quiet.contains(&channel);
        let loud: Vec<&Mounted> = self.mountings.iter().filter(loud).collect();
        let gauges: Vec<Gauge> = loud
            .iter()
            .map(|m| Gauge::of(&m.lines, &self.moving_but(m, channel)))
            .collect::<Option<_>>()?;
        let regressions: Vec<Regression<'_>> = loud
            .iter()
            .zip(&gauges)
            .map(|(m, gauge)| Regression::new(&m.lines, gauge, m.equations))
            .collect::<Option<_>>()?;
        let left = |halves: f64| -> Option<f64> {
            let phase = halves * 0.5 * self.sample;
            let shares = regressions.iter();
            let shares = shares
                .map(|r| Some(r.fit(channel, self.terms(channel), phase)?.unexplained))
                .collect::<Option<Vec<f64>>>()?;
            (!shares.is_empty()).then(|| shares.iter().sum())
        };
        let now = left(0.0)?;
        let (best, least) = (-LATEST..=LATEST)
            .map(f64::from)
            .filter_map(|halves| Some((halves, left(halves)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        // What is left goes with the square of what the delay is off.
        let (before, after) = (left(best - 1.0)?, left(best + 1.0)?);
        let curvature = before + after - 2.0 * least;
        let aside = 0.5 * (before - after) / curvature;
        let best = if curvature > 0.0 { best + aside } else { best };
        let best = (best * ROUNDED).round() / ROUNDED;
        let phase = best * 0.5 * self.sample;
        (phase.abs() > LEAST && left(best)? < HALVED * now).then_some(phase)
    }

    /// The lines of all mountings with some channels earlier.
    fn all_earlier(&self, channels: &[usize], phase: f64) -> Vec<Vec<Line>> {
        let all = self.mountings.iter();
        all.map(|m| earlier(&m.lines, channels, phase)).collect()
    }

    /// Takes out the delays of channels, of all at a place, or of all load cells.
    pub(super) fn without_delays(mut self) -> Self {
        for _ in 0..MOST {
            let Some((channels, phase)) = self.latest() else {
                break;
            };
            let all = self.all_earlier(&channels, phase);
            for (mounted, lines) in self.mountings.iter_mut().zip(all) {
                mounted.lines = lines;
            }
            self.delays.push((channels, phase / self.sample));
        }
        self
    }

    /// The delay that explains most.
    fn latest(&self) -> Option<(Vec<usize>, f64)> {
        if self.sample <= 0.0 {
            return None;
        }
        let now = self.all_earlier(&[], 0.0);
        let mut groups: Vec<Vec<usize>> = self.live().map(|i| vec![i]).collect();
        groups.extend(places(&self.sensors, &|i| !self.quiet.contains(&i)));
        groups.push(
            self.live()
                .filter(|&i| self.sensors[i].kind.is_cell())
                .collect(),
        );
        groups.retain(|group| !group.is_empty());
        let mut best: Option<(f64, Vec<usize>, f64)> = None;
        let late: Vec<Option<f64>> = (0..self.sensors.len()).map(|i| self.lateness(i)).collect();
        for group in groups {
            let mut phases: Vec<f64> = group.iter().filter_map(|&i| late[i]).collect();
            if phases.len() * 2 <= group.len() {
                continue;
            }
            phases.sort_by(f64::total_cmp);
            let phase = phases[phases.len() / 2];
            let then = self.all_earlier(&group, phase);
            let gain = || {
                let motions = self.counted(&then)?;
                Some(self.unexplained(&now, &motions)? - self.unexplained(&then, &motions)?)
            };
            let Some(gain) = gain() else {
                continue;
            };
            if gain > GAIN && best.as_ref().is_none_or(|(most, ..)| gain > *most) {
                best = Some((gain, group, phase));
            }
        }
        best.map(|(_, group, phase)| (group, phase))
    }
}
