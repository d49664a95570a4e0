//! Coordinates kept as one padded array an axis.

/// One array an axis, each padded with zeros to whole vectors.
#[derive(Clone, Debug)]
pub(crate) struct Axes<const D: usize>(pub(crate) [Vec<f64>; D]);

impl<const D: usize> Default for Axes<D> {
    fn default() -> Self {
        Self(std::array::from_fn(|_| Vec::new()))
    }
}

impl<const D: usize> Axes<D> {
    /// Takes `rows`, padded to `stride`.
    pub(crate) fn fill(&mut self, stride: usize, rows: impl Iterator<Item = [f64; D]>) {
        self.0.iter_mut().for_each(Vec::clear);
        for row in rows {
            self.0
                .iter_mut()
                .zip(row)
                .for_each(|(axis, value)| axis.push(value));
        }
        self.0.iter_mut().for_each(|axis| axis.resize(stride, 0.0));
    }
}
