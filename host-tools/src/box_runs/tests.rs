//! Tests on the box in this program, run by run.

use super::*;
use crate::device::failing::Failing;
use crate::device::{Client, ClientMemory, HostBox, HostBoxMemory};
use crate::on_box::plan::Feed;
use crate::rig::{Inputs, Troubles};
use crate::simulate::{Model, Options, simulate};
use massline_firmware::wire::{FaultKind, Outcome};

/// The fork's setup, and its inputs with the names of their channels.
fn fork() -> (Setup, Inputs, Vec<InputEntry>) {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        duration: Some(3.0),
        ..Options::default()
    };
    let simulation = simulate(&Model::fork().unwrap(), &options, &mut |_| ()).unwrap();
    let setup = Setup::read(&simulation.write(folder.path()).unwrap()).unwrap();
    let inputs = Inputs::fork(Troubles::default()).unwrap();
    let wired = inputs.certificates().into_iter().zip(inputs.channels());
    let wired = wired
        .enumerate()
        .map(|(k, (certificate, name))| InputEntry {
            input: k as u8,
            channel: Some(name.clone()),
            certificate,
        });
    let wired = wired.collect();
    (setup, inputs, wired)
}

/// Ends each run after so many looks, if that is given.
#[derive(Default)]
struct Hand {
    looks: Option<u32>,
    seen: u32,
    shaken: Vec<String>,
    faults: usize,
    ended: Vec<Ended>,
}

impl Operator for Hand {
    fn shake(&mut self, stage: &Stage<'_>) -> Result<(), BoxRunError> {
        self.seen = 0;
        self.shaken.push(stage.name.to_owned());
        Ok(())
    }

    fn watch(&mut self, _: &Stage<'_>, progress: &Progress) -> bool {
        self.seen += 1;
        self.faults += progress.faults.len();
        self.looks.is_none_or(|looks| self.seen < looks)
    }

    fn ended(&mut self, _: &Stage<'_>, ended: &Ended) {
        self.ended.push(*ended);
    }
}

fn only(run: usize, seconds: Option<f64>) -> Measuring {
    Measuring {
        runs: vec![run],
        seconds,
    }
}

/// The box forms resultants of what its inputs read, one behind a coupling and one not.
#[test]
fn couplings_that_differ_are_refused() {
    let (mut setup, inputs, wired) = fork();
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let mut test = |setup: &Setup| {
        let method = Method::ApparentMass;
        BoxTest::new(&mut client, setup, &wired, method, false).map(|_| ())
    };
    for cell in &mut setup.load_cells {
        cell.ac_corner = 0.1;
    }
    let refused = test(&setup).unwrap_err().to_string();
    let [first, cell] = [
        &setup.accelerometers[0].channel,
        &setup.load_cells[0].channel,
    ];
    let expected = format!("`ac_corner` of channel `{first}` and of channel `{cell}` differ");
    assert!(refused.starts_with(&expected), "{refused}");
    for sensor in &mut setup.accelerometers {
        sensor.ac_corner = 0.1;
    }
    test(&setup).unwrap();
}

#[test]
fn runs_stay_on_the_box_until_the_setup_is_another() {
    let (setup, inputs, wired) = fork();
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let method = Method::ApparentMass;
    let plan = |client: &mut Client<'_, _>, setup| {
        BoxTest::new(client, setup, &wired, method, true).unwrap()
    };
    let test = plan(&mut client, &setup);
    let nothing = test.identify(&mut client, false);
    assert!(matches!(nothing, Err(BoxRunError::NothingStored { .. })));
    let mut hand = Hand::default();
    for run in [1, 0] {
        assert_eq!(test.load(&mut client).unwrap(), 0);
        test.measure(&mut client, &only(run, Some(10.0)), &mut hand)
            .unwrap();
    }
    assert_eq!(hand.shaken, ["lateral Z", "lateral X"]);
    assert_eq!(hand.ended[1].summary.samples, 5120);
    // Where the file lies and what is asked later is no other setup.
    let mut moved = setup.clone();
    moved.folder = "elsewhere".into();
    moved.known_mass = Some(12.0);
    moved.known_mass_uncertainty = Some(0.1);
    moved.estimation.tolerance *= 2.0;
    moved.accelerometers[0].uncertainty.calibration = Some(0.01);
    moved.runs[0].checksum = None;
    let found = plan(&mut client, &moved)
        .identify(&mut client, false)
        .unwrap();
    let names: Vec<&str> = found.runs.iter().map(|run| &*run.name).collect();
    assert_eq!(names, ["lateral X", "lateral Z"]);
    assert_eq!(found.unmeasured, ["rotation Y"]);
    assert_eq!(found.answer.question.runs, 0b11);
    // A sensor elsewhere is.
    let mut other = setup.clone();
    other.accelerometers[0].position[0] += 0.001;
    assert_eq!(plan(&mut client, &other).load(&mut client).unwrap(), 2);
    // So is a method that needs other runs, which is said.
    let test = BoxTest::new(&mut client, &other, &wired, method, true).unwrap();
    test.measure(&mut client, &only(0, Some(10.0)), &mut hand)
        .unwrap();
    let test = BoxTest::new(&mut client, &other, &wired, Method::FreeResponses, false).unwrap();
    let base = test.identify(&mut client, false);
    assert!(matches!(base, Err(BoxRunError::OtherBase { .. })));
}

#[test]
fn the_operator_ends_a_run_and_one_that_goes_on_is_taken_up() {
    let (setup, inputs, wired) = fork();
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let test = BoxTest::new(&mut client, &setup, &wired, Method::ApparentMass, true).unwrap();
    test.load(&mut client).unwrap();
    let mut hand = Hand {
        looks: Some(2),
        ..Hand::default()
    };
    test.measure(&mut client, &only(2, None), &mut hand)
        .unwrap();
    let summary = hand.ended[0].summary;
    assert_eq!((summary.run, summary.outcome), (2, Outcome::Stopped));
    assert!(summary.samples > 0);
    // As a program that was killed leaves it.
    client
        .tell(&massline_firmware::wire::Request::Start(
            massline_firmware::wire::Start {
                run: 2,
                pass: Pass::Measure,
                source: massline_firmware::wire::Source::Inputs,
                gaps: massline_firmware::wire::Gaps::Count,
                limit: Some(20_000),
            },
        ))
        .unwrap();
    let mut late = Hand::default();
    assert_eq!(test.load(&mut client).unwrap(), 0);
    test.measure(&mut client, &only(2, Some(1.0)), &mut late)
        .unwrap();
    assert!(late.shaken.is_empty());
    assert_eq!(late.ended[0].summary.samples, 20_000);
}

#[test]
fn a_converter_that_falls_silent_ends_the_run_and_what_came_before_is_kept() {
    let (setup, inputs, wired) = fork();
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let failing = Failing {
        faults: vec![(100, FaultKind::Converter, Some(1))],
        ..Failing::new(HostBox::with_inputs(&mut own, 1, inputs))
    };
    let mut client = Client::new(failing, &mut memory);
    let test = BoxTest::new(&mut client, &setup, &wired, Method::ApparentMass, true).unwrap();
    test.load(&mut client).unwrap();
    let mut hand = Hand::default();
    test.measure(&mut client, &only(0, Some(1e6)), &mut hand)
        .unwrap();
    assert_eq!(hand.faults, 1);
    assert!(hand.ended[0].failed() && hand.ended[0].summary.blocks > 2);
    assert_eq!(test.identify(&mut client, false).unwrap().runs.len(), 1);
}

#[test]
fn channels_are_found_by_name_then_by_serial_number() {
    let (setup, _, mut wired) = fork();
    let wiring = Wiring::new(&setup, &wired).unwrap();
    let given = |per_unit| massline_firmware::wire::ScaleSource::Given {
        per_unit,
        offset: 0.0,
    };
    // The fork's drive is at the first input, its sensors in the setup's order behind it.
    let expected: Vec<u8> = std::iter::once(254).chain(0..18).collect();
    assert_eq!(wiring.channels(&setup, 0), expected);
    assert_eq!(
        wiring.scale(3, given(1.0)),
        massline_firmware::wire::ScaleSource::Stored
    );
    let input = wired[4].setting();
    let expected = massline_firmware::wire::ScaleSource::Given {
        per_unit: -2.0 * input.per_count,
        offset: input.offset,
    };
    assert_eq!(wiring.scale(3, given(-2.0)), expected);
    wired.iter_mut().for_each(|entry| entry.channel = None);
    let error = Wiring::new(&setup, &wired).unwrap_err().to_string();
    assert!(
        error.contains("channel `a1`") && error.contains("1 (SIM-driv)"),
        "{error}"
    );
    let mut renamed = setup.clone();
    // Eight characters, as the simulation numbers its sensors.
    let serial = |name: &mut String| *name = format!("SIM-{name}").chars().take(8).collect();
    renamed
        .accelerometers
        .iter_mut()
        .for_each(|a| serial(&mut a.channel));
    renamed
        .load_cells
        .iter_mut()
        .for_each(|c| serial(&mut c.channel));
    renamed
        .runs
        .iter_mut()
        .for_each(|r| serial(&mut r.references[0]));
    assert_eq!(
        Wiring::new(&renamed, &wired)
            .unwrap()
            .channels(&renamed, 2)
            .len(),
        19
    );
    renamed.runs[1].references = vec!["SIM-a2".to_owned()];
    let error = Wiring::new(&renamed, &wired).unwrap_err().to_string();
    assert!(
        error.contains("input 3 would be channel `SIM-a2`"),
        "{error}"
    );
}
