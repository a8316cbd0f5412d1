//! Resultants of many samples at a time: those six of accelerometers or of load cells, which several consumers of a
//! recording may share.

use super::geometry::RunGeometry;
use massline_core::geometry::RESULTANTS;

/// Samples that are looked at together, so that no sum waits for another.
const TOGETHER: usize = 4;

/// Numbers of [`Six`].
pub(super) const SIX: usize = 8;
/// Six sums of a sample, and two that stay zero.
pub(super) type Six = [f32; SIX];

/// One half of a geometry: the accelerations, or the forces and moments, of a sample in recorded units.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Half {
    /// Its first channel, and for each from there on SI per recorded unit, and what one SI unit adds.
    first: usize,
    scales: Vec<f32>,
    gains: Vec<Six>,
}

impl Half {
    /// The accelerations of a geometry, and its forces and moments.
    pub(super) fn both(geometry: &RunGeometry) -> [Self; 2] {
        let scales = geometry.scales();
        // The map tells the gains of each channel by what it makes of one unit of it.
        let gains = |channel: usize| {
            let mut unit = vec![0.0; scales.len()];
            if let Some(slot) = unit.get_mut(channel) {
                *slot = 1.0;
            }
            geometry.map.apply(&unit)
        };
        let half = |channels: std::ops::Range<usize>, at: usize| Self {
            first: channels.start,
            scales: scales.get(channels.clone()).unwrap_or_default().to_vec(),
            gains: channels
                .map(|channel| {
                    let gains = gains(channel);
                    core::array::from_fn(|j| {
                        let own = gains.get(at + j).copied();
                        own.filter(|_| j < RESULTANTS / 2).unwrap_or(0.0)
                    })
                })
                .collect(),
        };
        let cells = geometry.accelerometers();
        [half(0..cells, 0), half(cells..scales.len(), RESULTANTS / 2)]
    }

    /// Its sums of some samples: products are added in the order of the channels, as [`RunGeometry::resultants`] adds
    /// them.
    #[inline(always)]
    fn sums(&self, samples: [&[f32]; TOGETHER]) -> [Six; TOGETHER] {
        let mut sums = [[0.0; SIX]; TOGETHER];
        let [a, b, c, d] = samples.map(|sample| sample.get(self.first..).unwrap_or_default());
        let readings = a.iter().zip(b).zip(c.iter().zip(d));
        for ((scale, gains), ((a, b), (c, d))) in self.scales.iter().zip(&self.gains).zip(readings)
        {
            for (sums, reading) in sums.iter_mut().zip([a, b, c, d]) {
                let x = reading * scale;
                for (sum, gain) in sums.iter_mut().zip(gains) {
                    *sum += gain * x;
                }
            }
        }
        sums
    }
}

/// Sums of several halves, sample by sample.
pub(super) struct Halves {
    pub(super) halves: Vec<Half>,
    /// Of each half as many as there are samples.
    sums: Vec<Six>,
    samples: usize,
}

impl Halves {
    pub(super) fn new() -> Self {
        Self {
            halves: Vec::new(),
            sums: Vec::new(),
            samples: 0,
        }
    }

    /// Number of a half, which is added if there is none alike.
    pub(super) fn number(&mut self, half: &Half) -> usize {
        let found = self.halves.iter().position(|other| other == half);
        found.unwrap_or_else(|| {
            self.halves.push(half.clone());
            self.halves.len() - 1
        })
    }

    /// Takes samples of so many channels, one after the other.
    pub(super) fn take(&mut self, samples: &[f32], channels: usize) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return simd.vectorize(Take(self, samples, channels));
        }
        self.take_each(samples, channels);
    }

    #[inline(always)]
    fn take_each(&mut self, samples: &[f32], channels: usize) {
        let channels = channels.max(1);
        self.samples = samples.len() / channels;
        // What is left of earlier samples is written over.
        self.sums
            .resize(self.halves.len() * self.samples, [0.0; SIX]);
        let each = self.sums.chunks_exact_mut(self.samples.max(1));
        for (half, sums) in self.halves.iter().zip(each) {
            let (fours, rest) = sums.as_chunks_mut();
            let mut groups = samples.chunks_exact(TOGETHER * channels);
            for (group, four) in groups.by_ref().zip(fours) {
                let mut each = group.chunks_exact(channels);
                *four = half.sums([(); TOGETHER].map(|()| each.next().unwrap_or_default()));
            }
            let others = groups.remainder().chunks_exact(channels);
            for (sample, slot) in others.zip(rest) {
                [*slot, ..] = half.sums([sample; TOGETHER]);
            }
        }
    }

    /// The sums of one of the halves of a sample, each by its number.
    #[inline]
    pub(super) fn of(&self, half: usize, sample: usize) -> Six {
        let own = self.sums.get(half * self.samples + sample);
        own.copied().unwrap_or_default()
    }
}

/// [`Halves::take`] with these instructions.
#[cfg(target_arch = "x86_64")]
struct Take<'a>(&'a mut Halves, &'a [f32], usize);

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(halves, samples, channels) = self;
        halves.take_each(samples, channels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Accelerations;
    use crate::setup::Setup;
    use std::path::Path;

    /// Two triaxial accelerometers, of which one is on the interface, and two load cells, in other units than SI.
    fn setup() -> Setup {
        let mut text = "title = \"x\"\nreference_point = [0.1, 0.2, 0.3]\n[processing]\nsample_rate = 256.0\nblock_length = 256\noverlap = 0.5\naveraging_band = [1.0, 20.0]\n".to_owned();
        for (number, mount) in ["interface", "interface", "interface", "structure"]
            .iter()
            .enumerate()
        {
            for (axis, direction) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                .iter()
                .enumerate()
            {
                text += &format!(
                    "[[accelerometer]]\nchannel = \"a{number}{axis}\"\nposition = [{number}.3, -0.{number}, 0.{axis}7]\ndirection = {direction:?}\nmount = \"{mount}\"\nscale = 9.8{number}\n"
                );
            }
        }
        for (axis, direction) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .iter()
            .enumerate()
        {
            text += &format!(
                "[[load_cell]]\nchannel = \"f{axis}\"\nposition = [0.3, -0.1, 0.{axis}7]\ndirection = {direction:?}\nscale = 1e-{axis}\n"
            );
        }
        text += "[[run]]\nname = \"X\"\nrecording = \"x.csv\"\nexcitation = \"random\"\n";
        Setup::from_str(&text, Path::new("setup.toml")).unwrap()
    }

    #[test]
    fn sums_have_the_bits_of_resultants_sample_by_sample() {
        let setup = setup();
        let mut halves = Halves::new();
        let selections = [Accelerations::Interface, Accelerations::All(None)];
        let geometries = selections.map(|a| RunGeometry::new(&setup, 0, &a).unwrap());
        let numbers = geometries
            .each_ref()
            .map(|geometry| Half::both(geometry).map(|half| halves.number(&half)));
        // Load cells are the same in both.
        assert_eq!(numbers, [[0, 1], [2, 1]]);
        let (channels, mut state) = (17, 1_u32);
        for count in [0, 1, 3, 4, 5, 63] {
            let samples: Vec<f32> = (0..channels * count)
                .map(|n| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    [1e-9, 1.0, -1e9, 0.0, -0.0][n % 5] * (state >> 8) as f32
                })
                .collect();
            halves.take(&samples, channels);
            for (n, sample) in samples.chunks_exact(channels).enumerate() {
                for (geometry, numbers) in geometries.iter().zip(numbers) {
                    let expected = geometry.resultants(sample).map(f32::to_bits);
                    let found: [u32; RESULTANTS] =
                        core::array::from_fn(|j| halves.of(numbers[j / 6], n)[j % 6].to_bits());
                    assert_eq!(found, expected);
                }
            }
        }
    }
}
