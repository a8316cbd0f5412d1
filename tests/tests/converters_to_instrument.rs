//! From volts to the ten numbers through all parts of the box: modelled converters, their driver,
//! acquisition, calibrations, and the instrument itself.

mod stand_in;

use massline::rig::{self, Outfit, Trouble, Troubles};
use massline::simulate::Simulation;
use massline_core::masslines::Method;
use massline_firmware::models::setup;
use massline_firmware::sampling::lowpass;
use massline_firmware::wire::{
    Accelerations, Answer, Gaps, Health, Outcome, Pass, Procedure, Request, Source, Start, Summary,
};
use massline_tests::readme;
use stand_in::bench::Heard;
use stand_in::{StandIn, fork};

/// Length of a run, s.
const SECONDS: f64 = 60.0;

/// Measures all runs with the box; returns their summaries, and the answer.
fn measure(simulation: &Simulation, troubles: &Troubles) -> (Vec<Summary>, Answer) {
    let outfit = Outfit::new(&simulation.setup, &simulation.recordings).unwrap();
    let inputs = outfit.certificates(&simulation.recordings[0]);
    let mut stand_in = StandIn::new(&inputs);
    stand_in.set_up(&simulation.setup, Accelerations::Interface);
    let mut summaries = Vec::new();
    for (k, recording) in simulation.recordings.iter().enumerate() {
        let length = recording.samples[0].len() as u64;
        stand_in.done(&Request::Start(Start {
            run: k as u8,
            pass: Pass::Measure,
            source: Source::Inputs,
            gaps: Gaps::Count,
            limit: Some(length),
        }));
        let seed = troubles.seed + k as u64;
        let mut ended = Vec::new();
        rig::samples(recording, &outfit, troubles, seed, &mut |sample| {
            if sample.number >= rig::LEAD {
                let bench = &mut stand_in.bench;
                bench.convert(sample.number, sample.counts, sample.health);
                ended.extend(bench.events().into_iter().filter_map(|event| match event {
                    Heard::RunEnded(summary) => Some(summary),
                    _ => None,
                }));
            }
            ended.is_empty()
        })
        .unwrap();
        let [summary] = ended[..] else {
            panic!("a run ends once");
        };
        assert_eq!((summary.run, summary.outcome), (k as u8, Outcome::Limit));
        assert_eq!(summary.samples + summary.missing, length);
        summaries.push(summary);
    }
    let found =
        stand_in
            .bench
            .identify(setup::question(Method::ApparentMass, Procedure::Direct, 2));
    (summaries, found.answer)
}

/// The mass and its standard deviation, kg.
fn mass(answer: &Answer) -> (f64, f64) {
    let mass = answer
        .identification
        .mass
        .expect("the fork's mass is observable");
    (mass.value, mass.std)
}

#[test]
fn without_faults_no_block_is_lost_and_the_mass_is_right() {
    let simulation = fork(SECONDS);
    let (summaries, answer) = measure(&simulation, &Troubles::default());
    for summary in &summaries {
        assert_eq!(summary.health, Health::GOOD);
        assert_eq!((summary.rejected, summary.missing), (0, 0));
        assert!(summary.blocks > 50);
    }
    let (mass, std) = mass(&answer);
    let off = mass - simulation.truth.mass;
    assert!(off.abs() < 3.0 * std, "{off} ± {std}");
}

#[test]
fn each_fault_reaches_the_summary_by_its_name_and_not_the_mass() {
    let simulation = fork(SECONDS);
    let (_, whole) = measure(&simulation, &Troubles::default());
    let (before, least) = mass(&whole);
    for kind in Trouble::ALL {
        let troubles = Troubles {
            kinds: vec![kind],
            per_minute: 5.0,
            seed: 3,
        };
        let (summaries, answer) = measure(&simulation, &troubles);
        let flag = kind.flag();
        let by: u32 = summaries
            .iter()
            .map(|s| s.rejected_by[flag.0.trailing_zeros() as usize])
            .sum();
        assert!(by > 0, "{}: {summaries:#?}", kind.name());
        assert!(answer.quality.health.contains(flag));
        assert!(answer.quality.rejected >= by);
        let (mass, std) = mass(&answer);
        let off = (mass - before).abs();
        assert!(off < 2.0 * std, "{}: {off} ± {std}", kind.name());
        assert!(std < 3.0 * least, "{}: {std} {least}", kind.name());
    }
}

#[test]
fn the_table_of_filters_is_that_of_the_readme() {
    let mut table = String::from(
        "| samples/s | ADXL355 later by, ms | samples | at 0.05 of the rate | at 0.1 of the rate |\n\
         | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for rate in [256.0, 512.0, 1024.0, 2048.0, 4096.0] {
        let [prompt, late] = [0, 32].map(|input| lowpass(input, rate).expect("a box's input"));
        let seconds = late.delay - prompt.delay;
        let differences = [0.05, 0.1].map(|share| {
            let frequency = share * rate;
            let magnitude = late.magnitude(frequency) / prompt.magnitude(frequency) - 1.0;
            let lag = late.lag(frequency) - prompt.lag(frequency);
            format!("{:.1} %, {:.1}°", 100.0 * magnitude, -lag.to_degrees())
        });
        let (ms, samples) = (1e3 * seconds, seconds * rate);
        let [low, high] = differences;
        table += &format!("| {rate} | {ms:.2} | {samples:.2} | {low} | {high} |\n");
    }
    readme::compare("filters", &table).unwrap_or_else(|error| panic!("{error}"));
}
