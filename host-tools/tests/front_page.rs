//! The first page of the project shows what the command prints now, and its picture.
//!
//! `MASSLINE_ACCEPT=1 cargo test --release -p massline --test front_page` writes both afresh.

use massline::report::plot::{Axis, Extent, LineChart, Mapping, Mark, Rule, Series, Tone};
use massline::study::{self, Document, Options};
use roxmltree::Node;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

const AGAIN: &str = "MASSLINE_ACCEPT=1 cargo test --release -p massline --test front_page";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

struct Demo {
    output: String,
    report: String,
    /// Error bars of what can be known: by all lines, and by the band.
    error_bars: [Vec<f64>; 2],
}

static DEMO: LazyLock<Demo> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let massline = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_massline"))
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    let output = massline(&["demo", "--quiet"]);
    let error_bars = ["ml", "apparent-mass"].map(|method| {
        let result = ["identify", "--quiet", "--json", "--method", method];
        let result = massline(&[&result[..], &["demo/setup.toml"]].concat());
        let result: Value = serde_json::from_str(&result).unwrap();
        let inertia = ["inertia_reference", "inertia_cg"].map(|of| &result[of]["yy"]);
        let cg = result["centre_of_gravity"].as_array().unwrap();
        let all = [&result["indicator"]].into_iter().chain(cg).chain(inertia);
        all.filter_map(|number| number["std"].as_f64()).collect()
    });
    Demo {
        output,
        report: std::fs::read_to_string(folder.path().join("demo/report.html")).unwrap(),
        error_bars,
    }
});

/// Compares with a file, or writes it.
fn agree(path: &Path, now: &str) {
    if std::env::var_os("MASSLINE_ACCEPT").is_some_and(|value| value == "1") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        // Another test reads the page meanwhile.
        if std::fs::read_to_string(path).is_ok_and(|kept| kept != now) || !path.exists() {
            std::fs::write(path, now).unwrap();
        }
        return;
    }
    let kept = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        kept == now,
        "{} is not what comes out now; look at the difference after\n  {AGAIN}",
        path.display()
    );
}

#[test]
fn the_table_is_what_the_demo_prints() {
    let path = root().join("README.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let start = "$ cargo run --release -p massline -- demo\n";
    let from = page.find(start).unwrap() + start.len();
    let to = from + page[from..].find("```").unwrap();
    agree(
        &path,
        &format!("{}{}{}", &page[..from], DEMO.output, &page[to..]),
    );
}

/// The page says how much wider the error bars of the band are; the mass is weighed, and has none.
#[test]
fn the_band_is_as_much_wider_as_the_page_says() {
    let [all, band] = &DEMO.error_bars;
    assert_eq!(all.len(), band.len());
    let ratios = band.iter().zip(all).map(|(band, all)| band / all);
    let (least, most) = ratios.fold((f64::MAX, 0.0), |(least, most): (f64, f64), ratio| {
        (least.min(ratio), most.max(ratio))
    });
    let page = std::fs::read_to_string(root().join("README.md")).unwrap();
    let said = format!("the error bars are {least:.1} to {most:.1} times as wide");
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(page.contains(&said), "{said}");
}

/// The chart of the report whose description begins like this.
fn chart(report: &str, description: &str) -> String {
    let html = report.split_once('\n').unwrap().1;
    let page = roxmltree::Document::parse(html).unwrap();
    let wanted = |n: &Node<'_, '_>| {
        n.has_tag_name(("http://www.w3.org/2000/svg", "svg"))
            && n.attribute("aria-label")
                .is_some_and(|label| label.starts_with(description))
    };
    let found = page.descendants().find(wanted);
    html[found
        .unwrap_or_else(|| panic!("no chart {description}"))
        .range()]
    .to_owned()
}

/// Place of no noise on a logarithmic axis, per cent.
const NONE: f64 = 0.03;

/// Errors over noise of one row a method, all four numbers together.
fn errors() -> String {
    // Enough for a logarithmic axis: six draws tell a root mean square within a third; two, with four
    // numbers each, do so for the fit, whose errors are those of noise alone.
    let options = Options {
        draws: 6,
        fits: Some(2),
        ..Options::default()
    };
    let study = study::run(&options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"));
    let document = serde_json::to_value(Document::new(&study)).unwrap();
    let overall = |percent: &Value| {
        let square = |name| percent[name].as_f64().unwrap().powi(2);
        (["x", "z", "theta_a", "theta_s"]
            .map(square)
            .iter()
            .sum::<f64>()
            / 4.0)
            .sqrt()
    };
    let levels = document["noise"].as_array().unwrap();
    let series = [
        ("a", "a", Tone::Colour(5)),
        ("b-cholesky", "b Cholesky", Tone::Colour(3)),
        ("c", "c", Tone::Colour(1)),
        ("d", "d", Tone::Colour(4)),
        ("e", "e", Tone::Colour(2)),
        ("apparent-mass", "apparent mass", Tone::Fit),
    ];
    let mut series: Vec<Series> = series
        .into_iter()
        .map(|(method, name, tone)| {
            let points = levels.iter().filter_map(|level| {
                let noise = 100.0 * level["noise"].as_f64().unwrap();
                let rows = level["rows"].as_array().unwrap();
                let mut rows = rows.iter().filter(|r| r["method"] == method);
                // Weighted in range I, where a method knows the two.
                let row = rows.find(|r| {
                    (r["range"] == "I" || r["range"].is_null())
                        && (r["weighted"] == true || method == "apparent-mass")
                })?;
                Some([
                    if noise > 0.0 { noise } else { NONE },
                    overall(&row["direct"]["rms_percent"]),
                ])
            });
            Series::new(name, tone, Mark::Knots, points.collect()).labelled()
        })
        .collect();
    let fits = |percent: &dyn Fn(&Value) -> Value| -> Vec<[f64; 2]> {
        let fitted = levels.iter().filter(|level| !level["likelihood"].is_null());
        let of = |level: &Value| {
            let noise = 100.0 * level["noise"].as_f64().unwrap();
            [noise, overall(&percent(&level["likelihood"]))]
        };
        fitted.map(of).collect()
    };
    assert!(series.iter().all(|s| s.points.len() == levels.len()));
    series.push(
        Series::new(
            "maximum likelihood",
            Tone::Measured,
            Mark::Knots,
            fits(&|fit| fit["direct"]["rms_percent"].clone()),
        )
        .labelled(),
    );
    series.push(
        Series::new(
            "Cramér-Rao bound",
            Tone::Measured,
            Mark::Dashed,
            fits(&|fit| fit["bound_percent"].clone()),
        )
        .labelled(),
    );
    let values = series.iter().flat_map(|s| &s.points).map(|p| p[1]);
    let domain = Extent::of(Mapping::Log, values).domain(0.06);
    let mut chart = LineChart::panel(
        "Error of CG and inertia",
        Axis::new("noise of every sensor, %", Mapping::Log, [0.025, 3.6]),
        Axis::new("root mean square, %", Mapping::Log, domain),
    );
    chart.series = series;
    chart.rules.push(Rule::Vertical {
        x: NONE,
        label: "none".to_owned(),
        tone: Tone::Muted,
    });
    chart.size = [400.0, 240.0];
    chart.svg()
}

/// Charts side by side, with the part of the report's style that is about drawings.
fn figure(charts: &[(String, [f64; 2])]) -> String {
    let style = include_str!("../src/report/style.css");
    let colours = &style[..style.find("@media print").unwrap()];
    let drawings = &style[style.find("svg text {").unwrap()..style.find("\n.cell {").unwrap()];
    let gap = 28.0;
    let width = charts.iter().map(|(_, size)| size[0] + gap).sum::<f64>() + gap;
    let height = charts.iter().map(|(_, s)| s[1]).fold(0.0, f64::max) + gap;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"system-ui, Roboto, 'Noto Sans', Arial, sans-serif\">\n<style>\n{colours}\
         {drawings}</style>\n<rect width=\"100%\" height=\"100%\" rx=\"6\" style=\"fill: var(--paper)\"/>\n"
    );
    let mut x = gap;
    for (chart, size) in charts {
        let at = format!(
            "<svg x=\"{x}\" y=\"{}\" width=\"{}\" height=\"{}\" ",
            gap / 2.0,
            size[0],
            size[1]
        );
        let _ = writeln!(svg, "{}", chart.replacen("<svg ", &at, 1));
        x += size[0] + gap;
    }
    svg + "</svg>\n"
}

#[test]
fn the_picture_is_what_demo_and_study_draw() {
    let moment = chart(&DEMO.report, "Θyy");
    let now = figure(&[(moment, [403.0, 240.0]), (errors(), [400.0, 240.0])]);
    roxmltree::Document::parse(&now).unwrap();
    agree(&root().join("host-tools/figures/front-page.svg"), &now);
}
