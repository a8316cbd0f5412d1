//! Recordings: physics, noise, repeatability.

use nalgebra::DMatrix;

use super::*;

fn rms(samples: &[f32]) -> f64 {
    let power: f64 = samples.iter().map(|x| f64::from(*x).powi(2)).sum();
    (power / samples.len() as f64).sqrt()
}

fn column<'a>(recording: &'a Recording, channel: &str) -> &'a [f32] {
    let index = recording
        .channels
        .iter()
        .position(|name| name == channel)
        .unwrap();
    &recording.samples[index]
}

fn quiet() -> Options {
    Options {
        noise: Some(0.0),
        ..Options::default()
    }
}

/// Newton's law sample by sample on a rigid specimen that is mounted askew: six motions
/// from the interface accelerometers, six resultants from the cells, f = Tᵀ M T a.
#[test]
fn a_rigid_body_obeys_newton() {
    let mut model = Model::read(&example("rigid-body.toml")).unwrap();
    for plan in &mut model.runs {
        plan.rotation = [20.0, -70.0, 35.0];
        plan.translation = [0.1, -0.2, 0.3];
    }
    let simulation = run(&model, &quiet());
    let carry = mounting(&[20.0, -70.0, 35.0], &[0.1, -0.2, 0.3]);
    let mass = carry.tr_mul(&(model.specimen.mass_matrix * carry));

    let sensors: Vec<_> = simulation
        .setup
        .accelerometers
        .iter()
        .filter(|entry| entry.mount == Mount::Interface)
        .map(|entry| motion_row(&entry.position.into(), &entry.direction.into()))
        .collect();
    let cells: Vec<_> = simulation
        .setup
        .load_cells
        .iter()
        .map(|entry| motion_row(&entry.position.into(), &entry.direction.into()))
        .collect();
    let rows = DMatrix::from_fn(sensors.len(), 6, |row, axis| sensors[row][axis]);
    let inverse = rows.pseudo_inverse(1e-9).unwrap();
    for recording in &simulation.recordings {
        let (mut error, mut size) = (0.0, 0.0);
        for n in (0..recording.samples[0].len()).step_by(97) {
            let read = |channel: &String| f64::from(column(recording, channel)[n]);
            let measured = simulation
                .setup
                .accelerometers
                .iter()
                .filter(|entry| entry.mount == Mount::Interface)
                .map(|entry| read(&entry.channel));
            let motion = &inverse * nalgebra::DVector::from_iterator(sensors.len(), measured);
            let expected = mass * Vector6::from_fn(|axis, _| motion[axis]);
            let mut resultant = Vector6::zeros();
            for (row, entry) in cells.iter().zip(&simulation.setup.load_cells) {
                resultant += row * read(&entry.channel);
            }
            error += (resultant - expected).norm_squared();
            size += expected.norm_squared();
        }
        // Channels are rounded to f32, 6e-8 each; arms of 0.2 m amplify that into
        // moments and angular accelerations about tenfold.
        assert!((error / size).sqrt() < 1e-6, "{}", (error / size).sqrt());
    }
}

#[test]
fn motion_has_the_rms_asked_for() {
    let mut model = small();
    model.table.cross_talk = 0.0;
    let options = Options {
        duration: Some(60.0),
        ..quiet()
    };
    let simulation = run(&model, &options);
    let level = rms(column(&simulation.recordings[0], "base.z"));
    // 230 Hz over 60 s are 13 800 complex amplitudes: the power scatters by 0.85 %, its
    // root by 0.43 %; five of those.
    assert!((level - 1.0).abs() < 0.022, "{level}");
    assert_eq!(rms(column(&simulation.recordings[0], "base.x")), 0.0);
}

#[test]
fn noise_has_the_level_asked_for() {
    let options = Options {
        duration: Some(60.0),
        ..quiet()
    };
    let clean = run(&small(), &options);
    let noisy = run(
        &small(),
        &Options {
            noise: Some(0.02),
            ..options
        },
    );
    for (channel, clean) in clean.recordings[0]
        .channels
        .iter()
        .zip(&clean.recordings[0].samples)
    {
        let noise: Vec<f32> = column(&noisy.recordings[0], channel)
            .iter()
            .zip(clean)
            .map(|(noisy, clean)| noisy - clean)
            .collect();
        // 30 720 samples: the RMS scatters by 1/√(2n) = 0.4 %; five of those.
        let level = rms(&noise) / rms(clean);
        assert!((level / 0.02 - 1.0).abs() < 0.02, "{channel} {level}");
    }
}

#[test]
fn a_seed_repeats_and_another_differs() {
    let first = run(&small(), &Options::default());
    assert_eq!(first, run(&small(), &Options::default()));
    let other = Options {
        seed: 2,
        ..Options::default()
    };
    assert_ne!(first, run(&small(), &other));
}

/// The bits of one short simulation, folded into one number: they are the same on every
/// machine, and a change here changes everybody's simulated recordings.
#[test]
fn bits_are_frozen() {
    let simulation = run(&small(), &Options::default());
    let mut hash = 0_u64;
    for sample in simulation.recordings[0].samples.iter().flatten() {
        hash = hash.rotate_left(5) ^ u64::from(sample.to_bits());
        hash = hash.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    assert_eq!(hash, 0x3d36_1cd3_1ac3_a120, "{hash:#018x}");
}

#[test]
fn a_further_run_or_sensor_leaves_the_others_alone() {
    let plain = run(&small(), &quiet());
    let mut model = small();
    let mut sensor = model.accelerometers[0].clone();
    sensor.entry.channel = "further".to_owned();
    model.accelerometers.insert(0, sensor);
    let mut plan = model.runs[0].clone();
    plan.name = "further".to_owned();
    model.runs.insert(0, plan);
    let richer = run(&model, &quiet());
    for (channel, samples) in plain.recordings[0]
        .channels
        .iter()
        .zip(&plain.recordings[0].samples)
    {
        assert_eq!(column(&richer.recordings[1], channel), samples, "{channel}");
    }
    assert_ne!(
        column(&richer.recordings[0], DRIVE),
        column(&richer.recordings[1], DRIVE)
    );
}

#[test]
fn drive_can_be_left_out() {
    let options = Options {
        drive: Some(false),
        ..Options::default()
    };
    let without = run(&small(), &options);
    assert!(
        !without.recordings[0]
            .channels
            .iter()
            .any(|name| name == DRIVE)
    );
    assert_eq!(without.setup.runs[0].references, [""; 0]);
    let with = run(&small(), &Options::default());
    assert_eq!(with.setup.runs[0].references, [DRIVE]);
    assert_eq!(
        column(&with.recordings[0], "left.z"),
        column(&without.recordings[0], "left.z")
    );
}

#[test]
fn offsets_are_constant_and_bounded() {
    let model = small_with("noise = 0.01", "dc_offset = 0.5");
    let (plain, shifted) = (run(&small(), &quiet()), run(&model, &quiet()));
    for (channel, clean) in plain.recordings[0]
        .channels
        .iter()
        .zip(&plain.recordings[0].samples)
    {
        let shifted = column(&shifted.recordings[0], channel);
        let offsets: Vec<f64> = shifted
            .iter()
            .zip(clean)
            .map(|(a, b)| f64::from(*a) - f64::from(*b))
            .collect();
        let level = rms(clean);
        assert!(offsets[0].abs() <= 0.5 * level && offsets[0] != 0.0);
        // Rounding to f32 at up to five times the RMS.
        assert!(
            offsets
                .iter()
                .all(|offset| (offset - offsets[0]).abs() < 1e-6 * level)
        );
    }
}

/// Level, the cells carry the weight; tilted by 90° about x, the specimen's weight points
/// along -y of the table and pulls the cells sideways, turning the table about x.
#[test]
fn poses_weigh_the_specimen() {
    let model = small_with(
        "motion = [0, 0, 1, 0, 0, 0]",
        "poses = [[0, 0, 0], [90, 0, 0], [0, 180, 0]]",
    );
    let simulation = run(&model, &quiet());
    assert_eq!(simulation.setup.processing, None);
    assert_eq!(simulation.setup.runs[0].excitation, Excitation::Static);
    let recording = &simulation.recordings[0];
    assert_eq!(recording.sample_rate, None);
    let weight = 11.0 * STANDARD_GRAVITY;
    let sum = |axis: &str, pose: usize| -> f64 {
        ["left", "right", "back"]
            .iter()
            .map(|cell| f64::from(column(recording, &format!("{cell}.{axis}"))[pose]))
            .sum()
    };
    for (axis, pose, expected) in [
        ("z", 0, weight),
        ("x", 0, 0.0),
        ("y", 1, weight),
        ("z", 1, 0.0),
        ("z", 2, -weight),
    ] {
        // Three cells, each rounded to f32 at up to a few hundred N.
        let found = sum(axis, pose);
        assert!((found - expected).abs() < 1e-4, "{axis} {pose} {found}");
    }
    assert!((f64::from(column(recording, "base.z")[0]) - STANDARD_GRAVITY).abs() < 1e-6);
}

#[test]
fn progress_ends_at_its_total() {
    let mut last = (0, 0);
    simulate(&small(), &Options::default(), &mut |progress| {
        assert!(progress.done >= last.0 && progress.done <= progress.total);
        last = (progress.done, progress.total);
    })
    .unwrap();
    assert_eq!(last.0, last.1);
}

#[test]
fn impossible_options_are_refused() {
    let refused = |options: Options| {
        simulate(&small(), &options, &mut |_| ())
            .expect_err("must be refused")
            .to_string()
    };
    let noise = |x| Options {
        noise: Some(x),
        ..Options::default()
    };
    let duration = |x| Options {
        duration: Some(x),
        ..Options::default()
    };
    let slow = Options {
        sample_rate: Some(30.0),
        ..Options::default()
    };
    let too_slow = "ends at 20 Hz, but at 30 samples per second the spectrum ends at 14";
    for (options, part) in [
        (noise(-0.1), "the noise is -0.1"),
        (noise(f64::NAN), "the noise is NaN"),
        (duration(0.0), "the duration is 0"),
        (duration(0.1), "less than one block"),
        (duration(1e9), "shorter"),
        (slow, too_slow),
    ] {
        let message = refused(options);
        assert!(message.contains(part), "{message}");
    }
}
