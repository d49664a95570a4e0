//! The warp of given pairs: a thin-plate spline, or a simpler map if the pairs determine none.

use crate::error::usable;
use nalgebra::Point;
use tactile_tps::{
    Affine, Factorization, FitOptions, LocalField, NegR, R2LogR, Smoothing, TpsError, Warp,
};

/// The factorised thin-plate system of fixed sources: `r² ln r²` in the plane, `−r` in space.
#[derive(Clone, Debug)]
enum System<const D: usize> {
    Plane(Box<Factorization<D, R2LogR>>),
    Space(Box<Factorization<D, NegR>>),
}

/// Interpolates from one set of sources to any images of it. The system is factorised once.
#[derive(Clone, Debug)]
pub(crate) struct Interpolation<const D: usize> {
    /// `None` if the sources determine no spline.
    system: Option<System<D>>,
    weights: Option<Vec<f64>>,
    smoothing: Smoothing,
}

impl<const D: usize> Interpolation<D> {
    pub(crate) fn new(
        sources: &[Point<f64, D>],
        weights: Option<Vec<f64>>,
        smoothing: Smoothing,
    ) -> Self {
        fn options<K>(
            kernel: K,
            smoothing: Smoothing,
            weights: &Option<Vec<f64>>,
        ) -> Result<FitOptions<K>, TpsError> {
            let options = FitOptions::new(kernel).with_smoothing(smoothing)?;
            match weights {
                Some(weights) => options.with_weights(weights.clone()),
                None => Ok(options),
            }
        }
        let system = if D == 2 {
            let plane = options(R2LogR, smoothing, &weights)
                .and_then(|options| Factorization::new(sources, &options));
            plane.ok().map(|plane| System::Plane(Box::new(plane)))
        } else {
            let space = options(NegR, smoothing, &weights)
                .and_then(|options| Factorization::new(sources, &options));
            space.ok().map(|space| System::Space(Box::new(space)))
        };
        Self {
            system,
            weights,
            smoothing,
        }
    }

    /// The spline through these pairs. It becomes an affine map if the pairs determine no spline,
    /// and the identity if there are no pairs.
    pub(crate) fn through(
        &self,
        sources: &[Point<f64, D>],
        images: &[Point<f64, D>],
    ) -> Box<dyn Warp<D> + Send + Sync> {
        let spline: Option<Box<dyn Warp<D> + Send + Sync>> = match &self.system {
            Some(System::Plane(plane)) => {
                plane.fit(images).ok().map(|spline| Box::new(spline) as _)
            }
            Some(System::Space(space)) => {
                space.fit(images).ok().map(|spline| Box::new(spline) as _)
            }
            None => None,
        };
        let exact = self.smoothing == Smoothing::None;
        let share = if exact { 1e-3 } else { f64::INFINITY };
        spline
            .filter(|spline| follows(&**spline, sources, images, share))
            .unwrap_or_else(|| {
                let affine = Affine::fit(sources, images, self.weights.as_deref());
                Box::new(affine.unwrap_or_else(|_| Affine::default()))
            })
    }
}

/// Fewer pairs show no more than an affine map.
const FIELD: usize = 16;

/// The warp of pairs (model row, target row, confidence) and the warped model. The warp is the local
/// field of the pairs that are more likely right than wrong, an affine map for few pairs, a rigid
/// motion for fewer, the identity for none.
pub(crate) fn fitted<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    pairs: &[(usize, usize, f64)],
) -> (Box<dyn Warp<D> + Send + Sync>, Vec<Point<f64, D>>) {
    let ends = |&(i, j, _): &(usize, usize, f64)| (model[i], target[j]);
    let sure: Vec<_> = pairs.iter().filter(|pair| pair.2 >= 0.5).collect();
    if sure.len() >= FIELD {
        let (sources, images): (Vec<_>, Vec<_>) = sure.iter().map(|pair| ends(pair)).unzip();
        if let Ok(field) = LocalField::fit(&sources, &images) {
            // The fit holds the displacements of its own pairs.
            let (mut warped, mut left) = (model.to_vec(), vec![true; model.len()]);
            for (pair, at) in sure.iter().zip(&field.values) {
                warped[pair.0] += at.displacement;
                left[pair.0] = false;
            }
            let left: Vec<_> = (0..model.len()).filter(|&i| left[i]).collect();
            let places: Vec<_> = left.iter().map(|&i| model[i]).collect();
            for (&i, at) in left.iter().zip(field.at(&places)) {
                warped[i] += at.displacement;
            }
            if are_usable(&warped) {
                return (Box::new(field), warped);
            }
        }
    }
    let (sources, images): (Vec<_>, Vec<_>) = pairs.iter().map(ends).unzip();
    // A confidence of zero would remove the pair from the fit.
    let weights: Vec<f64> = pairs.iter().map(|pair| pair.2.max(1e-3)).collect();
    let fit = if sources.len() > D {
        Affine::fit
    } else {
        Affine::fit_rigid
    };
    affine(
        model,
        fit(&sources, &images, Some(&weights)).unwrap_or_default(),
    )
}

/// The warped model. `None` if a coordinate is too large to be squared.
fn finite<const D: usize>(
    warp: &dyn Warp<D>,
    model: &[Point<f64, D>],
) -> Option<Vec<Point<f64, D>>> {
    let mut warped = model.to_vec();
    warp.apply_into(model, &mut warped).ok()?;
    are_usable(&warped).then_some(warped)
}

fn are_usable<const D: usize>(points: &[Point<f64, D>]) -> bool {
    points.iter().all(|p| p.iter().all(|&c| usable(c)))
}

/// An affine map and the warped model, or the identity if that cannot be squared.
fn affine<const D: usize>(
    model: &[Point<f64, D>],
    affine: Affine<D>,
) -> (Box<dyn Warp<D> + Send + Sync>, Vec<Point<f64, D>>) {
    match finite(&affine, model) {
        Some(warped) => (Box::new(affine), warped),
        None => (Box::new(Affine::default()), model.to_vec()),
    }
}

/// The thin-plate spline through these pairs. See [`Interpolation`].
pub(crate) fn spline<const D: usize>(
    sources: &[Point<f64, D>],
    images: &[Point<f64, D>],
    weights: Option<Vec<f64>>,
    smoothing: Smoothing,
) -> Box<dyn Warp<D> + Send + Sync> {
    Interpolation::new(sources, weights, smoothing).through(sources, images)
}

/// The spline through these pairs and the images of the model under it. If an image is too large to
/// be squared, the affine map takes the spline's place, or no map at all.
pub(crate) fn through<const D: usize>(
    model: &[Point<f64, D>],
    sources: &[Point<f64, D>],
    images: &[Point<f64, D>],
    smoothing: Smoothing,
) -> (Box<dyn Warp<D> + Send + Sync>, Vec<Point<f64, D>>) {
    let spline = spline(sources, images, None, smoothing);
    match finite(&*spline, model) {
        Some(warped) => (spline, warped),
        None => affine(
            model,
            Affine::fit(sources, images, None).unwrap_or_default(),
        ),
    }
}

/// Whether a warp maps the sources to these images, relative to their size. A spline loses all
/// digits if sources nearly coincide and their images do not.
pub(crate) fn follows<const D: usize>(
    warp: &(dyn Warp<D> + Send + Sync),
    sources: &[Point<f64, D>],
    images: &[Point<f64, D>],
    share: f64,
) -> bool {
    let size = images.iter().fold(0.0_f64, |m, p| m.max(p.coords.amax()));
    // All points in one call, since a spline evaluates several points at a time.
    let mut found = sources.to_vec();
    warp.apply_into(sources, &mut found).is_ok()
        && found.iter().zip(images).all(|(found, image)| {
            let miss = (found - image).amax();
            miss.is_finite() && (share.is_infinite() || miss <= size * share)
        })
}
