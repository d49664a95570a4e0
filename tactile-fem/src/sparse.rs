//! Sparse symmetric systems: pattern, LDLᵀ factorisation, solution.
//!
//! The analysis (fill-reducing order, elimination tree, supernodes) is made once per pattern and
//! serves every matrix with this pattern.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use std::sync::Arc;

/// The system cannot be solved: a pivot vanished, or there is not enough memory for the factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Singular;

/// The sparsity pattern of a symmetric matrix, with its symbolic factorisation.
#[derive(Debug)]
pub(crate) struct Pattern {
    /// Lower half: rows of each column, ascending from the diagonal.
    entries: SymbolicSparseColMat<usize>,
    analysis: SymbolicCholesky<usize>,
}

impl Pattern {
    /// The pattern of `size` equations in which the equations of each group are coupled.
    pub(crate) fn new<'a>(
        size: usize,
        groups: impl Iterator<Item = &'a [usize]>,
    ) -> Result<Self, Singular> {
        let mut columns: Vec<Vec<usize>> = (0..size).map(|diagonal| vec![diagonal]).collect();
        for group in groups {
            for &column in group {
                columns[column].extend(group.iter().filter(|&&row| row > column));
            }
        }
        let mut starts = vec![0];
        let mut rows = Vec::new();
        for column in &mut columns {
            column.sort_unstable();
            column.dedup();
            rows.append(column);
            starts.push(rows.len());
        }
        let entries = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        let analysis = factorize_symbolic_cholesky(
            entries.as_ref(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams {
                // For meshes of a few hundred elements, block factorisation already takes half the
                // time.
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..Default::default()
            },
        );
        Ok(Self {
            analysis: analysis.map_err(|_| Singular)?,
            entries,
        })
    }

    /// Index of the entry (i, j), which is also that of (j, i).
    pub(crate) fn place(&self, i: usize, j: usize) -> Option<usize> {
        let (row, column) = (i.max(j), i.min(j));
        let range = self.entries.col_range(column);
        let rows = &self.entries.row_idx()[range.clone()];
        rows.binary_search(&row).ok().map(|at| range.start + at)
    }

    /// Whether the pattern couples all equations of a group.
    pub(crate) fn couples(&self, group: &[usize]) -> bool {
        let mut pairs =
            (group.iter().enumerate()).flat_map(|(k, &i)| group[..k].iter().map(move |&j| (i, j)));
        pairs.all(|(i, j)| self.place(i, j).is_some())
    }
}

/// A symmetric matrix.
#[derive(Debug, Clone)]
pub(crate) struct Symmetric {
    pattern: Arc<Pattern>,
    values: Vec<f64>,
}

impl Symmetric {
    pub(crate) fn zero(pattern: Arc<Pattern>) -> Self {
        Self {
            values: vec![0.0; pattern.entries.row_idx().len()],
            pattern,
        }
    }

    /// Adds to the entry (i, j), and so to (j, i). The pattern must contain it.
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        let place = self.pattern.place(i, j);
        debug_assert!(place.is_some(), "no entry ({i}, {j})");
        if let Some(place) = place {
            self.values[place] += value;
        }
    }

    /// Adds to the entry with this index in the pattern.
    pub(crate) fn add_at(&mut self, place: usize, value: f64) {
        self.values[place] += value;
    }

    /// LDLᵀ factors.
    ///
    /// There is no pivoting: the tangent of a stable equilibrium is positive definite. Otherwise
    /// the resulting Newton step is judged by its residual.
    pub(crate) fn factorise(&self) -> Result<Factors, Singular> {
        let analysis = &self.pattern.analysis;
        let mut values = vec![0.0; analysis.len_val()];
        let scratch = analysis.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| Singular)?;
        let factorised = analysis.factorize_numeric_ldlt(
            &mut values,
            SparseColMatRef::new(self.pattern.entries.as_ref(), &self.values),
            Side::Lower,
            LdltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        factorised.map_err(|_| Singular)?;
        Ok(Factors {
            pattern: Arc::clone(&self.pattern),
            values,
        })
    }
}

/// LDLᵀ factors of a [`Symmetric`] matrix.
#[derive(Debug)]
pub(crate) struct Factors {
    pattern: Arc<Pattern>,
    values: Vec<f64>,
}

impl Factors {
    /// Solves in place for consecutive right-hand sides in `x`.
    pub(crate) fn solve(&self, x: &mut [f64]) -> Result<(), Singular> {
        let analysis = &self.pattern.analysis;
        let size = analysis.nrows();
        let count = x.len().checked_div(size).unwrap_or(0);
        let scratch = analysis.solve_in_place_scratch::<f64>(count, Par::Seq);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| Singular)?;
        LdltRef::<'_, usize, f64>::new(analysis, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(x, size, count),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        // A pivot at rounding level passes the factorisation and is detected here.
        if x.iter().all(|value| value.is_finite()) {
            Ok(())
        } else {
            Err(Singular)
        }
    }
}
