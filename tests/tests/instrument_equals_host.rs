//! The box's results equal the workstation's to the last bit.

mod stand_in;

use std::path::PathBuf;

use massline::identification::{self, Choice, Session};
use massline::measure::Spectra;
use massline::setup::{Mount, Setup};
use massline_core::geometry::ResultantNoise;
use massline_core::identify::{self, Procedure};
use massline_core::masslines::Method;
use massline_firmware::wire::{
    self, Accelerations, FRAME_MAX, Findings, Identified, Line, Pass, Question, Reply, Sender,
    Weighting,
};
use stand_in::StandIn;

fn fork() -> Setup {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/fork/setup.toml");
    Setup::read(&path).unwrap_or_else(|e| panic!("{e}"))
}

/// The fork's recordings cut to a fifth, so that debug builds do not take minutes.
fn short_fork(folder: &tempfile::TempDir) -> Setup {
    use std::io::{BufRead, BufReader, Write};
    let mut setup = fork();
    for run in &mut setup.runs {
        let path = setup.folder.join(&run.recording);
        let text = BufReader::new(flate2::read::GzDecoder::new(
            std::fs::File::open(path).unwrap(),
        ));
        let short = folder.path().join(format!("{}.csv", run.name));
        let mut out = std::fs::File::create(&short).unwrap();
        for line in text.lines().take(1 + 5200) {
            writeln!(out, "{}", line.unwrap()).unwrap();
        }
        run.recording = short;
    }
    setup
}

fn question(setup: &Setup, method: Method, iterative: bool) -> Question {
    Question {
        method,
        identify: identify::Question::new(
            setup.known_mass,
            if iterative {
                Procedure::Iterative {
                    tolerance: setup.estimation.tolerance,
                    limit: setup.estimation.iterations,
                }
            } else {
                Procedure::Direct
            },
        ),
        modes: setup.estimation.modes as u8,
        fit_band: setup.estimation.fit_band,
        runs: 0,
    }
}

/// The message of an answer, whose bytes are equal if and only if all bits of the answer are.
fn message(answer: &wire::Answer) -> Vec<u8> {
    let reply = Reply::Identified(Identified {
        ticks: 0,
        answer: *answer,
    });
    let mut out = [0; FRAME_MAX];
    Sender::new(1).reply(1, &reply, &mut out).unwrap().to_vec()
}

/// The workstation's answer, as the box would send it.
fn expected(found: &identification::Answer, like: &wire::Answer) -> wire::Answer {
    let mut findings = Findings::default();
    for fit in &found.fits {
        findings.add_fit(fit);
    }
    for modes in &found.free_modes {
        findings.add_modes(modes);
    }
    wire::Answer {
        identification: found.identification,
        findings,
        ..*like
    }
}

/// All lines of the workstation's runs.
fn host_lines(found: &identification::Answer) -> Vec<Vec<Line>> {
    let lines = |spectra: &Spectra| match spectra {
        Spectra::Drive {
            responses, drive, ..
        } => responses
            .iter()
            .zip(drive)
            .map(|(h, &drive)| Line {
                drive,
                responses: h.map(|z| [z.re, z.im]),
            })
            .collect(),
        Spectra::Cross { .. } => panic!("the fork has a drive"),
    };
    let runs = &found.measurement.runs;
    runs.iter().map(|r| lines(&r.spectra)).collect()
}

fn bits(lines: &[Line]) -> Vec<u32> {
    let numbers = lines.iter().flat_map(|l| {
        let responses = l.responses.iter().flatten().map(|x| x.to_bits());
        std::iter::once(l.drive.to_bits()).chain(responses)
    });
    numbers.collect()
}

/// One measurement, and all identifications of it.
fn compare(setup: &Setup, weighted: bool, methods: &[(Method, bool)]) {
    let mut stand_in = StandIn::new(&[]);
    let mut session = Session::new(setup);
    let mut measured = false;
    for &(method, iterative) in methods {
        let choice = Choice {
            method: Some(method),
            iterative,
            weighted,
        };
        let found = session.answer(&choice, &mut |_| ()).unwrap();
        if !measured {
            measured = true;
            measure(&mut stand_in, setup, &found, method);
        }
        let box_answer = stand_in
            .bench
            .identify(question(setup, method, iterative))
            .answer;
        let host_answer = expected(&found, &box_answer);
        assert_eq!(
            message(&box_answer),
            message(&host_answer),
            "{method:?} {iterative}: {box_answer:?} {host_answer:?}"
        );
        assert!(box_answer.quality.blocks > 0);
        let noise: Vec<_> = found.measurement.runs.iter().map(|r| r.blocks).collect();
        assert_eq!(box_answer.quality.blocks, noise.iter().sum::<u32>());
    }
}

fn measure(stand_in: &mut StandIn, setup: &Setup, found: &identification::Answer, method: Method) {
    let accelerations = match &found.weights {
        _ if method.interface_only() => Accelerations::Interface,
        Some(_) => Accelerations::Weighted,
        None => Accelerations::All,
    };
    let grid = stand_in.set_up(setup, accelerations);
    assert_eq!(grid.lines.count, found.measurement.grid.unwrap().count);
    if let Some(weights) = &found.weights {
        stand_in.weigh(setup, weights);
    }
    let host = host_lines(found);
    for (run, host) in host.iter().enumerate() {
        let summary = stand_in.run(setup, run, Pass::Measure, |_, _| ());
        let measured = &found.measurement.runs[run];
        assert_eq!(summary.blocks, measured.blocks);
        let noise = ResultantNoise::unpacked(&measured.responses().unwrap().noise);
        let noise = noise.variances().map(|v| (v as f32).to_bits());
        assert_eq!(summary.noise.map(|all| all.map(f32::to_bits)), Some(noise));
        assert_eq!(
            bits(&stand_in.bench.lines(run as u8)),
            bits(host),
            "run {run}"
        );
    }
}

#[test]
fn the_recommended_method_on_the_whole_recordings() {
    let both = [(Method::ApparentMass, false), (Method::ApparentMass, true)];
    compare(&fork(), true, &both);
}

#[test]
fn the_papers_methods_without_weights() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = short_fork(&folder);
    // The last three lie far out on a tine: weighed like those of the interface, they drown the mode that
    // method d needs.
    setup.accelerometers.truncate(12);
    let methods: Vec<_> = Method::ALL[1..]
        .iter()
        .flat_map(|&m| [(m, false), (m, true)])
        .filter(|(m, iterative)| !(*iterative && *m == Method::PowerSpectra))
        .collect();
    compare(&setup, false, &methods);
}

#[test]
fn weighted_and_iterative() {
    let folder = tempfile::tempdir().unwrap();
    let setup = short_fork(&folder);
    compare(
        &setup,
        true,
        &[(Method::FreeResponses, false), (Method::Synthesis, true)],
    );
    compare(&setup, true, &[(Method::FrequencyResponses, true)]);
}

#[test]
fn one_bit_of_one_sample_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let setup = short_fork(&folder);
    let mut all = Vec::new();
    for flip in [None, Some(2500)] {
        let mut stand_in = StandIn::new(&[]);
        stand_in.set_up(&setup, Accelerations::Interface);
        for run in 0..3 {
            stand_in.run(&setup, run, Pass::Measure, |n, row| {
                if run == 1 && Some(n) == flip {
                    // A bit in the middle of the second accelerometer's mantissa.
                    row[1] = f32::from_bits(row[1].to_bits() ^ 1 << 12);
                }
            });
        }
        let lines = bits(&stand_in.bench.lines(1));
        let answer = stand_in
            .bench
            .identify(question(&setup, Method::ApparentMass, false))
            .answer;
        all.push((lines, answer));
    }
    assert_ne!(all[0].0, all[1].0);
    assert_ne!(message(&all[0].1), message(&all[1].1));
}

#[test]
fn a_survey_finds_the_workstations_weights() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = short_fork(&folder);
    setup.accelerometers.truncate(12);
    let on_interface = |s: &Setup| {
        s.accelerometers
            .iter()
            .filter(|a| a.mount == Mount::Interface)
            .count()
    };
    assert_eq!(on_interface(&setup), 3);
    let mut session = Session::new(&setup);
    let survey = session.survey(&mut |_| ()).unwrap();
    let processing = setup.processing.as_ref().unwrap();
    let band = processing.mode_band.unwrap();
    let host = survey.weights_per_run(
        &setup,
        survey.lines(band).unwrap(),
        setup.estimation.minimum_weight,
    );
    let mut stand_in = StandIn::new(&[]);
    stand_in.weighting = Weighting::EachRun;
    stand_in.set_up(&setup, Accelerations::Weighted);
    for (run, host) in host.iter().enumerate() {
        let summary = stand_in.run(&setup, run, Pass::Survey, |_, _| ());
        assert_eq!(summary.noise, None);
        let weights = stand_in.weights(run);
        for (own, theirs) in weights.iter().zip(host) {
            // Channels share a transform in pairs, and the box's last sensor has no partner: f32
            // rounding of 4e-7 of the spectrum, in peak and spread.
            assert!((own - theirs).abs() < 2e-6, "run {run}: {own} {theirs}");
        }
    }
}
