//! The linear system of a spline for given weights and λ, factored.

use crate::{
    Kernel, TpsError,
    centres::Centres,
    cholesky::Cholesky,
    layout::{HEAD, layout},
    null_space::{MAX, NullSpace},
    real::Lane,
    simd::{Job, dispatch},
    span::Span,
    spectrum::Spectrum,
    symmetric::Product,
};

/// Points up to which double-double arithmetic is affordable.
pub(crate) const PRECISE_POINTS: usize = 400;

/// The inputs of a system.
pub(crate) struct Setting<'a, K, const D: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) centres: &'a Centres<D>,
    /// Share of the largest extent below which a direction counts as not spanned.
    pub(crate) rank_tolerance: f64,
}

/// QᵀSQ, S = W^½ K W^½ + λI over the centres of positive weight, ready to be solved with.
///
/// With v = W^{-½}w the equations K w + λ W⁻¹ w + P a = y, Pᵀw = 0 become S v + W^½P a = W^½y, (W^½P)ᵀv = 0: row
/// scaling that keeps weights over many decades apart.
#[derive(Clone, Debug, Default)]
pub(crate) struct System<const D: usize> {
    /// λ in the frame's units; what a spectral system adds is given at the solve.
    pub(crate) lambda: f64,
    /// Centres of positive weight.
    pub(crate) active: Vec<usize>,
    /// √weight of each; empty if all are one.
    pub(crate) scales: Vec<f64>,
    pub(crate) span: Span<D>,
    pub(crate) null: NullSpace,
    /// QᵀSQ: first q columns as they are, the rest factored unless there is a spectrum.
    pub(crate) cholesky: Cholesky,
    pub(crate) spectrum: Option<Spectrum>,
    condition: f64,
    /// Rounding left an indefinite matrix: the factor cannot be used.
    pub(crate) indefinite: bool,
    scratch: Vec<f64>,
    spare: NullSpace,
}

impl<const D: usize> System<D> {
    /// Factors for centre weights (empty: all one) and λ ≥ 0: n³/3 multiplications and additions.
    pub(crate) fn factor<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        lambda: f64,
    ) -> Result<(), TpsError> {
        self.lambda = lambda;
        self.spectrum = None;
        let size = self.assemble(setting, weights, lambda > 0.0);
        let (n, q, stride) = (self.active.len(), self.null.q, self.null.stride);
        let Self {
            cholesky, scratch, ..
        } = self;
        (HEAD..HEAD + n - q).for_each(|j| cholesky.l[j * stride + j] += lambda);
        let factored = cholesky.factor();
        self.indefinite = factored.is_err();
        if let Err(column) = factored {
            self.condition = f64::INFINITY;
            return if n <= PRECISE_POINTS {
                Ok(())
            } else {
                Err(TpsError::NotDefinite { column })
            };
        }
        let inverse = if n > q {
            cholesky.inverse_norm(scratch)
        } else {
            0.0
        };
        self.condition = f64::max(1.0, (size + lambda) * inverse);
        Ok(())
    }

    /// Decomposes for centre weights and any λ > 0: some 10 n³ operations.
    pub(crate) fn decompose<K: Kernel>(&mut self, setting: &Setting<'_, K, D>, weights: &[f64]) {
        self.lambda = 0.0;
        self.assemble(setting, weights, true);
        self.indefinite = false;
        let m = self.active.len() - self.null.q;
        self.spectrum = Some(Spectrum::new(&self.cholesky.l, m, self.null.stride));
    }

    /// Condition number of QᵀSQ with `lambda` added to a spectral system.
    pub(crate) fn condition(&self, lambda: f64) -> f64 {
        self.spectrum
            .as_ref()
            .map_or(self.condition, |spectrum| spectrum.condition(lambda))
    }

    /// Writes the lower triangle of QᵀSQ without λ; returns its Frobenius norm.
    pub(crate) fn assemble<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        scaled: bool,
    ) -> f64 {
        let centres = setting.centres;
        self.choose(centres.len(), weights, scaled);
        self.outline(setting);
        let (n, q, stride) = (self.active.len(), self.null.q, self.null.stride);
        let Self {
            active,
            scales,
            null,
            cholesky,
            scratch,
            ..
        } = self;
        cholesky.prepare(n - q, stride);
        scratch.clear();
        scratch.resize((MAX + D + 1) * stride, 0.0);
        let (product, places) = scratch.split_at_mut(MAX * stride);
        gather(centres, active, scales, null.rows(), places);
        dispatch(Assemble::<_, D> {
            kernel: setting.kernel,
            places,
            null,
            matrix: &mut cholesky.l,
            product,
        });
        null.project(&mut cholesky.l, product)
    }

    /// Finds what the active centres span and its complement.
    pub(crate) fn outline<K>(&mut self, setting: &Setting<'_, K, D>) {
        let centres = setting.centres;
        self.span = Span::new(
            centres,
            &self.active,
            setting.rank_tolerance,
            &mut self.spare,
        );
        let n = self.active.len();
        let q = n.min(1 + self.span.directions);
        let Self {
            active,
            scales,
            span,
            null,
            ..
        } = self;
        null.factor(n, q, layout(n, q), |c, column| {
            span.fill(centres, active, scales, c, column)
        });
    }

    /// The coordinates of the active centres, axis by axis, and their scales.
    pub(crate) fn places(&self, centres: &Centres<D>, places: &mut [f64]) {
        let rows = 0..self.active.len();
        gather(centres, &self.active, &self.scales, rows, places);
    }

    /// Centres of positive weight, heaviest first so that the reflectors keep light rows apart.
    pub(crate) fn choose(&mut self, n: usize, weights: &[f64], scaled: bool) {
        self.active.clear();
        self.scales.clear();
        if weights.is_empty() {
            self.active.extend(0..n);
            return;
        }
        self.active.extend((0..n).filter(|&i| weights[i] > 0.0));
        if scaled {
            self.active
                .sort_unstable_by(|&i, &j| weights[j].total_cmp(&weights[i]).then(i.cmp(&j)));
            self.scales
                .extend(self.active.iter().map(|&i| weights[i].sqrt()));
        }
    }
}

/// Coordinates of the active centres at their places, axis by axis, and their scales after them.
fn gather<const D: usize>(
    centres: &Centres<D>,
    active: &[usize],
    scales: &[f64],
    rows: core::ops::Range<usize>,
    places: &mut [f64],
) {
    let stride = places.len() / (D + 1);
    for (k, column) in places.chunks_exact_mut(stride).enumerate() {
        let column = &mut column[rows.clone()];
        if k < D {
            column
                .iter_mut()
                .zip(active)
                .for_each(|(x, &centre)| *x = centres.axes[k][centre]);
        } else if scales.is_empty() {
            column.fill(1.0);
        } else {
            column.copy_from_slice(scales);
        }
    }
}

/// Writes the lower triangle of W^½ K W^½, and its product with the reflectors while each column is at hand.
struct Assemble<'a, K, const D: usize> {
    kernel: &'a K,
    places: &'a [f64],
    null: &'a NullSpace,
    matrix: &'a mut [f64],
    product: &'a mut [f64],
}

impl<K: Kernel, const D: usize> Job<f64> for Assemble<'_, K, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let (stride, rows) = (self.null.stride, self.null.rows());
        for j in rows.clone() {
            let column = &mut self.matrix[j * stride..(j + 1) * stride];
            column[j / HEAD * HEAD..j].fill(0.0);
            let own: [L; D] = core::array::from_fn(|k| L::new(self.places[k * stride + j]));
            let own_scale = L::new(self.places[D * stride + j]);
            let axes: [&[f64]; D] =
                core::array::from_fn(|k| &self.places[k * stride + j..k * stride + rows.end]);
            let scales = &self.places[D * stride + j..D * stride + rows.end];
            for (i, value) in column[j..rows.end].iter_mut().enumerate() {
                let mut s = L::from_f64(0.0);
                for k in 0..D {
                    let d = L::new(axes[k][i]) - own[k];
                    s = d.mul_add(d, s);
                }
                *value = (self.kernel.jet(s).value * (L::new(scales[i]) * own_scale)).get();
            }
            Product {
                column,
                j,
                x: self.null.reflectors(),
                y: self.product,
            }
            .add();
        }
    }
}
