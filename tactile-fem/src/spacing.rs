//! Lines of meshes: uniform, graded, and finest around a contact.

/// Lines with the midpoint of each interval between them.
pub(crate) fn with_middles(lines: &[f64]) -> Vec<f64> {
    let mut all = vec![lines[0]];
    for pair in lines.windows(2) {
        all.push(0.5 * (pair[0] + pair[1]));
        all.push(pair[1]);
    }
    all
}

/// Distance along a polyline relative to its length.
pub(crate) fn arc_fractions(points: &[[f64; 2]]) -> Vec<f64> {
    let mut lengths = vec![0.0];
    for pair in points.windows(2) {
        let step = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        lengths.push(lengths[lengths.len() - 1] + step);
    }
    let total = lengths[lengths.len() - 1];
    lengths.into_iter().map(|length| length / total).collect()
}

/// Lines from `start` to `end`: steps start at `first` and grow by `growth`, scaled to fit.
pub(crate) fn graded(start: f64, end: f64, first: f64, growth: f64) -> Vec<f64> {
    let length = (end - start).abs();
    // Steps that sum to the length: n from the geometric series, at least one.
    let count = if (growth - 1.0).abs() < 1e-9 {
        length / first
    } else {
        (1.0 + length / first * (growth - 1.0)).max(1.0).ln() / growth.ln()
    };
    let count = (count.round() as usize).max(1);
    let mut offsets = vec![0.0];
    let mut step = 1.0;
    for _ in 0..count {
        offsets.push(offsets[offsets.len() - 1] + step);
        step *= growth;
    }
    let total = offsets[count];
    let scaled = offsets
        .iter()
        .map(|offset| start + (end - start) * offset / total);
    let mut lines: Vec<f64> = scaled.collect();
    lines[count] = end;
    lines
}

/// Like [`graded`], with steps limited to about `largest`.
pub(crate) fn graded_up_to(
    start: f64,
    end: f64,
    first: f64,
    growth: f64,
    largest: f64,
) -> Vec<f64> {
    let length = (end - start).abs();
    let mut offsets = vec![0.0];
    let (mut step, mut reached) = (first, 0.0);
    while reached + 0.5 * step < length {
        reached += step;
        offsets.push(reached);
        step = (growth * step).min(largest);
    }
    let mut lines: Vec<f64> = (offsets.iter())
        .map(|offset| start + (end - start) * offset / reached)
        .collect();
    if let Some(last) = lines.last_mut() {
        *last = end;
    }
    lines
}

/// Lines that resolve a contact around the axis of any size from `inner` outwards: `count` uniform
/// steps up to `inner`, then steps growing by `growth` up to `largest`, until `end`.
pub(crate) fn contact_lines(
    inner: f64,
    count: usize,
    growth: f64,
    largest: f64,
    end: f64,
) -> Vec<f64> {
    let mut lines: Vec<f64> = (0..=count)
        .map(|k| inner * k as f64 / count as f64)
        .collect();
    grow(&mut lines, inner / count as f64, growth, largest, end);
    lines
}

/// Appends lines after the last up to `end`: each step is `growth` times the previous one, at most
/// `largest`.
pub(crate) fn grow(lines: &mut Vec<f64>, mut step: f64, growth: f64, largest: f64, end: f64) {
    loop {
        step = (step * growth).min(largest);
        let last = lines[lines.len() - 1];
        let left = end - last;
        // The last two steps share the remainder, which avoids a sliver.
        if left <= 1.5 * step {
            if left > 0.0 {
                lines.push(end);
            }
            return;
        }
        lines.push(last + step);
    }
}
