//! Tests on a table that leaks into the axes that are not driven, by less than ten times the noise of the accelerometers.

mod bench;

use serde_json::Value;
use std::path::Path;

/// What `identify` and `simulate` say of a test.
struct Test {
    result: Value,
    truth: Value,
}

impl Test {
    /// The satellite on its leaking table, with these sections in place of its own, 20 s a run with 1 % of noise, identified
    /// with these options.
    fn of(sections: &str, seed: u32, options: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let satellite = concat!(env!("CARGO_MANIFEST_DIR"), "/models/satellite.toml");
        let model = format!("extends = \"{satellite}\"\ntitle = \"Leaking table\"\n{sections}");
        std::fs::write(folder.path().join("model.toml"), model).unwrap();
        let seed = seed.to_string();
        let simulate = ["simulate", "model.toml", "--out", "t", "--noise", "0.01"];
        let rest = ["--seed", &seed, "--duration", "20", "--quiet"];
        run(folder.path(), &[&simulate[..], &rest[..]].concat());
        let test = folder.path().join("t");
        let identify = ["identify", "setup.toml", "--json", "--quiet"];
        let result = run(&test, &[&identify[..], options].concat());
        let truth = std::fs::read_to_string(test.join("truth.json")).unwrap();
        Self {
            result: serde_json::from_str(&result).unwrap(),
            truth: serde_json::from_str(&truth).unwrap(),
        }
    }

    /// Error of each number over its 95 % half interval; `None` where it has none.
    fn errors(&self) -> Vec<(String, Option<f64>)> {
        let single = std::iter::once("/mass".to_owned());
        let centre = (0..3).map(|i| format!("/centre_of_gravity/{i}"));
        let terms = ["xx", "yy", "zz", "xy", "xz", "yz"];
        let inertia = ["inertia_reference", "inertia_cg"]
            .into_iter()
            .flat_map(|about| terms.map(|term| format!("/{about}/{term}")));
        let error = |at: &String| {
            let number = self.result.pointer(at)?;
            let truth = self.truth.pointer(at)?.as_f64()?;
            Some((number["value"].as_f64()? - truth) / number["interval"].as_f64()?)
        };
        let all = single.chain(centre).chain(inertia);
        all.map(|at| (at.clone(), error(&at))).collect()
    }
}

fn run(folder: &Path, arguments: &[&str]) -> String {
    let finished = bench::massline(folder, arguments);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.stdout
}

/// The band's method.
const BY_BAND: &[&str] = &["--method", "apparent-mass"];

fn one_run(axis: usize) -> String {
    let mut motion = [0.0; 6];
    motion[axis] = 2.0;
    format!("[[run]]\nname = \"only\"\nmotion = {motion:?}\n")
}

/// One run along an axis, of which accelerometers across it have a hundredth of the noise: taken as alike, they had the size of the
/// body be nine metres, and of such a body nothing was told in five of eleven runs along z. The error of the mass was
/// 1.7 standard deviations, root mean square, since motion that rises with frequency was left out.
///
/// The largest of these 24 errors was 0.66 half intervals.
#[test]
fn one_run_tells_mass_and_the_centre_across_it() {
    for axis in [0, 2] {
        for seed in [3, 7, 10, 11] {
            let mut mass_and_centre = Test::of(&one_run(axis), seed, BY_BAND).errors();
            mass_and_centre.truncate(4);
            mass_and_centre.remove(1 + axis);
            for (name, error) in mass_and_centre {
                let error = error.unwrap_or_else(|| panic!("axis {axis}, seed {seed}: no {name}"));
                assert!(
                    error.abs() < 1.6,
                    "axis {axis}, seed {seed}: {name} {error}"
                );
            }
        }
    }
}

/// Four vertical load cells below A and the runs that they tell. Where the horizontal forces pass that none of them measures, simulation
/// and identification agree: through the cells' centre, 50 mm below A. Else the height of the centre of gravity is off by
/// these 50 mm, and the moments of inertia about A by eight standard deviations.
///
/// Of 112 numbers 111 were inside their intervals, and the others within 1.13 times; 101, and 1.61 times, while motion near the
/// noise was left out that rises with frequency.
#[test]
fn vertical_cells_leave_no_force_where_it_is_not() {
    let mut sections = String::new();
    for (i, [x, y]) in [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]
        .iter()
        .enumerate()
    {
        let entry = format!(
            "[[load_cell]]\nname = \"cell{i}\"\nposition = [{x}, {y}, -0.05]\ndirection = [0.0, 0.0, 1.0]\n"
        );
        sections.push_str(&entry);
    }
    for axis in [2, 3, 4] {
        let run = one_run(axis).replace("only", &format!("axis {axis}"));
        sections.push_str(&run);
    }
    let (mut inside, mut all) = (0, 0);
    for seed in 1..=8 {
        for (name, error) in Test::of(&sections, seed, BY_BAND).errors() {
            let Some(error) = error else {
                continue;
            };
            assert!(error.abs() < 1.5, "seed {seed}: {name} {error}");
            all += 1;
            inside += usize::from(error.abs() <= 1.0);
        }
    }
    assert!(all > 100 && 20 * inside > 19 * all, "{inside} of {all}");
}

/// Runs along x and z: `ml` took the inertia from motion near the noise, ten of its standard deviations off, and was five to six off in the
/// centre of gravity (2.4 and 3.0 half intervals at these seeds). It steps back, in one test since the slope of the score
/// tells no error bars, in the other since the numbers rest on a guess that only such motion tells, and the band's hold.
#[test]
fn a_guess_that_only_motion_near_the_noise_tells_is_no_ground() {
    let runs = [(0, "r0"), (2, "r1")].map(|(axis, name)| one_run(axis).replace("only", name));
    for (seed, reason) in [
        (
            23,
            "the lines do not tell by how much that bends the numbers",
        ),
        (27, "only motion near the accelerometers' noise tells"),
    ] {
        let test = Test::of(&runs.concat(), seed, &[]);
        let fit = &test.result["likelihood"];
        assert_eq!(fit["used"], false, "seed {seed}: {fit}");
        assert!(fit.to_string().contains(reason), "seed {seed}: {fit}");
        for (name, error) in test.errors().into_iter().take(4) {
            let error = error.unwrap_or_else(|| panic!("seed {seed}: no {name}"));
            assert!(error.abs() < 1.0, "seed {seed}: {name} {error}");
        }
    }
}
