//! Documents that are read back, and files that are none.

use super::*;
use crate::identification::{Choice, Session};
use crate::setup::Setup;
use crate::simulate::{Model, Options, Truth, simulate};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::LazyLock;

/// The result of the fork, shaken for six seconds, with stated errors of its sensors.
pub(crate) static FORK: LazyLock<ResultDocument> = LazyLock::new(|| fork("").0);

/// The same in a frame, of which these are the keys, and the truth in the frame of the sensors.
pub(crate) fn fork_in(keys: &str) -> (ResultDocument, Truth) {
    fork(&format!("\n[frame]\n{keys}"))
}

fn fork(more: &str) -> (ResultDocument, Truth) {
    let options = Options {
        noise: Some(0.01),
        duration: Some(6.0),
        weighed: true,
        ..Options::default()
    };
    let simulation = simulate(&Model::fork().unwrap(), &options, &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = simulation.write(folder.path()).unwrap();
    let mut text = std::fs::read_to_string(&path).unwrap();
    text.push_str("\n[defaults]\nposition_uncertainty = 0.0005\n");
    text.push_str(more);
    let setup = Setup::from_str(&text, &path).unwrap();
    let mut session = Session::new(&setup).with_type_b();
    let answer = session.answer_with_modes(&Choice::default(), &mut |_| ());
    let truth = std::fs::read(folder.path().join("truth.json")).unwrap();
    let truth = serde_json::from_slice(&truth).unwrap();
    (ResultDocument::new(&setup, &answer.unwrap()), truth)
}

/// A result that knows all ten numbers: mass, centre of gravity and inertia about it, with a
/// covariance in which all of them are correlated.
pub(crate) fn whole_body(body: [f64; 10]) -> ResultDocument {
    let deviation = |k: usize| 1e-4 * body[k].abs().max(1e-3);
    let covariance = |i: usize, j: usize| {
        let correlation = if i == j { 1.0 } else { 0.3 };
        correlation * deviation(i) * deviation(j)
    };
    let number = |k: usize| Number {
        value: Some(body[k]),
        std: Some(deviation(k)),
        interval: Some(2.0 * deviation(k)),
        observable: true,
        type_b: None,
        combined: None,
    };
    let mut document = FORK.clone();
    document.mass = number(0);
    document.indicator = None;
    document.centre_of_gravity = [number(1), number(2), number(3)];
    for terms in [&mut document.inertia_reference, &mut document.inertia_cg] {
        for (k, term) in terms.each().into_iter().enumerate() {
            *term = number(4 + k);
        }
    }
    let matrix = document.covariance.as_mut().unwrap();
    "mass".clone_into(&mut matrix.rows[0]);
    "kg".clone_into(&mut matrix.units[0]);
    matrix.matrix = std::array::from_fn(|i| std::array::from_fn(|j| Some(covariance(i, j))));
    document.covariance_type_b = None;
    document
}

fn parse(document: &Value) -> Result<ResultDocument, ReadError> {
    ResultDocument::parse(document.to_string().as_bytes(), Path::new("result.json"))
}

/// The error of the fork's document after a change.
fn spoilt(change: impl FnOnce(&mut Value)) -> String {
    let mut document = serde_json::to_value(&*FORK).unwrap();
    change(&mut document);
    parse(&document).unwrap_err().to_string()
}

#[test]
fn a_document_is_read_back_to_the_last_bit() {
    let text = serde_json::to_string_pretty(&*FORK).unwrap();
    let read = ResultDocument::parse(text.as_bytes(), Path::new("result.json")).unwrap();
    assert_eq!(read, *FORK);
    assert_eq!(serde_json::to_string_pretty(&read).unwrap(), text);
    // Numbers with and without a value, with type B, modes and runs: every part is exercised.
    assert!(read.mass.observable && !read.inertia_cg.xx.observable);
    assert!(read.inertia_cg.yy.combined.is_some() && read.covariance_type_b.is_some());
    assert!(!read.fixed_modes.is_empty() && read.runs.len() == 3 && !read.noise.is_empty());
}

#[test]
fn keys_of_later_versions_are_skipped() {
    let mut document = serde_json::to_value(&*FORK).unwrap();
    document["truth"] = json!({"schema": "massline/truth/1"});
    document["mass"]["unit"] = json!("kg");
    assert_eq!(parse(&document).unwrap(), *FORK);
}

#[test]
fn an_infinite_condition_number_survives() {
    let mut document = FORK.clone();
    document.condition_number = f64::INFINITY;
    assert_eq!(
        parse(&serde_json::to_value(&document).unwrap()).unwrap(),
        document
    );
}

#[test]
fn other_documents_are_named() {
    for (schema, words) in [
        (
            json!("massline/result/3"),
            "of the form \"massline/result/3\"",
        ),
        (json!("massline/result/1"), "identify again"),
        (
            json!("massline/comparison/1"),
            "missing field `recommended`",
        ),
        (
            json!("massline/truth/1"),
            "`schema` is \"massline/truth/1\"",
        ),
        (json!("\u{1b}[2J"), "`schema` is"),
        (json!(null), "`schema` is missing"),
        (json!(2), "line 1, column"),
    ] {
        let error = spoilt(|document| document["schema"] = schema.clone());
        assert!(error.starts_with("result.json"), "{error}");
        assert!(error.contains(words), "{schema}: {error}");
    }
}

/// Of several results one is read, and it has to be named.
#[test]
fn one_of_several_results_is_read_by_its_method() {
    let mut other = FORK.clone();
    "c".clone_into(&mut other.method);
    let all = ComparisonDocument {
        schema: COMPARISON_SCHEMA.to_owned(),
        title: String::new(),
        recommended: FORK.method.clone(),
        recommended_because: String::new(),
        results: vec![other, FORK.clone()],
        failed: Vec::new(),
    };
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: Vec<u8>| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let several = write("all.json", serde_json::to_vec(&all).unwrap());
    let one = write("one.json", serde_json::to_vec(&*FORK).unwrap());
    let error = |path: &Path, method| ResultDocument::read(path, method).unwrap_err().to_string();
    assert_eq!(
        ResultDocument::read(&several, Some(&FORK.method)).unwrap(),
        *FORK
    );
    assert_eq!(
        ResultDocument::read(&several, Some("c")).unwrap().method,
        "c"
    );
    assert_eq!(
        ResultDocument::read(&one, Some(&FORK.method)).unwrap(),
        *FORK
    );
    for (path, method) in [(&several, None), (&several, Some("d"))] {
        let text = error(path, method);
        assert!(text.contains("c, apparent-mass (recommended)"), "{text}");
    }
    assert!(error(&one, Some("c")).contains("no result of the method \"c\"; it has apparent-mass"));
    let mut spoilt = all;
    spoilt.results[1].mass.std = Some(-1.0);
    let spoilt = write("spoilt.json", serde_json::to_vec(&spoilt).unwrap());
    assert!(error(&spoilt, Some(&FORK.method)).contains("`mass`: a negative error bar"));
}

#[test]
fn a_missing_or_wrong_key_is_named_with_its_place() {
    let error = spoilt(|document| {
        document.as_object_mut().unwrap().remove("inertia_cg");
    });
    assert!(error.contains("missing field `inertia_cg`"), "{error}");
    let text = serde_json::to_string_pretty(&*FORK).unwrap();
    let line = text.lines().position(|l| l.contains("\"mass\"")).unwrap() + 2;
    let spoilt = text.replacen("\"value\": ", "\"value\": \"0.63\", \"was\": ", 1);
    let error = ResultDocument::parse(spoilt.as_bytes(), Path::new("x/result.json"));
    let error = error.unwrap_err().to_string();
    assert!(
        error.starts_with(&format!("x/result.json, line {line}, column ")),
        "{error}"
    );
    assert!(error.contains("expected f64"), "{error}");
}

#[test]
fn contradictions_are_named_by_their_property() {
    for (key, value, words) in [
        ("value", json!(null), "`observable` and `value` disagree"),
        (
            "observable",
            json!(false),
            "`observable` and `value` disagree",
        ),
        ("std", json!(null), "an error bar without a value"),
        ("std", json!(-1e-9), "a negative error bar"),
        ("interval", json!(-1.0), "a negative error bar"),
        (
            "combined",
            json!({"std": -1.0, "interval": 1.0, "freedom": null}),
            "a negative error bar",
        ),
    ] {
        let error = spoilt(|document| document["inertia_cg"]["yy"][key] = value);
        assert!(error.contains("`inertia_cg.yy`"), "{error}");
        assert!(error.contains(words), "{error}");
    }
}

/// Every beginning of a document is an error with a place, none a panic or an answer.
#[test]
fn a_document_that_is_cut_is_an_error() {
    let text = serde_json::to_string(&*FORK).unwrap();
    for end in 0..text.len() {
        let cut = ResultDocument::parse(&text.as_bytes()[..end], Path::new("result.json"));
        assert!(matches!(cut, Err(ReadError::Form { .. })), "{end}");
    }
}

#[test]
fn bytes_that_are_no_document_are_an_error() {
    let deep = "[".repeat(100_000);
    for bytes in [
        &b""[..],
        b"\xff\xfe{",
        b"null",
        b"[]",
        b"{}",
        b"1e999",
        deep.as_bytes(),
    ] {
        ResultDocument::parse(bytes, Path::new("result.json")).unwrap_err();
    }
}
