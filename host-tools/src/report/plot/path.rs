//! Data to path strings.
//!
//! Points arrive in pixels, `None` where a line breaks. Long lists are thinned to the
//! lowest and the highest of every unit of the drawing, which looks the same.

use super::svg::Number;
use std::fmt::Write;

/// Lists up to this long are drawn point by point.
const MOST_POINTS: usize = 600;
/// Pixels that share their extremes once a list is longer.
const COLUMN: f64 = 1.0;

/// A line through the points, broken at each `None`.
#[must_use]
pub fn line(points: &[Option<[f64; 2]>]) -> String {
    let mut data = String::new();
    for run in runs(points) {
        append(&mut data, &thinned(&run), 'M');
    }
    data
}

/// A closed area between an upper and a lower edge over common places; pieces where one
/// of them is missing are left out.
#[must_use]
pub fn area(upper: &[Option<[f64; 2]>], lower: &[Option<[f64; 2]>]) -> String {
    let both = |(u, l): (&Option<[f64; 2]>, &Option<[f64; 2]>)| Some((*u.as_ref()?, *l.as_ref()?));
    let pairs: Vec<_> = upper.iter().zip(lower).map(both).collect();
    let mut data = String::new();
    for run in pairs.split(Option::is_none).filter(|r| !r.is_empty()) {
        let upper: Vec<[f64; 2]> = run.iter().flatten().map(|(u, _)| *u).collect();
        let lower: Vec<[f64; 2]> = run.iter().flatten().map(|(_, l)| *l).collect();
        append(&mut data, &thinned(&upper), 'M');
        let mut back = thinned(&lower);
        back.reverse();
        append(&mut data, &back, 'L');
        data.push('Z');
    }
    data
}

/// Dots: lines of almost no length, which round caps turn into dots. One short path
/// instead of a thousand elements.
#[must_use]
pub fn dots(points: &[Option<[f64; 2]>]) -> String {
    let all: Vec<[f64; 2]> = points.iter().flatten().copied().collect();
    let mut data = String::new();
    for p in thinned(&all) {
        let _ = write!(data, "M{} {}h.01", Number(p[0]), Number(p[1]));
    }
    data
}

/// The pieces between breaks; points that are not finite break too.
fn runs(points: &[Option<[f64; 2]>]) -> Vec<Vec<[f64; 2]>> {
    let good = |p: &Option<[f64; 2]>| p.is_some_and(|p| p.iter().all(|x| x.is_finite()));
    points
        .split(|p| !good(p))
        .filter(|run| !run.is_empty())
        .map(|run| run.iter().flatten().copied().collect())
        .collect()
}

fn append(data: &mut String, points: &[[f64; 2]], first: char) {
    for (i, p) in points.iter().enumerate() {
        let command = if i == 0 { first } else { 'L' };
        let _ = write!(data, "{command}{} {}", Number(p[0]), Number(p[1]));
    }
}

/// Lowest and highest point of every column, in their order, and both ends of the list.
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let [first, .., last] = points else {
        return points.to_vec();
    };
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let column = |p: &[f64; 2]| libm::floor(p[0] / COLUMN);
    let mut kept = vec![*first];
    for chunk in points.chunk_by(|a, b| column(a) == column(b)) {
        let (mut low, mut high) = (0, 0);
        for (i, p) in chunk.iter().enumerate() {
            if p[1] < chunk[low][1] {
                low = i;
            }
            if p[1] > chunk[high][1] {
                high = i;
            }
        }
        kept.push(chunk[low.min(high)]);
        if low != high {
            kept.push(chunk[low.max(high)]);
        }
    }
    kept.push(*last);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_lifts_the_pen() {
        let points = [Some([0.0, 1.0]), Some([1.0, 2.0]), None, Some([3.0, 4.5])];
        assert_eq!(line(&points), "M0 1L1 2M3 4.5");
        assert_eq!(line(&[None, Some([f64::NAN, 1.0])]), "");
        assert_eq!(line(&[]), "");
    }

    #[test]
    fn an_area_goes_there_and_back() {
        let up = [Some([0.0, 1.0]), Some([1.0, 1.0]), None];
        let low = [Some([0.0, 3.0]), Some([1.0, 3.0]), Some([2.0, 3.0])];
        assert_eq!(area(&up, &low), "M0 1L1 1L1 3L0 3Z");
    }

    #[test]
    fn long_lists_keep_their_peaks() {
        let points: Vec<_> = (0..100_000)
            .map(|i| {
                let height = if i == 54_321 { 100.0 } else { 0.0 };
                Some([f64::from(i) * 0.003, height])
            })
            .collect();
        let data = line(&points);
        assert!(data.contains(" 100"), "the peak is gone");
        // 300 columns, at most two points of a dozen characters each.
        assert!(data.len() < 302 * 2 * 12);
        assert!(dots(&points).len() < 302 * 2 * 18);
    }
}
