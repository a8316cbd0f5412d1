//! Frequency responses, and errors over noise.

use crate::report::page::panels;
use crate::report::plot::{Axis, Extent, LineChart, Mapping, Mark, Rule, Series, Tone, legend};
use crate::setup::Mount;
use crate::study::pattern::overall;
use crate::study::{Fits, NAMES, Numbers, Range, Row, Study};
use massline_core::masslines::Method;
use nalgebra::{Complex, DMatrix};

const LOADS: [Tone; 3] = [Tone::Colour(0), Tone::Colour(1), Tone::Colour(2)];
const INTERFACE: Tone = Tone::Colour(0);
const STRUCTURE: Tone = Tone::Colour(2);

/// Runs and the free system: what the methods see.
pub(super) fn responses(study: &Study) -> String {
    let mut html = String::from(
        "<p>Exact responses of the twin, all modes of its mesh included. Shaded are the \
         averaging ranges, I up to the dashed line; dotted lines are natural frequencies.</p>\
         <h3>Interface forces per base acceleration</h3>\
         <p class=\"small\">Resonances of the fixed system. Towards zero frequency each curve \
         becomes an entry of the rigid-body mass matrix.</p>",
    );
    let twin = &study.twin;
    let cells: Vec<(Tone, Mark, &str)> = twin
        .setup
        .load_cells
        .iter()
        .zip(LOADS)
        .map(|(cell, tone)| (tone, Mark::Line, cell.channel.as_str()))
        .collect();
    html.push_str(&legend(&cells));
    html.push_str(&panels(
        (0..twin.setup.runs.len()).map(|run| loads(study, run)),
    ));
    html.push_str("<h3>Accelerations per base acceleration</h3>");
    let sensors = [
        (INTERFACE, Mark::Line, "on the interface"),
        (STRUCTURE, Mark::Thin, "on the structure"),
    ];
    html.push_str(&legend(&sensors));
    html.push_str(&panels((0..twin.setup.runs.len()).map(|run| {
        let title = twin.setup.runs[run].name.clone();
        let amplitude = twin.motion(run).norm();
        let size = |sensor: usize, line: usize| {
            study.responses.runs[run][line][sensor].norm_sqr().sqrt() / amplitude
        };
        accelerations(
            study,
            title,
            "per unit of base acceleration",
            size,
            &twin.fixed,
        )
    })));
    if let Some(free) = study
        .responses
        .survey(twin)
        .ok()
        .and_then(|s| s.free_responses())
    {
        html.push_str(
            "<h3>Accelerations of the free system per unit interface force</h3>\
             <p class=\"small\">What methods c, d and e start from: the same runs, solved line \
             by line for the interface forces. The resonances are those of the free system.</p>",
        );
        html.push_str(&legend(&sensors));
        html.push_str(&panels((0..twin.setup.load_cells.len()).map(|cell| {
            let title = format!("per unit {}", twin.setup.load_cells[cell].channel);
            let size = |sensor: usize, line: usize| modulus(&free[line], sensor, cell);
            accelerations(study, title, "SI units", size, &twin.free)
        })));
    }
    html
}

fn modulus(line: &DMatrix<Complex<f64>>, sensor: usize, cell: usize) -> f64 {
    line.get((sensor, cell))
        .map_or(f64::NAN, |z| z.norm_sqr().sqrt())
}

/// The resultants of one run.
fn loads(study: &Study, run: usize) -> String {
    let twin = &study.twin;
    let first = twin.setup.accelerometers.len();
    let amplitude = twin.motion(run).norm();
    let cells = twin.setup.load_cells.iter().zip(LOADS).enumerate();
    let series: Vec<Series> = cells
        .map(|(i, (cell, tone))| {
            let size = |line: usize| {
                study.responses.runs[run][line][first + i].norm_sqr().sqrt() / amplitude
            };
            Series::new(&*cell.channel, tone, Mark::Line, points(study, size))
        })
        .collect();
    let title = twin.setup.runs[run].name.clone();
    chart(study, title, "N or N m per unit", series, &twin.fixed)
}

/// All accelerometers, `size(sensor, line)`.
fn accelerations(
    study: &Study,
    title: String,
    unit: &str,
    size: impl Fn(usize, usize) -> f64,
    natural: &[f64],
) -> String {
    let entries = &study.twin.setup.accelerometers;
    let drawn = |mount: Mount, tone: Tone, mark: Mark| {
        let of_kind = entries
            .iter()
            .enumerate()
            .filter(move |(_, a)| a.mount == mount);
        let size = &size;
        of_kind.map(move |(sensor, entry)| {
            let points = points(study, |line| size(sensor, line));
            Series::new(&*entry.channel, tone, mark, points)
        })
    };
    let mut series: Vec<Series> = drawn(Mount::Structure, STRUCTURE, Mark::Thin).collect();
    series.extend(drawn(Mount::Interface, INTERFACE, Mark::Line));
    chart(study, title, unit, series, natural)
}

fn points(study: &Study, size: impl Fn(usize) -> f64) -> Vec<[f64; 2]> {
    let frequencies = study.responses.frequencies.iter().enumerate();
    frequencies.map(|(line, f)| [*f, size(line)]).collect()
}

/// A response that is zero but for rounding lies this far below the largest.
const NOTHING: f64 = 1e-5;

fn chart(
    study: &Study,
    title: String,
    unit: &str,
    mut series: Vec<Series>,
    natural: &[f64],
) -> String {
    let top = study.responses.frequencies.last().copied().unwrap_or(1.0);
    let all = || series.iter().flat_map(|s| &s.points).map(|p| p[1]);
    let largest = all().fold(0.0, f64::max);
    let extent = Extent::of(Mapping::Log, all().filter(|v| *v > NOTHING * largest));
    let domain = extent.domain(0.05);
    series.retain(|s| s.points.iter().any(|p| p[1] > NOTHING * largest));
    let mut chart = LineChart::panel(
        title,
        Axis::linear("Hz", [0.0, top]),
        Axis::new(unit, Mapping::Log, domain),
    );
    let (one, two) = (study.range(Range::I), study.range(Range::II));
    chart.shade(two, "I, II");
    chart
        .rules
        .push(Rule::vertical(one[1], "", Tone::Identified));
    let inside = natural.iter().filter(|f| **f < top);
    chart
        .rules
        .extend(inside.map(|f| Rule::vertical(*f, "", Tone::Muted)));
    chart.series = series;
    chart.svg()
}

/// The methods in the plots of errors, in the order of the rows.
fn methods() -> Vec<Method> {
    let mut methods: Vec<Method> = Row::all().iter().map(|row| row.method).collect();
    methods.dedup();
    methods
}

/// The colour of a method in the plots of errors.
fn tone(method: Method) -> Tone {
    match method {
        Method::FrequencyResponses => Tone::Colour(5),
        Method::PowerSpectra => Tone::Truth,
        Method::PowerSpectraCholesky => Tone::Colour(3),
        Method::FreeResponses => Tone::Colour(1),
        Method::CurveFit => Tone::Colour(4),
        Method::Synthesis => Tone::Colour(2),
        Method::FreeResponsesSquared => Tone::Muted,
        Method::ApparentMass => Tone::Fit,
        _ => Tone::Muted,
    }
}

/// Errors over noise for all methods, one panel a parameter, weighted where weights have a
/// place.
pub(super) fn noise(study: &Study) -> String {
    let names: Vec<(Method, &str)> = Row::all()
        .iter()
        .map(|row| (row.method, row.method_name()))
        .collect();
    let mut key: Vec<(Tone, Mark, &str)> = methods()
        .into_iter()
        .filter_map(|method| {
            let (_, name) = names.iter().find(|(m, _)| *m == method)?;
            Some((tone(method), Mark::Knots, *name))
        })
        .collect();
    if study.levels.iter().any(|level| level.fits.is_some()) {
        key.push((LIKELIHOOD, Mark::Knots, Fits::NAME));
        key.push((BOUND.0, BOUND.1, Fits::BOUND));
    }
    let mut html = String::new();
    for (range, heading) in [
        (Range::I, "Range I, weighted, direct"),
        (Range::II, "Range II, weighted, direct"),
    ] {
        html.push_str(&format!("<h3>{heading}</h3>"));
        html.push_str(&legend(&key));
        html.push_str(&panels((0..PANELS).map(|i| errors(study, range, i))));
    }
    html
}

/// One for each number, and one for the four that are results together.
const PANELS: usize = NAMES.len() + 1;

/// Colours of the fit through the resonances and of the least that any estimator can reach.
const LIKELIHOOD: Tone = Tone::Measured;
const BOUND: (Tone, Mark) = (Tone::Measured, Mark::Dashed);

/// Ratio of the abscissa of rows without noise to the least noise.
const ASIDE: f64 = 0.3;

fn errors(study: &Study, range: Range, parameter: usize) -> String {
    let levels: Vec<f64> = study.levels.iter().map(|l| 100.0 * l.noise).collect();
    let noisy = || levels.iter().copied().filter(|n| *n > 0.0);
    let least = noisy().fold(f64::INFINITY, f64::min);
    let aside = if least.is_finite() {
        ASIDE * least
    } else {
        0.1
    };
    let most = noisy().fold(aside, f64::max);
    let mut series = Vec::new();
    for method in methods() {
        let at = Row::all().iter().position(|row| {
            let here = row.range == range || row.range == Range::Fit;
            row.method == method && here && (row.weighted || method.interface_only())
        });
        let Some(at) = at else { continue };
        let rms = |level: usize| {
            let all = &study.levels[level].rows[at].direct.rms;
            all.get(parameter).copied().unwrap_or_else(|| overall(all))
        };
        let name = Row::all()[at].name();
        let (mut alone, mut along) = (Vec::new(), Vec::new());
        for (level, noise) in levels.iter().enumerate() {
            if *noise > 0.0 {
                along.push([*noise, rms(level)]);
            } else {
                alone.push([aside, rms(level)]);
            }
        }
        series.push(Series::new(name.clone(), tone(method), Mark::Points, alone));
        series.push(Series::new(name, tone(method), Mark::Knots, along));
    }
    let along = |of: &dyn Fn(&Fits) -> [f64; Numbers::COUNT]| -> Vec<[f64; 2]> {
        let fitted = study.levels.iter().zip(&levels);
        let fitted = fitted.filter_map(|(level, noise)| {
            let all = of(level.fits.as_ref()?);
            let one = all.get(parameter).copied();
            Some([*noise, one.unwrap_or_else(|| overall(&all))])
        });
        fitted.collect()
    };
    if study.levels.iter().any(|level| level.fits.is_some()) {
        let (fit, bound) = (along(&|f| f.fit.rms), along(&|f| f.bound));
        series.push(Series::new(Fits::BOUND, BOUND.0, BOUND.1, bound));
        series.push(Series::new(Fits::NAME, LIKELIHOOD, Mark::Knots, fit));
    }
    let values = series.iter().flat_map(|s| &s.points).map(|p| p[1]);
    let domain = Extent::of(Mapping::Log, values).domain(0.06);
    let mut chart = LineChart::panel(
        // A title in a drawing has no indices.
        ["x", "z", "Θ about A", "Θ about S", "Δ"]
            .get(parameter)
            .copied()
            .unwrap_or("x, z, Θ about A and S"),
        Axis::new("noise, %", Mapping::Log, [0.7 * aside, 1.3 * most]),
        Axis::new("error, %", Mapping::Log, domain),
    );
    chart
        .rules
        .push(Rule::vertical(aside, "no noise", Tone::Muted));
    chart.series = series;
    chart.svg()
}
