//! Symmetric systems in envelope storage: ordering, LDLᵀ factorisation, solution.
//!
//! A cross-section meshed with some twenty elements across has a narrow profile. There an envelope
//! factorisation costs about what a general sparse one does (the whole envelope fills anyway) and
//! needs no dependency.

use std::collections::VecDeque;

/// Numbers nodes by reverse Cuthill–McKee, so that neighbours get close numbers.
///
/// `groups` are lists of nodes that are all coupled with each other. Returns the position of each
/// node. O(coupled pairs).
pub(crate) fn reverse_cuthill_mckee(count: usize, groups: &[Vec<usize>]) -> Vec<usize> {
    let mut neighbours = vec![Vec::new(); count];
    for group in groups {
        for &a in group {
            neighbours[a].extend(group.iter().copied().filter(|&b| b != a));
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    let degree: Vec<usize> = neighbours.iter().map(Vec::len).collect();
    let mut order = Vec::with_capacity(count);
    let mut placed = vec![false; count];
    for seed in 0..count {
        if placed[seed] {
            continue;
        }
        let start = peripheral(seed, &neighbours, &degree);
        let mut queue = VecDeque::from([start]);
        placed[start] = true;
        while let Some(node) = queue.pop_front() {
            order.push(node);
            let mut next: Vec<usize> = neighbours[node]
                .iter()
                .copied()
                .filter(|&n| !placed[n])
                .collect();
            next.sort_unstable_by_key(|&n| (degree[n], n));
            for node in next {
                placed[node] = true;
                queue.push_back(node);
            }
        }
    }
    let mut position = vec![0; count];
    for (place, &node) in order.iter().rev().enumerate() {
        position[node] = place;
    }
    position
}

/// A node of about the greatest distance from the others of its component.
fn peripheral(seed: usize, neighbours: &[Vec<usize>], degree: &[usize]) -> usize {
    let (mut node, mut depth) = (seed, 0);
    loop {
        let mut level = vec![usize::MAX; neighbours.len()];
        level[node] = 0;
        let mut queue = VecDeque::from([node]);
        let mut last = node;
        while let Some(n) = queue.pop_front() {
            let farther = level[n] > level[last];
            if farther || (level[n] == level[last] && degree[n] < degree[last]) {
                last = n;
            }
            for &m in &neighbours[n] {
                if level[m] == usize::MAX {
                    level[m] = level[n] + 1;
                    queue.push_back(m);
                }
            }
        }
        if level[last] <= depth {
            return node;
        }
        depth = level[last];
        node = last;
    }
}

/// A symmetric matrix: each row's entries from its first non-zero to the diagonal.
#[derive(Debug, Clone, Default)]
pub(crate) struct Envelope {
    first: Vec<usize>,
    /// Where each row's entries begin, and where the last ends.
    start: Vec<usize>,
    values: Vec<f64>,
    factorised: bool,
}

/// A pivot vanished: the system is singular.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Singular;

impl Envelope {
    /// Zeros in the envelope that couples each group's equations.
    pub(crate) fn new<'a>(size: usize, groups: impl Iterator<Item = &'a [usize]>) -> Self {
        let mut first: Vec<usize> = (0..size).collect();
        for group in groups {
            let Some(&lowest) = group.iter().min() else {
                continue;
            };
            for &equation in group {
                first[equation] = first[equation].min(lowest);
            }
        }
        let mut start = vec![0];
        for (row, &column) in first.iter().enumerate() {
            start.push(start[row] + row + 1 - column);
        }
        Self {
            values: vec![0.0; start[size]],
            first,
            start,
            factorised: false,
        }
    }

    /// Adds to the entry (i, j) and so to (j, i).
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        let (row, column) = if i >= j { (i, j) } else { (j, i) };
        self.values[self.start[row] + column - self.first[row]] += value;
    }

    /// Replaces the matrix by its factors L and D, in O(Σ row length²).
    ///
    /// Without pivoting: a stable equilibrium's tangent is positive definite; where it is not, the
    /// step that Newton's method then takes is judged by its residual.
    pub(crate) fn factorise(&mut self) -> Result<(), Singular> {
        let size = self.first.len();
        let largest = (0..size).fold(0.0_f64, |m, i| {
            m.max(self.values[self.start[i + 1] - 1].abs())
        });
        for i in 0..size {
            let (done, rest) = self.values.split_at_mut(self.start[i]);
            let row = &mut rest[..i + 1 - self.first[i]];
            let first_i = self.first[i];
            for j in first_i..i {
                let first = first_i.max(self.first[j]);
                let other = &done[self.start[j] + first - self.first[j]..self.start[j + 1] - 1];
                row[j - first_i] -= dot(&row[first - first_i..j - first_i], other);
            }
            let mut pivot = row[i - first_i];
            for j in first_i..i {
                let reduced = row[j - first_i];
                let scaled = reduced / done[self.start[j + 1] - 1];
                pivot -= reduced * scaled;
                row[j - first_i] = scaled;
            }
            // Rounding alone is left of a zero pivot after cancellation.
            if pivot.is_nan() || pivot.abs() <= 1e-15 * largest {
                return Err(Singular);
            }
            row[i - first_i] = pivot;
        }
        self.factorised = true;
        Ok(())
    }

    /// Solves in place with the factors.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        debug_assert!(self.factorised);
        let size = self.first.len();
        let row = |i: usize| &self.values[self.start[i]..self.start[i + 1] - 1];
        for i in 0..size {
            x[i] -= dot(row(i), &x[self.first[i]..i]);
        }
        for (value, end) in x.iter_mut().zip(&self.start[1..]) {
            *value /= self.values[end - 1];
        }
        for i in (0..size).rev() {
            let known = x[i];
            for (value, l) in x[self.first[i]..i].iter_mut().zip(row(i)) {
                *value -= l * known;
            }
        }
    }
}

/// Scalar product in eight partial sums, which compilers turn into vector instructions.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let length = a.len().min(b.len());
    let (a, b) = (&a[..length], &b[..length]);
    let (chunks_a, chunks_b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = (chunks_a.remainder().iter().zip(chunks_b.remainder()))
        .map(|(x, y)| x * y)
        .sum();
    let mut sums = [0.0; 8];
    for (x, y) in chunks_a.zip(chunks_b) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    rest + ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_an_indefinite_system_in_any_order() {
        let groups = [vec![0, 3], vec![3, 1], vec![1, 4], vec![4, 2]];
        let position = reverse_cuthill_mckee(5, &groups);
        let mapped: Vec<Vec<usize>> = groups
            .iter()
            .map(|g| g.iter().map(|&n| position[n]).collect())
            .collect();
        let mut matrix = Envelope::new(5, mapped.iter().map(Vec::as_slice));
        // A chain numbered by Cuthill–McKee is tridiagonal: five diagonals, four neighbours.
        assert_eq!(matrix.values.len(), 9);
        let mut dense = nalgebra::DMatrix::<f64>::zeros(5, 5);
        for (k, group) in mapped.iter().enumerate() {
            let (i, j) = (group[0], group[1]);
            for (r, c, v) in [(i, i, 3.0), (j, j, -2.0), (i, j, 0.5 + k as f64)] {
                matrix.add(r, c, v);
                dense[(r, c)] += v;
                if r != c {
                    dense[(c, r)] += v;
                }
            }
        }
        let truth = nalgebra::DVector::from_fn(5, |i, _| 1.0 + i as f64);
        let mut x: Vec<f64> = (&dense * &truth).iter().copied().collect();
        matrix.factorise().unwrap();
        matrix.solve(&mut x);
        for (found, expected) in x.iter().zip(&truth) {
            // Five unknowns of order one: some rounding units.
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn a_singular_system_is_reported() {
        let groups: [&[usize]; 1] = [&[0, 1]];
        let mut matrix = Envelope::new(2, groups.into_iter());
        for (i, j, v) in [(0, 0, 1.0), (0, 1, 1.0), (1, 1, 1.0)] {
            matrix.add(i, j, v);
        }
        assert_eq!(matrix.factorise(), Err(Singular));
    }
}
