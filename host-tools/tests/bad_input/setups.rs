//! Set-ups that ask for what cannot be, or say what nobody understands.

use crate::bench::Bench;

#[test]
fn band_outside_the_spectrum() {
    Bench::fork()
        .with("averaging_band", "[0.5, 300.0]")
        .identify(&[])
        .refused_input(
            "setup.toml, line … [processing] … `averaging_band` ends at 300 Hz … the spectrum \
             ends at 255 Hz … lower the band",
        );
    Bench::fork()
        .with("mode_band", "[27.5, 480.5]")
        .identify(&[])
        .refused_input("setup.toml, line … `mode_band` ends at 480.5 Hz");
}

#[test]
fn band_with_fewer_than_three_lines() {
    Bench::fork()
        .with("averaging_band", "[0.5, 1.2]")
        .identify(&[])
        .refused_input(
            "setup.toml, line … `averaging_band` from 0.5 to 1.2 Hz holds 2 line … at least three \
             … widen the band",
        );
}

#[test]
fn band_that_is_none() {
    Bench::fork()
        .with("averaging_band", "[26.0, 0.5]")
        .identify(&[])
        .refused_input("setup.toml, line … `averaging_band` is [26, 0.5] … the lower first");
}

#[test]
fn zero_direction() {
    Bench::fork()
        .with("direction", "[0, 0, 0]")
        .identify(&[])
        .refused_input(
            "setup.toml, line … (channel \"a1\") … `direction` is the zero vector … for example \
             [0, 0, 1]",
        );
}

#[test]
fn known_mass_of_zero_or_below() {
    for mass in ["0", "-0.63", "0.0"] {
        let finished = Bench::fork()
            .edit("setup.toml", |text| {
                let old = text.lines().find(|l| l.starts_with("known_mass")).unwrap();
                text.replace(old, &format!("known_mass = {mass}"))
            })
            .identify(&[]);
        finished.refused_input("setup.toml, line 4 … `known_mass` is … more than 0 … leave it out");
    }
}

#[test]
fn sensors_that_leave_nothing_observable() {
    // Accelerations along x, forces along z: no equation holds both.
    Bench::fork()
        .only(&["a1", "fz"])
        .identify(&[])
        .refused_data(
            "the accelerometers see ax … the load cells measure fz … nothing of the ten … add \
             load cells",
        );
    Bench::fork().only(&["a1"]).identify(&[]).refused_input(
        "setup.toml … there is no [[load_cell]] … add at least one … no force is known",
    );
    Bench::fork()
        .only(&["fx", "fz", "ty"])
        .identify(&[])
        .refused_input(
            "setup.toml … there is no [[accelerometer]] … add at least one … no motion is known",
        );
}

#[test]
fn setups_that_say_something_else() {
    Bench::fork()
        .setup("averaging_band", "avergaing_band")
        .identify(&[])
        .refused_input(
            "setup.toml, line … [processing] … no key `avergaing_band` … did you mean \
             `averaging_band`?",
        );
    Bench::fork()
        .setup("[processing]", "[processing")
        .identify(&[])
        .refused_input("setup.toml, line 6 … this is not TOML");
    Bench::fork()
        .write("setup.toml", [0xff, 0, 7])
        .identify(&[])
        .refused_input("setup.toml … not UTF-8 … save the file as UTF-8");
    Bench::fork()
        .write("setup.toml", "")
        .identify(&[])
        .refused_input("setup.toml … there is no [[accelerometer]] … add at least one");
}

#[test]
fn a_name_that_steers_a_terminal() {
    Bench::fork()
        .with("channel", "\"a\\u001b[2J\"")
        .identify(&[])
        .refused_input(
            "setup.toml, line … `channel` is the text … a\\u{1b}[2J … without control characters",
        );
}
