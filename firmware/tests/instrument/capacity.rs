//! The instrument at its capacity: as many runs and lines as there is room for.

use crate::bench::{Bench, Said};
use crate::plan::Pieces;
use massline_firmware::capacity::{LINES, RUNS};
use massline_firmware::models::setup::question;
use massline_firmware::wire::*;

#[test]
fn every_run_has_all_its_lines_and_a_part_in_the_answer() {
    let mut bench = Bench::switch_on();
    let mut pieces = Pieces::new();
    pieces.plan.runs = RUNS as u8;
    // Lines are 0.5 Hz apart. The body is shaken by noise that is periodic in a block.
    pieces.processing = Processing {
        kept_band: [0.5, 0.5 * LINES as f64],
        averaging_band: [1.0, 20.0],
        window: Window::Rectangular,
        ..pieces.processing
    };
    pieces.send(&mut bench);
    let Said::Grid(grid) = bench.ask(&Request::EndSetup) else {
        panic!("the set-up was refused");
    };
    assert_eq!((grid.lines.first, grid.lines.count), (1, LINES));
    for run in 0..RUNS as u8 {
        bench.start(run, Source::Synthetic, Gaps::Count, Some(4000));
        bench.work();
    }
    assert_eq!(bench.status().stored, (1 << RUNS) - 1);
    let all: Vec<Vec<Line>> = (0..RUNS as u8).map(|run| bench.lines(run)).collect();
    for (run, lines) in all.iter().enumerate() {
        assert_eq!(lines.len(), LINES, "run {run}");
        let is_there = |line: &Line| line.drive > 0.0 && line.responses != [[0.0; 2]; 12];
        assert!(lines.iter().all(is_there), "run {run}");
        // The body is shaken in another way, or is the same as six runs before.
        for (before, others) in all[..run].iter().enumerate() {
            assert_eq!(lines == others, (run - before) % 6 == 0, "{run} {before}");
        }
    }
    let answer = bench
        .identify(question(Method::ApparentMass, Procedure::Direct, 1))
        .answer;
    assert_eq!(answer.question.runs, (1 << RUNS) - 1);
    let mass = answer.identification.mass.expect("it is observable").value;
    // Body, sensors, block and band are the self-test's, and so is the bound of the mass:
    // 1.7 of 6.7e-5 of the 1.5 kg that swing, and 1e-6 of 12 kg for rounding.
    assert!((mass - 12.0).abs() <= 1.83e-4, "{mass}");
}
