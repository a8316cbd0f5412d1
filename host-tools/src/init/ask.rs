//! Questions for the values that no recording states. An empty answer leaves one to be filled in later.

use super::channels::Found;
use super::names::Kind;
use crate::setup::{Mount, is_electric, measured_in};

/// Times that a question is asked until its answer is left for later.
const TRIES: usize = 3;

/// Asks for the values that are missing. `question` shows a text and gives the answer; `None` ends all questions.
pub fn ask(found: &mut Found, question: &mut dyn FnMut(&str) -> Option<String>) {
    // No answer is the end of the input, which is no error: the rest is filled in later.
    let _ = all(found, question);
}

/// The answer as `read` understands it.
fn one<T>(
    question: &mut dyn FnMut(&str) -> Option<String>,
    text: &str,
    read: impl Fn(&str) -> Option<T>,
) -> Option<Option<T>> {
    for _ in 0..TRIES {
        let answer = question(text)?;
        let answer = answer.trim();
        if answer.is_empty() {
            return Some(None);
        }
        if let Some(value) = read(answer) {
            return Some(Some(value));
        }
    }
    Some(None)
}

fn all(found: &mut Found, question: &mut dyn FnMut(&str) -> Option<String>) -> Option<()> {
    let band = |text: &str| match numbers(text).as_deref() {
        Some([low, high]) if *low >= 0.0 && low < high => Some([*low, *high]),
        _ => None,
    };
    if found.band.is_none() {
        let text =
            "averaging band, lower and upper end in Hz, below the first elastic natural frequency";
        found.band = one(question, text, band)?;
    }
    if found.sample_rate.is_none() && !found.has_rate {
        let rate = |text: &str| {
            text.parse()
                .ok()
                .filter(|x: &f64| x.is_finite() && *x > 0.0)
        };
        found.sample_rate = one(question, "sample rate in Hz", rate)?;
    }
    for (kind, sensors, units) in [
        (
            Kind::Acceleration,
            "accelerometers",
            "m/s², g, mm/s², V, mV, pC, counts",
        ),
        (
            Kind::Force,
            "load cells that measure a force",
            "N, kN, lbf, V, mV, pC, counts",
        ),
        (
            Kind::Moment,
            "load cells that measure a moment",
            "N m, kN m, lbf in, lbf ft, V, mV, pC, counts",
        ),
    ] {
        let mut unknown: Vec<_> = found
            .sensors
            .iter_mut()
            .filter(|s| s.kind.unwrap_or(Kind::Acceleration) == kind)
            .filter(|s| s.unit.is_none() && s.in_header.is_none())
            .collect();
        if unknown.is_empty() {
            continue;
        }
        let known = |text: &str| {
            let fits = measured_in(text) == Some(kind) || is_electric(text) || text == "counts";
            fits.then(|| text.to_owned())
        };
        let unit = one(question, &format!("unit of the {sensors}: {units}"), known)?;
        unknown.iter_mut().for_each(|s| s.unit.clone_from(&unit));
    }
    if found.sensors.iter().any(|s| s.position.is_none()) {
        let length = |text: &str| {
            ["m", "mm", "cm", "in"]
                .contains(&text)
                .then(|| text.to_owned())
        };
        if let Some(unit) = one(question, "unit of positions: m, mm, cm or in", length)? {
            found.length_unit = unit;
        }
    }
    for sensor in &mut found.sensors {
        let name = &sensor.name;
        if sensor.position.is_none() && sensor.kind != Some(Kind::Moment) {
            let position = |text: &str| <[f64; 3]>::try_from(numbers(text)?).ok();
            let text = format!("{name}: position x y z in {}", found.length_unit);
            sensor.position = one(question, &text, position)?;
        }
        let load = matches!(sensor.kind, Some(Kind::Force | Kind::Moment));
        if sensor.mount.is_none() && !load {
            let mount = |text: &str| match text {
                "t" | "table" | "interface" => Some(Mount::Interface),
                "s" | "structure" => Some(Mount::Structure),
                _ => None,
            };
            let text = format!("{name}: on the table (t) or on the structure (s)");
            sensor.mount = one(question, &text, mount)?;
        }
    }
    Some(())
}

/// Finite numbers with blanks or commas between them.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let parts = text
        .split([' ', ',', ';', '\t'])
        .filter(|part| !part.is_empty());
    let number = |part: &str| part.parse::<f64>().ok().filter(|x| x.is_finite());
    parts.map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::init;

    fn found() -> Found {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.csv");
        std::fs::write(&file, "T1:X,T1:Y,T1:Z,LC1:Z\n1,2,3,4\n").unwrap();
        init::find(&[file]).unwrap()
    }

    fn answered(answers: &[&str]) -> (Found, Vec<String>) {
        let mut found = found();
        let mut answers = answers.iter();
        let mut asked = Vec::new();
        ask(&mut found, &mut |text| {
            asked.push(text.to_owned());
            answers.next().map(|answer| format!("{answer}\n"))
        });
        (found, asked)
    }

    #[test]
    fn answers_make_a_whole_setup() {
        let answers = [
            "2, 20",
            "512",
            "g",
            "stone",
            "kN",
            "mm",
            "600 550 0",
            "t",
            "1 2",
            "1 2 3",
        ];
        let (found, asked) = answered(&answers);
        // The unit that is none and the position of two numbers are asked for once more.
        assert_eq!(asked.len(), answers.len());
        let text = init::draft(&found, "setup.toml".as_ref());
        let filled: Vec<&str> = text
            .lines()
            .filter(|line| line.contains("fill in"))
            .collect();
        // The head.
        assert_eq!(filled.len(), 1, "{text}");
        let setup = crate::setup::Setup::from_str(&text, "setup.toml".as_ref()).unwrap();
        assert_eq!(setup.accelerometers[0].position, [0.6, 0.55, 0.0]);
        assert_eq!(setup.accelerometers[2].mount, Mount::Interface);
        assert_eq!(setup.load_cells[0].scale, 1000.0);
        assert_eq!(setup.load_cells[0].position, [0.001, 0.002, 0.003]);
    }

    #[test]
    fn empty_answers_and_the_end_of_the_input_leave_it_for_later() {
        let (found, asked) = answered(&["", "", "", "", "", "", "", ""]);
        assert_eq!((found.sensors.len(), asked.len()), (2, 8));
        assert!(
            found
                .sensors
                .iter()
                .all(|s| s.position.is_none() && s.unit.is_none())
        );
        assert_eq!(answered(&[]).1.len(), 1);
        // One that is never understood does not ask for ever.
        assert_eq!(answered(&["x"; 99]).1.len(), 3 * 8);
    }
}
