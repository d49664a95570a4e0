//! Two classes of pixels, and the connected regions of one of them.

/// Otsu's threshold: it divides a histogram into two classes with the least variance, and lies half
/// way between their means. `None` if there is only one class.
///
/// ```
/// // Dark pixels of level 10 and bright pixels of level 90.
/// let mut histogram = [0.0; 256];
/// (histogram[10], histogram[90]) = (700.0, 300.0);
/// assert_eq!(tactile_core::otsu(&histogram, |k| k as f64), Some(50.0));
/// ```
pub fn otsu(histogram: &[f64], level: impl Fn(usize) -> f64) -> Option<f64> {
    let total: f64 = histogram.iter().sum();
    let products = histogram.iter().enumerate().map(|(k, n)| n * level(k));
    let sum: f64 = products.sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, None::<(f64, f64)>);
    for (k, n) in histogram.iter().enumerate() {
        below += n;
        sum_below += n * level(k);
        if below > 0.0 && below < total {
            let [low, high] = [sum_below / below, (sum - sum_below) / (total - below)];
            let between = below * (total - below) * (high - low).powi(2);
            if best.is_none_or(|best| between > best.0) {
                best = Some((between, 0.5 * (low + high)));
            }
        }
    }
    best.map(|(_, cut)| cut)
}

/// Regions of the pixels in `inside` (row by row) that are connected by their sides, each as the
/// indices of its pixels, in reading order of the first pixel. The pixels of a returned region are
/// removed from `inside`. O(pixels).
///
/// ```
/// // The last two pixels of the second row touch those of the first row only by a corner.
/// let mut inside = [true, false, false, false, true, true];
/// let found: Vec<_> = tactile_core::regions(&mut inside, 3).collect();
/// assert_eq!(found, [vec![0], vec![4, 5]]);
/// ```
pub fn regions(inside: &mut [bool], columns: usize) -> impl Iterator<Item = Vec<usize>> {
    let mut starts = 0..inside.len();
    std::iter::from_fn(move || {
        let start = starts.find(|&at| std::mem::take(&mut inside[at]))?;
        let (mut region, mut next) = (vec![start], 0);
        while let Some(&at) = region.get(next) {
            next += 1;
            let column = at % columns;
            let beside = [
                (column > 0).then(|| at - 1),
                (column + 1 < columns).then_some(at + 1),
                at.checked_sub(columns),
                Some(at + columns),
            ];
            for at in beside.into_iter().flatten() {
                if inside.get_mut(at).is_some_and(std::mem::take) {
                    region.push(at);
                }
            }
        }
        Some(region)
    })
}
