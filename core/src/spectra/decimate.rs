//! Decimation by two, stage by stage, before the transform.
//!
//! The lines of interest lie far below half the sample rate. A quarter of the samples, and
//! of the memory, carries them as well as all of them do, if what would fold onto them is
//! filtered out first. All channels, the drive among them, pass the same linear-phase
//! filters, so responses and coherences do not notice, and the pass band is flat to 5e-6.
//!
//! The filters are half-band ones: every other coefficient is zero, the middle one is a
//! half. They are equiripple (Parks and McClellan), designed for a pass band up to
//! 25/64 of the output rate in the last stage and up to 25/128 in those before it: of 1024
//! samples a hundred lines.
//!
//! | stage | taps | pass band, of its input rate | stop band |
//! | --- | --- | --- | --- |
//! | last | 59 | 0.1953125, ripple 5e-6 | 0.3046875 and up, -107 dB |
//! | before | 19 | 0.09765625, ripple 3e-6 | 0.40234375 and up, -111 dB |
//!
//! What folds onto a line is uncorrelated with it, so it biases averaged spectra by its
//! power, 1e-10, and makes them scatter by its amplitude, 5e-6.

/// Share of the decimated block up to which lines may be kept: the pass band's edge.
pub(super) const USABLE: f64 = 25.0 / 64.0;
/// Most stages: a factor of sixteen.
pub(super) const MAX_STAGES: usize = 4;

const LAST_TAPS: usize = 59;
const EARLY_TAPS: usize = 19;

/// Coefficients at the distances 1, 3, 5, … from the middle, on either side.
const LAST: [f32; 15] = [
    3.166_449_4e-1,
    -1.012_022e-1,
    5.579_532_3e-2,
    -3.505_815_6e-2,
    2.292_485_5e-2,
    -1.503_574_8e-2,
    9.692_057e-3,
    -6.053_719e-3,
    3.619_395e-3,
    -2.045_211_4e-3,
    1.075_515_9e-3,
    -5.151_528e-4,
    2.171_971e-4,
    -7.557_232e-5,
    1.868_490_1e-5,
];
const EARLY: [f32; 5] = [
    3.058_903e-1,
    -7.373_881e-2,
    2.236_649_4e-2,
    -5.150_574_3e-3,
    6.338_563e-4,
];

/// Elements of state that one channel needs: each stage's delay line is written twice, so
/// that its newest samples always lie in one piece.
pub(super) const fn state_len(stages: usize) -> usize {
    if stages == 0 {
        0
    } else {
        2 * (LAST_TAPS + (stages - 1) * EARLY_TAPS)
    }
}

/// Input samples until the first output that does not see the start from rest.
pub(super) const fn settling(stages: usize) -> usize {
    if stages == 0 {
        return 0;
    }
    let mut inputs = (LAST_TAPS - 1) << (stages - 1);
    let mut stage = 0;
    while stage + 1 < stages {
        inputs += (EARLY_TAPS - 1) << stage;
        stage += 1;
    }
    inputs
}

/// Where all channels of a decimator stand: they march in step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Phase {
    stages: usize,
    /// Write position of each stage's delay line.
    position: [usize; MAX_STAGES],
    /// Whether the next sample completes a stage's pair.
    second: [bool; MAX_STAGES],
}

const fn taps(stage: usize, stages: usize) -> usize {
    if stage + 1 == stages {
        LAST_TAPS
    } else {
        EARLY_TAPS
    }
}

impl Phase {
    pub(super) const fn new(stages: usize) -> Self {
        Self {
            stages,
            position: [0; MAX_STAGES],
            second: [false; MAX_STAGES],
        }
    }

    /// Whether the sample that is being pushed yields an output.
    pub(super) fn yields(&self) -> bool {
        self.second.iter().take(self.stages).all(|s| *s)
    }

    /// Pushes one channel's sample through its `state` of [`state_len`]. The result means
    /// something only where [`Self::yields`].
    pub(super) fn push(&self, state: &mut [f32], sample: f32) -> f32 {
        let mut x = sample;
        let mut rest = state;
        for stage in 0..self.stages {
            let taps = taps(stage, self.stages);
            let Some((line, after)) = rest.split_at_mut_checked(2 * taps) else {
                return x;
            };
            let at = self.position[stage];
            line[at] = x;
            line[at + taps] = x;
            if !self.second[stage] {
                return x;
            }
            let newest = &line[at + 1..at + 1 + taps];
            x = if taps == LAST_TAPS {
                filter::<LAST_TAPS, 15>(newest, &LAST)
            } else {
                filter::<EARLY_TAPS, 5>(newest, &EARLY)
            };
            rest = after;
        }
        x
    }

    /// Goes on to the next sample, after all channels were pushed.
    pub(super) fn advance(&mut self) {
        for stage in 0..self.stages {
            let taps = taps(stage, self.stages);
            self.position[stage] = if self.position[stage] + 1 == taps {
                0
            } else {
                self.position[stage] + 1
            };
            let completed = self.second[stage];
            self.second[stage] = !completed;
            if !completed {
                break;
            }
        }
    }
}

/// The half-band sum over a delay line, oldest sample first.
#[inline]
fn filter<const TAPS: usize, const HALF: usize>(line: &[f32], h: &[f32; HALF]) -> f32 {
    let Ok(line) = <&[f32; TAPS]>::try_from(line) else {
        return 0.0;
    };
    let middle = (TAPS - 1) / 2;
    let mut sum = 0.5 * line[middle];
    for i in 0..HALF {
        sum += h[i] * (line[middle - 1 - 2 * i] + line[middle + 1 + 2 * i]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Magnitude of a half-band filter at `f` in units of its input rate.
    fn magnitude(h: &[f32], f: f64) -> f64 {
        let cosines = h.iter().enumerate().map(|(i, &h)| {
            let distance = (2 * i + 1) as f64;
            2.0 * f64::from(h) * libm::cos(2.0 * core::f64::consts::PI * f * distance)
        });
        0.5 + cosines.sum::<f64>()
    }

    #[test]
    fn the_filters_are_what_the_table_says() {
        for (h, edge, ripple, stop) in [
            (&LAST[..], 0.195_312_5, 5e-6, -107.0),
            (&EARLY[..], 0.097_656_25, 3e-6, -111.0),
        ] {
            for k in 0..=1000 {
                let pass = edge * f64::from(k) / 1000.0;
                assert!((magnitude(h, pass) - 1.0).abs() < ripple, "{pass}");
                let beyond = 0.5 - pass;
                let db = 20.0 * libm::log10(magnitude(h, beyond).abs());
                assert!(db < stop, "{beyond}: {db} dB");
            }
        }
    }

    #[test]
    fn a_constant_comes_out_every_fourth_time() {
        let mut phase = Phase::new(2);
        let mut state = [0.0; state_len(2)];
        let mut outputs = 0;
        for n in 0..400 {
            let yields = phase.yields();
            let y = phase.push(&mut state, 1.0);
            phase.advance();
            if yields {
                assert_eq!(n % 4, 3);
                outputs += 1;
                if n >= settling(2) {
                    // Two ripples of 5e-6 and 3e-6.
                    assert!((y - 1.0).abs() < 8e-6, "{n}: {y}");
                }
            }
        }
        assert_eq!(outputs, 100);
    }

    #[test]
    fn settling_is_when_the_start_is_forgotten() {
        let run = |lead: f32| {
            let mut phase = Phase::new(3);
            let mut state = [0.0; state_len(3)];
            let mut out = [0.0; 400];
            for (n, out) in out.iter_mut().enumerate() {
                let x = if n == 0 { lead } else { libm::sinf(n as f32) };
                *out = phase.push(&mut state, x);
                if !phase.yields() {
                    *out = 0.0;
                }
                phase.advance();
            }
            out
        };
        let (a, b) = (run(0.0), run(1000.0));
        let differ = |n: usize| a[n] != b[n];
        assert!((0..settling(3)).any(differ));
        assert!(!(settling(3) + 1..400).any(differ));
    }
}
