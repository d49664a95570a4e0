//! Small strain with large rotation, all scales, both precisions, folding, robustness, and no
//! allocation.

use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;
use tactile_elasticity::contact::{Body, HertzContact};
use tactile_elasticity::field::StrainField;
use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
use tactile_elasticity::strain::{
    Biot, Deformation, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use tactile_elasticity::{ElasticityError, Quantity};

fn measures() -> [&'static dyn StrainMeasure; 5] {
    [
        &GreenLagrange,
        &EulerAlmansi,
        &Hencky,
        &Biot,
        &Infinitesimal,
    ]
}

fn rotation() -> impl Strategy<Value = Matrix3<f64>> {
    prop::array::uniform3(-3.0..3.0f64)
        .prop_map(|a| Rotation3::from_scaled_axis(Vector3::from(a)).into_inner())
}

fn gradient(size: f64) -> impl Strategy<Value = Matrix3<f64>> {
    prop::array::uniform9(-size..size).prop_map(|a| Matrix3::from_row_slice(&a))
}

proptest! {
    /// A rotation of the whole body is no strain. F = Q(I + H) is rounded to 10⁻¹⁶, which is also
    /// the absolute error of the strain.
    #[test]
    fn rotations_do_not_strain(q in rotation(), h in gradient(0.2)) {
        let f = Matrix3::identity() + h;
        let [still, turned] = [f, q * f].map(Deformation::from_deformation_gradient);
        for measure in [&GreenLagrange as &dyn StrainMeasure, &Hencky, &Biot] {
            let gap = (measure.of(&still).unwrap() - measure.of(&turned).unwrap()).amax();
            prop_assert!(gap < 4e-15, "{} {gap:e}", measure.name());
        }
        // Euler–Almansi strain rotates with the body.
        let [still, turned] = [still, turned].map(|of| EulerAlmansi.of(&of).unwrap());
        prop_assert!((turned - q * still * q.transpose()).amax() < 1e-14);
    }

    /// All measures agree to first order, from strains of 10⁻⁹⁰.
    #[test]
    fn measures_agree_where_strain_is_tiny(h in gradient(1.0), exponent in -90i32..-9) {
        let scale = 10f64.powi(exponent);
        let h = h * scale;
        let linear = Infinitesimal.strain(&h).unwrap();
        for measure in measures() {
            // They differ by H², a fraction of the scale itself, and by rounding.
            let gap = (measure.strain(&h).unwrap() - linear).amax() / scale;
            prop_assert!(gap < 20.0 * scale + 1e-14, "{} {gap:e}", measure.name());
        }
    }

    /// tr ln U = ln J, and the product of the principal stretches is J.
    #[test]
    fn logarithms_add_up_to_the_volume(h in gradient(0.3)) {
        let d = Deformation::from_displacement_gradient(h);
        let hencky = Hencky.of(&d).unwrap();
        prop_assert!((hencky.trace() - d.volume_change().ln_1p()).abs() < 1e-14);
        let product: f64 = d.stretches().iter().product();
        prop_assert!((product / d.jacobian() - 1.0).abs() < 1e-14);
    }

    /// A rotation rounded to 2⁻²⁰ changes the volume by about 1e-6, which integers represent
    /// exactly. The summands are as large as one: working precision would lose six digits.
    #[test]
    fn the_volume_change_of_a_rotation_keeps_its_digits(q in rotation()) {
        let whole = (q - Matrix3::identity()).map(|x| (x * f64::from(1 << 20)).round() as i128);
        let minor = |r: [usize; 2], c: [usize; 2]| {
            whole[(r[0], c[0])] * whole[(r[1], c[1])] - whole[(r[0], c[1])] * whole[(r[1], c[0])]
        };
        let pairs = [[0, 1], [0, 2], [1, 2]];
        let second: i128 = pairs.iter().map(|&pair| minor(pair, pair)).sum();
        let third = whole[(0, 0)] * minor([1, 2], [1, 2]) - whole[(0, 1)] * minor([1, 2], [0, 2])
            + whole[(0, 2)] * minor([1, 2], [0, 1]);
        let change = ((whole.trace() << 40) + (second << 20) + third) as f64 / 2f64.powi(60);
        let h = whole.map(|x| x as f64 / f64::from(1 << 20));
        let found = Deformation::from_displacement_gradient(h).volume_change();
        // A sum may lose two digits.
        prop_assert!((found / change - 1.0).abs() < 1e-13 || change == 0.0, "{found:e} {change:e}");
    }

    /// A modulus does not depend on the unit of length or force.
    #[test]
    fn contacts_scale(length in -9.0..9.0f64, force in -9.0..9.0f64) {
        let (l, f) = (10f64.powf(length), 10f64.powf(force));
        let modulus = 40e3 * f / (l * l);
        let ball = Body::elastic(modulus, 0.4).unwrap();
        let reduced = Body::rigid().reduced_modulus_pa(ball).unwrap();
        let contact = HertzContact::from_force(1e-3 * f, 4e-3 * l, reduced).unwrap();
        let known = |value: f64| Estimate::new(value, 1e-3 * value);
        let load = LoadState::new(Estimate::new(1e-3 * f, 1e-5 * f))
            .with_radius(known(contact.contact_radius_m))
            .with_indentation(known(contact.indentation_m));
        let sphere = HertzSphere::new(4e-3 * l, 0.4).unwrap();
        let found = sphere.estimate(&LoadSeries::new([load])).unwrap();
        prop_assert!((found.youngs_modulus_pa / modulus - 1.0).abs() < 1e-12);
        let radius = contact.contact_radius_m;
        let outside = HertzContact::surface_displacement_m(3.0 * radius, radius, 1.0, 1.0);
        prop_assert!(outside > 0.0);
    }
}

#[test]
fn measures_allocate_nothing() {
    let gradients = vec![Matrix3::from_diagonal_element(0.01); 100];
    let mut strains = vec![Matrix3::zeros(); 100];
    let info = allocation_counter::measure(|| {
        for measure in measures() {
            for (h, e) in gradients.iter().zip(&mut strains) {
                *e = measure.strain(h).unwrap();
            }
        }
    });
    assert_eq!(info.count_total, 0);
}

#[test]
fn bad_gradients_are_named() {
    let broken = Matrix3::from_diagonal_element(f64::NAN);
    let quantity = Quantity::DeformationGradient;
    for measure in measures() {
        let error = measure.strain(&broken).unwrap_err();
        assert_eq!(error, ElasticityError::NotFinite { quantity });
    }
    let flat = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
    let flat = Hencky.of(&Deformation::from_deformation_gradient(flat));
    assert_eq!(flat, Err(ElasticityError::SingularDeformation));
    let field = StrainField::from_gradients(&[broken], None, &GreenLagrange);
    assert_eq!(field, Err(ElasticityError::NotFinite { quantity }));
    let weights = StrainField::from_gradients(&[Matrix3::zeros()], Some(&[-1.0]), &GreenLagrange);
    let error = weights.unwrap_err().to_string();
    assert!(error.starts_with("weight must not be negative"), "{error}");
}

#[test]
fn weights_are_areas() {
    let gradients = [0.0, 0.04].map(Matrix3::from_diagonal_element);
    let field = StrainField::from_gradients(&gradients, Some(&[3.0, 1.0]), &Infinitesimal).unwrap();
    assert!((field.summary().mean[(1, 1)] - 0.01f64).abs() < 1e-17);
}

/// A small rotation in each plane, with numbers whose strain is exact: E is 2⁻⁴³, whereas its terms
/// are 2⁻²¹ and need 81 bits.
#[test]
fn what_a_turn_leaves_keeps_all_its_digits_in_every_plane() {
    let power = |k: i32| 2.0_f64.powi(k);
    let turn = power(-10) + power(-40);
    let along = -(power(-21) + power(-50));
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let mut h = Matrix3::zeros();
        (h[(i, j)], h[(j, i)]) = (-turn, turn);
        (h[(i, i)], h[(j, j)]) = (along, along);
        let strain = GreenLagrange.strain(&h).unwrap();
        // along + ½ (along² + turn²) is exactly 2⁻⁴³ + 2⁻⁷¹ + 2⁻⁸¹ + 2⁻¹⁰¹. The last term is half a
        // rounding.
        let expected = power(-43) + power(-71) + power(-81);
        for k in [i, j] {
            let error = (strain[(k, k)] / expected - 1.0).abs();
            assert!(error <= f64::EPSILON, "({i}, {j}): {error:e}");
        }
    }
}
