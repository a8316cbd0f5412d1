use super::*;
use crate::result::tests::{FORK, whole_body};
use proptest::prelude::*;
use std::collections::BTreeSet;

fn bodies() -> impl Iterator<Item = &'static dyn Export> {
    let body = |format: &&dyn Export| format.form().kind != Kind::Table;
    FORMATS.into_iter().filter(body)
}

fn text(format: &dyn Export, result: &ResultDocument, view: &View) -> String {
    String::from_utf8(bytes(format, result, view).unwrap()).unwrap()
}

#[test]
fn names_are_unique_and_the_manual_has_every_format() {
    let names: BTreeSet<&str> = FORMATS.iter().map(|f| f.form().name).collect();
    assert_eq!(names.len(), FORMATS.len());
    let manual = include_str!("../../README.md");
    for format in FORMATS {
        let row = format!(
            "| `{}` | `.{}` | {} |",
            format.form().name,
            format.form().extension,
            format.form().description
        );
        assert!(manual.contains(&row), "{row}");
        assert!(find(format.form().name).is_some_and(|f| f.form().name == format.form().name));
    }
    assert!(find("doc").is_none());
}

#[test]
fn a_plane_test_suits_tables_alone_and_what_is_missing_is_named() {
    for format in FORMATS {
        let made = bytes(format, &FORK, &View::OF_THE_RESULT);
        if format.form().kind == Kind::Table {
            assert!(!made.unwrap().is_empty());
            continue;
        }
        let error = made.unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let reason = error.to_string();
        let missing = [
            "`centre_of_gravity.y`",
            "`inertia_cg.xx`",
            "`inertia_cg.yz`",
        ];
        for words in missing.into_iter().chain(["export the table `csv`"]) {
            assert!(reason.contains(words), "{}: {reason}", format.form().name);
        }
        assert!(!reason.contains("`inertia_cg.yy`"), "{reason}");
    }
}

#[test]
fn options_of_bodies_are_refused_for_tables() {
    let view = View {
        about: Some([1.0, 2.0, 3.0]),
        ..View::OF_THE_RESULT
    };
    let grid = View {
        grid: Some(7),
        ..View::OF_THE_RESULT
    };
    let body = whole_body(BODY);
    for format in FORMATS {
        let table = format.form().kind == Kind::Table;
        assert_eq!(bytes(format, &body, &view).is_err(), table);
        let element = format.form().kind == Kind::Element;
        assert_eq!(bytes(format, &body, &grid).is_ok(), element);
    }
    let error = bytes(&json::Json, &body, &view).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    let formats =
        "--about is for mass-matrix, nastran, urdf, sdf, mjcf, mujoco-sysid; leave it out";
    assert_eq!(error.to_string(), formats);
}

#[test]
fn numbers_that_overflow_are_no_body() {
    let mut body = BODY;
    body[0] = 1e308;
    let far = View {
        about: Some([1e10, 0.0, 0.0]),
        ..View::OF_THE_RESULT
    };
    for format in bodies() {
        let error = bytes(format, &whole_body(body), &far).unwrap_err();
        assert!(error.to_string().contains("too large"), "{error}");
    }
}

/// Mass, centre of gravity, inertia about it.
const BODY: [f64; 10] = [3.0, 0.1, -0.2, 0.3, 0.5, 0.6, 0.7, 0.05, -0.04, 0.03];

/// About a point off the origin and turned by a quarter, whose matrix is exact: x of the export is
/// y of the result, its y is -x.
#[test]
fn the_formats_have_the_signs_of_their_manuals() {
    let body = whole_body(BODY);
    let view = View {
        about: Some([1.0, 0.0, 0.0]),
        rotation: Some([0.0, 0.0, 90.0]),
        grid: Some(12),
        element: Some(99),
    };
    let link = View {
        grid: None,
        element: None,
        ..view
    };
    // Point (0.1, -0.2, 0.3) seen from (1, 0, 0); xx and yy change places, xy its sign.
    let (x, y) = ("-0.2", "0.9");
    let urdf = text(&urdf::URDF, &body, &link);
    assert!(
        urdf.contains(&format!("xyz=\"{x} {y} 0.3\" rpy=\"0 0 0\"")),
        "{urdf}"
    );
    let line = "ixx=\"0.6\" iyy=\"0.5\" izz=\"0.7\" ixy=\"0.05\" ixz=\"-0.03\" iyz=\"-0.04\"";
    assert!(urdf.contains(line), "{urdf}");
    let sdf = text(&sdf::SDF, &body, &link);
    assert!(
        sdf.contains("<ixy>0.05</ixy>") && sdf.contains("<iyz>-0.04</iyz>"),
        "{sdf}"
    );
    let mjcf = text(&mjcf::MJCF, &body, &link);
    let line =
        format!("pos=\"{x} {y} 0.3\" mass=\"3\" fullinertia=\"0.6 0.5 0.7 0.05 -0.03 -0.04\"");
    assert!(mjcf.contains(&line), "{mjcf}");
    let nastran = text(&nastran::Nastran, &body, &view);
    let field = |text: &str| format!("{text:>16}");
    for line in [
        format!(
            "CONM2*  {}{}{}{}",
            field("99"),
            field("12"),
            field("0"),
            field("3.0")
        ),
        format!("*       {}{}{}", field(x), field(y), field("0.3")),
        format!(
            "*       {}{}{}{}",
            field("0.6"),
            field("-0.05"),
            field("0.5"),
            field("0.03")
        ),
        format!("*       {}{}", field("0.04"), field("0.7")),
    ] {
        assert!(nastran.lines().any(|l| l == line), "{line}\n{nastran}");
    }
    assert!(
        nastran.lines().all(|l| l.is_ascii() && l.len() <= 80),
        "{nastran}"
    );
    let matrix = text(&mass_matrix::MassMatrix, &body, &link);
    // Equation (1): m, then m z and -m y; the moments about the point by parallel axes.
    assert!(
        matrix
            .lines()
            .any(|l| l.starts_with("fx,3.0,0.0,0.0,0.0,0.8999999999999999,-2.7")),
        "{matrix}"
    );
}

/// A body as far from its reference point as a crane from its foot, with products of either sign,
/// from any direction: the mass matrix about the point of each format is that of the result, turned.
fn check(body: [f64; 10], about: [f64; 3], rotation: [f64; 3]) {
    let result = whole_body(body);
    let view = View {
        about: Some(about),
        rotation: Some(rotation),
        ..View::OF_THE_RESULT
    };
    for format in bodies() {
        let made = bytes(format, &result, &view);
        assert!(made.is_ok(), "{}: {:?}", format.form().name, made.err());
    }
    let turned = Body::of(&result, &view).unwrap().mass_matrix();
    let plain = View {
        about: Some(about),
        ..View::OF_THE_RESULT
    };
    let straight = Body::of(&result, &plain).unwrap().mass_matrix();
    let frame = view.frame(&result).unwrap();
    let mut both = nalgebra::Matrix6::zeros();
    for corner in [0, 3] {
        let mut view = both.fixed_view_mut::<3, 3>(corner, corner);
        view.copy_from(&frame.turn());
    }
    let error = (both * straight * both.transpose() - turned).amax();
    // A dozen roundings of the largest entry.
    assert!(error <= 3e-15 * straight.amax(), "{error}");
}

proptest! {
    #[test]
    fn any_body_is_written_and_read_again(
        mass in 1e-3..1e5f64,
        centre in prop::array::uniform3(-100.0..100.0f64),
        axes in prop::array::uniform3(0.1..1.0f64),
        tilt in prop::array::uniform3(-180.0..180.0f64),
        about in prop::array::uniform3(-100.0..100.0f64),
        rotation in prop::array::uniform3(-180.0..180.0f64),
    ) {
        // Moments of a body of positive density, turned so that it has products.
        let [a, b, c] = axes.map(|x| mass * x * x);
        let placement = Placement::new(tilt.into(), nalgebra::Vector3::zeros()).unwrap();
        let frame = Frame { origin: [0.0; 3], axes: placement.rotation().into() };
        let terms = frame.turn_of_inertia()
            * nalgebra::SVector::from([b + c, a + c, a + b, 0.0, 0.0, 0.0]);
        let mut body = [mass; 10];
        body[1..4].copy_from_slice(&centre);
        body[4..].copy_from_slice(terms.as_slice());
        check(body, about, rotation);
    }
}

#[test]
fn a_body_that_cannot_exist_is_said_so() {
    let mut body = BODY;
    body[6] = 1.3;
    let result = whole_body(body);
    assert_eq!(doubt(&csv::Csv, &result), None);
    assert!(
        doubt(&mjcf::MJCF, &result)
            .unwrap()
            .contains("MuJoCo refuses")
    );
    assert!(text(&mjcf::MJCF, &result, &View::OF_THE_RESULT).contains("exceeds the sum"));
    let error = bytes(&sysid::Sysid, &result, &View::OF_THE_RESULT).unwrap_err();
    assert!(error.to_string().contains("cannot exist"), "{error}");
    assert_eq!(doubt(&mjcf::MJCF, &whole_body(BODY)), None);
}

/// Every number of every format, changed by hand, is found when it is read again.
#[test]
fn a_number_that_was_changed_is_found() {
    let result = whole_body(BODY);
    // Parquet is no text: its own test changes each cell.
    let texts = FORMATS.into_iter().filter(|f| f.form().name != "parquet");
    for format in texts {
        let whole = text(format, &result, &View::OF_THE_RESULT);
        let mut found = 0;
        for (place, digit) in whole.char_indices() {
            let line = &whole[..place];
            let line = &whole[line.rfind('\n').map_or(0, |n| n + 1)..];
            let comment = ["$", "#", " ", "<!--"]
                .iter()
                .any(|mark| line.starts_with(mark))
                && whole[..place].matches("-->").count() == 0
                && whole.contains("-->");
            if !digit.is_ascii_digit() || comment || line.starts_with(['$', '#']) {
                continue;
            }
            let mut changed = whole.clone().into_bytes();
            changed[place] = if digit == '9' { b'8' } else { digit as u8 + 1 };
            found += usize::from(
                format
                    .compare(&result, &View::OF_THE_RESULT, &changed)
                    .is_err(),
            );
        }
        assert!(found >= 10, "{}: {found}", format.form().name);
    }
}

#[test]
fn hostile_titles_end_no_comment() {
    let mut result = whole_body(BODY);
    result.title = "--><a/>\n$ x\nCONM2, 1\u{1b}[2J \"é\" ---".to_owned();
    for format in bodies() {
        text(format, &result, &View::OF_THE_RESULT);
    }
}
