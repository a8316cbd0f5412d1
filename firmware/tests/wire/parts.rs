//! Parts of messages, drawn at random.

use crate::draw::{Draw, READINGS, SENSORS};
use massline_core::identify::{self, Estimate, Identification};
use massline_core::modes::Pole;
use massline_core::rigid_body::{Margin, Plausibility, PrincipalInertia};
use massline_firmware::wire::*;
use nalgebra::{Matrix3, Vector3};

pub fn pass(d: &mut Draw<'_>) -> Pass {
    d.pick(&[Pass::Survey, Pass::Measure])
}

pub fn source(d: &mut Draw<'_>) -> Source {
    d.pick(&[Source::Host, Source::Inputs, Source::Synthetic])
}

pub fn state(d: &mut Draw<'_>) -> State {
    d.pick(&[State::Empty, State::SettingUp, State::Ready, State::Running])
}

pub fn storage(d: &mut Draw<'_>) -> Storage {
    d.pick(&[Storage::Flash, Storage::Volatile])
}

pub fn accelerations(d: &mut Draw<'_>) -> Accelerations {
    d.pick(&[
        Accelerations::Interface,
        Accelerations::All,
        Accelerations::Weighted,
    ])
}

pub fn reset(d: &mut Draw<'_>) -> ResetReason {
    d.pick(&[
        ResetReason::PowerOn,
        ResetReason::BrownOut,
        ResetReason::Pin,
        ResetReason::Watchdog,
        ResetReason::Panic,
        ResetReason::HardFault,
        ResetReason::StackOverflow,
        ResetReason::Request,
        ResetReason::Other,
    ])
}

pub fn processing(d: &mut Draw<'_>) -> Processing {
    Processing {
        sample_rate: d.f64(),
        block_length: d.u32(),
        overlap: d.f64(),
        window: d.pick(&[
            Window::Rectangular,
            Window::Hann,
            Window::Hamming,
            Window::Blackman,
            Window::BlackmanHarris,
            Window::FlatTop,
        ]),
        kept_band: d.array(Draw::f64),
        averaging_band: d.array(Draw::f64),
        mode_band: d.option(|d| d.array(Draw::f64)),
        accelerations: accelerations(d),
        weighting: d.pick(&[Weighting::Given, Weighting::EachRun, Weighting::Joined]),
        minimum_weight: d.f64(),
    }
}

pub fn weights<'a>(d: &mut Draw<'a>) -> Weights<'a> {
    Weights {
        run: d.u8(),
        weights: d.doubles(SENSORS),
    }
}

pub fn sensor<'a>(d: &mut Draw<'a>) -> Sensor<'a> {
    Sensor {
        sensor: d.u8(),
        name: d.text(NAME_MAX),
        kind: d.pick(&[
            SensorKind::Accelerometer(Mount::Interface),
            SensorKind::Accelerometer(Mount::Structure),
            SensorKind::LoadCell(Quantity::Force),
            SensorKind::LoadCell(Quantity::Moment),
        ]),
        position: d.array(Draw::f64),
        direction: d.array(Draw::f64),
        scale: if d.bool() {
            ScaleSource::Given {
                per_unit: d.f64(),
                offset: d.f64(),
            }
        } else {
            ScaleSource::Stored
        },
    }
}

pub fn samples<'a>(d: &mut Draw<'a>) -> Samples<'a> {
    samples_of(d, READINGS)
}

/// Of at most so many values.
pub fn samples_of<'a>(d: &mut Draw<'a>, most: usize) -> Samples<'a> {
    Samples {
        first: d.u64(),
        channels: d.u8(),
        values: match d.pick(&[2, 1, 0]) {
            0 => Values::Readings(d.singles(most)),
            1 => Values::Counts(d.counts(most)),
            _ => Values::Counts24(d.counts24(most)),
        },
    }
}

pub fn question(d: &mut Draw<'_>) -> Question {
    Question {
        method: d.pick(&Method::ALL),
        identify: identify::Question::new(
            d.option(Draw::f64),
            if d.bool() {
                Procedure::Iterative {
                    tolerance: d.f64(),
                    limit: d.u32(),
                }
            } else {
                Procedure::Direct
            },
        ),
        modes: d.u8(),
        fit_band: d.option(|d| d.array(Draw::f64)),
        runs: d.u32(),
    }
}

pub fn answer(d: &mut Draw<'_>) -> Answer {
    let estimate = |d: &mut Draw<'_>| {
        d.option(|d| Estimate {
            value: d.f64(),
            std: d.f64(),
        })
    };
    let margin = |d: &mut Draw<'_>| {
        d.option(|d| Margin {
            relative: d.f64(),
            uncertainty: d.f64(),
        })
    };
    Answer {
        question: question(d),
        accelerations: accelerations(d),
        quality: Quality {
            blocks: d.u32(),
            rejected: d.u32(),
            rejected_by: d.array(Draw::u32),
            missing: d.u64(),
            health: Health(d.u16()),
        },
        identification: Identification {
            reference: vector(d),
            mass: estimate(d),
            indicator: estimate(d),
            centre_of_gravity: d.array(estimate),
            inertia_reference: d.array(estimate),
            inertia_cg: d.array(estimate),
            principal: d.option(|d| PrincipalInertia {
                moments: vector(d),
                axes: Matrix3::from_columns(&d.array::<Vector3<f64>, 3>(vector)),
            }),
            observable: d.array(Draw::bool),
            condition_number: d.f64(),
            iterations: d.u32(),
            consistency: d.option(Draw::f64),
            misfit: d.f64(),
            attenuation: d.f64(),
            freedom: d.f64(),
            plausibility: Plausibility {
                mass: margin(d),
                positive_definite: margin(d),
                triangle: margin(d),
            },
        },
        findings: Findings {
            excited: d.option(Draw::u8),
            weakest_excitation: d.option(Draw::f64),
            poles: d.array(|d| {
                d.option(|d| Pole {
                    frequency: d.f64(),
                    damping: d.f64(),
                })
            }),
        },
    }
}

fn vector(d: &mut Draw<'_>) -> Vector3<f64> {
    d.array::<f64, 3>(Draw::f64).into()
}

pub fn summary(d: &mut Draw<'_>) -> Summary {
    Summary {
        run: d.u8(),
        pass: pass(d),
        source: source(d),
        outcome: d.pick(&[Outcome::Stopped, Outcome::Limit, Outcome::Fault]),
        samples: d.u64(),
        missing: d.u64(),
        blocks: d.u32(),
        rejected: d.u32(),
        rejected_by: d.array(Draw::u32),
        health: Health(d.u16()),
        overloads: d.u64(),
        sample_rate: d.option(Draw::f64),
        noise: d.option(|d| d.array(Draw::f32)),
    }
}

pub fn info<'a>(d: &mut Draw<'a>) -> Info<'a> {
    Info {
        firmware: d.text(NAME_MAX),
        version: d.text(NAME_MAX),
        build: d.text(NAME_MAX),
        chip: d.text(NAME_MAX),
        serial: d.array(Draw::u8),
        clock: d.pick(&[
            ClockSource::CrystalPll,
            ClockSource::InternalPll,
            ClockSource::Internal,
        ]),
        clock_hz: d.u32(),
        tick_hz: d.u32(),
        storage: storage(d),
        reset: reset(d),
        resets: d.u32(),
        panic: d.option(|d| d.text(PANIC_MAX)),
        faults: faults(d),
        capacity: Capacity {
            channels: d.u8(),
            inputs: d.u8(),
            sensors: d.u8(),
            runs: d.u8(),
            lines: d.u16(),
            block_length: d.u32(),
            window: d.u8(),
            methods: MethodSet(d.u16()),
        },
    }
}

pub fn faults(d: &mut Draw<'_>) -> FaultCounters {
    FaultCounters {
        watchdog: d.u32(),
        brown_out: d.u32(),
        panic: d.u32(),
        hard_fault: d.u32(),
        stack_overflow: d.u32(),
        converter_checksum: d.u32(),
        converter_missed: d.u32(),
        converter_reset: d.u32(),
        out_of_step: d.u32(),
        overrun: d.u32(),
        storage: d.u32(),
    }
}

pub fn link(d: &mut Draw<'_>) -> LinkCounters {
    LinkCounters {
        frames: d.u32(),
        lost: d.u64(),
        bad_crc: d.u32(),
        bad_cobs: d.u32(),
        oversize: d.u32(),
        truncated: d.u32(),
        duplicates: d.u32(),
        out_of_order: d.u32(),
        unknown_version: d.u32(),
        unknown_number: d.u32(),
        malformed: d.u32(),
        restarts: d.u32(),
    }
}

pub fn key(d: &mut Draw<'_>) -> SettingKey {
    let input = SettingKey::Input(d.u8());
    d.pick(&[
        SettingKey::Name,
        SettingKey::LinkBaud,
        SettingKey::SampleRate,
        input,
    ])
}

pub fn setting<'a>(d: &mut Draw<'a>) -> Setting<'a> {
    match d.pick(&[0, 1, 2, 3]) {
        0 => Setting::Name(d.text(NAME_MAX)),
        1 => Setting::LinkBaud(d.u32()),
        2 => Setting::SampleRate(d.f64()),
        _ => Setting::Input(Input {
            input: d.u8(),
            circuit: d.pick(&[
                Circuit::Unused,
                Circuit::Voltage,
                Circuit::Bridge,
                Circuit::Charge,
                Circuit::Iepe,
                Circuit::Digital,
            ]),
            serial: d.text(NAME_MAX),
            certificate: d.text(NAME_MAX),
            calibrated: d.option(|d| Date {
                year: d.u16(),
                month: d.u8(),
                day: d.u8(),
            }),
            per_count: d.f64(),
            offset: d.f64(),
            uncertainty: d.f64(),
            gain: d.u8(),
            limits: d.array(|d| d.u32() as i32),
        }),
    }
}
