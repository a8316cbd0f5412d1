//! Set-ups that ask for what cannot be, or say what nobody understands.

use crate::bench::Bench;

#[test]
fn a_value_that_cannot_be_is_refused_by_its_line_and_key() {
    for (key, value, words) in [
        (
            "averaging_band",
            "[0.5, 300.0]",
            "[processing] … `averaging_band` ends at 300 Hz … the spectrum ends at 255 Hz … lower \
             the band",
        ),
        ("mode_band", "[27.5, 480.5]", "`mode_band` ends at 480.5 Hz"),
        (
            "averaging_band",
            "[0.5, 1.2]",
            "`averaging_band` from 0.5 to 1.2 Hz holds 2 line … at least three … widen the band",
        ),
        (
            "averaging_band",
            "[26.0, 0.5]",
            "`averaging_band` is [26, 0.5] … the lower first",
        ),
        (
            "direction",
            "[0, 0, 0]",
            "(channel \"a1\") … `direction` is the zero vector … \"+z\" or [0, 0, 1]",
        ),
        (
            "known_mass",
            "0",
            "`known_mass` is 0 … more than 0 … leave it out",
        ),
        (
            "known_mass",
            "-0.63",
            "`known_mass` is -0.63 … more than 0 … leave it out",
        ),
        (
            "known_mass",
            "0.0",
            "`known_mass` is 0 … more than 0 … leave it out",
        ),
        // It would steer a terminal.
        (
            "channel",
            "\"a\\u001b[2J\"",
            "`channel` is the text … a\\u{1b}[2J … without control characters",
        ),
    ] {
        let bench = Bench::fork().with(key, value);
        let text = std::fs::read_to_string(bench.file("setup.toml")).unwrap();
        let line = text.lines().position(|line| line.starts_with(key)).unwrap();
        let words = format!("setup.toml, line {} … {words}", line + 1);
        bench.refused_input(&words);
    }
}

#[test]
fn sensors_that_leave_nothing_observable() {
    // Accelerations along x, forces along z: no equation holds both.
    Bench::fork().only(&["a1", "fz"]).refused_data(
        "the accelerometers see ax … the load cells measure fz … nothing of the ten … add \
             load cells",
    );
    Bench::fork().only(&["a1"]).refused_input(
        "setup.toml … there is no [[load_cell]] … add at least one … no force is known",
    );
    Bench::fork().only(&["fx", "fz", "ty"]).refused_input(
        "setup.toml … there is no [[accelerometer]] … add at least one … no motion is known",
    );
}

#[test]
fn setups_that_say_something_else() {
    Bench::fork()
        .setup("averaging_band", "avergaing_band")
        .refused_input(
            "setup.toml, line … [processing] … no key `avergaing_band` … did you mean \
             `averaging_band`?",
        );
    Bench::fork()
        .setup("[processing]", "[processing")
        .refused_input("setup.toml, line 6 … this is not TOML");
    Bench::fork()
        .setup("excitation = \"random\"", "excitation = random")
        .refused_input("setup.toml, line … text stands in quotes, `excitation = \"random\"`");
    Bench::fork()
        .write("setup.toml", [0xff, 0, 7])
        .refused_input("setup.toml … not UTF-8 … save the file as UTF-8");
    Bench::fork()
        .write("setup.toml", "")
        .refused_input("setup.toml … there is no [[accelerometer]] … add at least one");
}
