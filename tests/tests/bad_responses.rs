//! Frequency responses and modes that do not suit a method: each error names the method or the
//! file, and the missing data.

mod bench;

use bench::fork::{self, Responses};
use massline::identification::{AnswerError, Choice, Session};
use massline::setup::Setup;
use massline::simulate::Options;
use massline_core::masslines::Method;
use tempfile::TempDir;

fn warnings_of(setup: &Setup, method: Option<Method>) -> Result<Vec<String>, AnswerError> {
    let choice = Choice {
        method,
        ..Choice::default()
    };
    let answer = Session::new(setup).answer_with_modes(&choice, &mut |_| ())?;
    Ok(answer.warnings)
}

/// The error of a sine test whose responses were changed.
fn error_of(change: impl FnOnce(&mut [Responses; 3])) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut responses = fork::responses();
    change(&mut responses);
    let setup = fork::sine(folder.path(), &responses);
    let error = warnings_of(&setup, None).unwrap_err();
    assert_eq!(error.exit_code(), 2, "unusable input: {error}");
    error.to_string()
}

/// The sine test with other bands.
fn with_bands(averaging: [f64; 2], mode: Option<[f64; 2]>) -> (Setup, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = fork::sine(folder.path(), &fork::responses());
    let processing = setup.processing.as_mut().unwrap();
    processing.averaging_band = averaging;
    processing.mode_band = mode;
    (setup, folder)
}

#[track_caller]
fn assert_contains(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "«{word}» is not in: {text}");
    }
}

#[track_caller]
fn assert_one_contains(warnings: &[String], words: &[&str]) {
    let found = warnings.iter().any(|w| words.iter().all(|x| w.contains(x)));
    assert!(found, "no warning has {words:?}: {warnings:#?}");
}

#[test]
fn a_repeated_frequency_is_an_error_with_its_line() {
    let text = error_of(|runs| {
        let again = (runs[1].rows[9].0, runs[1].rows[9].1.clone());
        runs[1].rows.insert(10, again);
    });
    // The header is line 1, so the eleventh row is line 12.
    assert_contains(
        &text,
        &["lateral-Z.csv, line 12", "5 Hz after 5 Hz", "each once"],
    );
}

#[test]
fn frequencies_out_of_order_are_an_error() {
    let text = error_of(|runs| runs[0].rows.swap(3, 4));
    assert_contains(&text, &["lateral-X.csv, line 6", "must ascend"]);
}

#[test]
fn a_frequency_that_one_run_lacks_is_an_error() {
    let text = error_of(|runs| {
        runs[2].rows.remove(20);
    });
    assert_contains(
        &text,
        &["rotation-about-Y.csv", "10.5 Hz", "the same frequencies"],
    );
    let text = error_of(|runs| {
        runs[1].rows.pop();
    });
    assert_contains(&text, &["lateral-Z.csv", "200 Hz"]);
}

#[test]
fn a_band_without_lines_is_an_error() {
    let (setup, _folder) = with_bands([0.1, 0.4], Some([28.0, 50.0]));
    let error = warnings_of(&setup, None).unwrap_err();
    assert_contains(&error.to_string(), &["line"]);
}

#[test]
fn methods_that_fit_modes_name_themselves_where_there_is_none() {
    let (setup, _folder) = with_bands([0.5, 14.5], Some([16.0, 25.0]));
    for (method, name) in [
        (Method::CurveFit, "method d:"),
        (Method::Synthesis, "method e:"),
    ] {
        let error = warnings_of(&setup, Some(method)).unwrap_err();
        assert_eq!(error.exit_code(), 1, "the data do not allow an answer");
        let text = error.to_string();
        assert_contains(
            &text,
            &[name, "no elastic mode", "`mode_band`", "c-squared"],
        );
    }
    // The recommended method answers without modes, with a warning.
    let warnings = warnings_of(&setup, None).unwrap();
    assert_one_contains(
        &warnings,
        &["apparent-mass", "no elastic mode", "25 Hz", "ω²"],
    );
    // Without a `mode_band` there is no advice to give one.
    let (setup, _folder) = with_bands([0.5, 14.5], None);
    let warnings = warnings_of(&setup, None).unwrap();
    assert!(!warnings.iter().any(|w| w.contains("expects one")));
}

/// The fifth fixed mode lies at 215 Hz, the last line at 200 Hz.
#[test]
fn a_mode_just_beyond_the_lines_is_noticed() {
    let (setup, _folder) = with_bands([0.5, 14.5], Some([28.0, 200.0]));
    let warnings = warnings_of(&setup, None).unwrap();
    assert_one_contains(
        &warnings,
        &["modal analysis", "beyond the last line", "effective masses"],
    );
    let (setup, _folder) = with_bands([0.5, 14.5], Some([28.0, 50.0]));
    let warnings = warnings_of(&setup, None).unwrap();
    assert!(!warnings.iter().any(|w| w.contains("modal analysis")));
}

/// The satellite with its tank sprung 0.1 Hz above its antenna, on lines 0.5 Hz apart.
#[test]
fn two_modes_closer_than_the_lines_come_apart_or_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let satellite = std::fs::read_to_string(bench::models().join("satellite.toml")).unwrap();
    let tank = "frequency = 44.0";
    assert_eq!(satellite.matches(tank).count(), 1);
    let text = satellite.replace(tank, "frequency = 37.6");
    let path = folder.path().join("twins.toml");
    std::fs::write(&path, text).unwrap();
    let model = massline::simulate::Model::read(&path).unwrap_or_else(|e| panic!("{e}"));
    let options = Options {
        noise: Some(0.0),
        duration: Some(20.0),
        ..Options::default()
    };
    let bench = bench::Bench::shake(&model, &options);
    let modes = Session::new(&bench.setup).fixed_modes(&mut |_| ()).unwrap();
    let close = modes.iter().map(|mode| mode.pole.frequency);
    let close = close.filter(|f| (37.0..38.2).contains(f)).count();
    let warnings = warnings_of(&bench.setup, None).unwrap();
    let is_noticed = warnings
        .iter()
        .any(|w| w.contains("two modes lie closer than the lines"));
    assert!(close == 2 || is_noticed, "{close} modes, and {warnings:?}");
}

#[test]
fn methods_of_the_free_system_say_how_many_runs_they_lack() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = fork::sine(folder.path(), &fork::responses());
    setup.runs.truncate(2);
    for method in [
        Method::FreeResponses,
        Method::FreeResponsesSquared,
        Method::CurveFit,
        Method::Synthesis,
    ] {
        let error = warnings_of(&setup, Some(method)).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let name = format!("method {}:", method.name());
        let text = error.to_string();
        assert_contains(&text, &[&name, "needs 3 independent runs", "found 2"]);
    }
    // The others answer for the parameters that two runs determine, and name the missing ones.
    for method in [
        Method::FrequencyResponses,
        Method::PowerSpectraCholesky,
        Method::ApparentMass,
    ] {
        let warnings = warnings_of(&setup, Some(method)).unwrap();
        assert_one_contains(&warnings, &["not observable"]);
    }
}
