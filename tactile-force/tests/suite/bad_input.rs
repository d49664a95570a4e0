//! Every invalid value gives an error, and no call panics.

use ndarray::Array2;
use proptest::prelude::*;
use tactile_force::{
    ContactOptions, DriftCorrection, ForceError, ForceMeter, ForceOptions, NoiseModel, Polarity,
    ReferenceFrame, ShearCalibration, ShearPair, measure_force,
};

use crate::blob::{bytes, calibration};

fn rejected<T>(result: Result<T, ForceError>, option: &str) {
    match result {
        Err(ForceError::InvalidOption(found)) => assert_eq!(found.name, option),
        other => panic!("{option}: {:?}", other.err()),
    }
}

#[test]
fn options_outside_their_domain() {
    let contact = ContactOptions::default();
    for rate in [0.0, 1.0, f64::NAN] {
        rejected(contact.with_false_alarm_rate(rate), "false_alarm_rate");
    }
    for share in [-0.1, 1.1, f64::NAN] {
        rejected(contact.with_saturation_limit(share), "saturation_limit");
    }
    for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        rejected(
            ForceMeter::new([1e-5, size], &ForceOptions::default()),
            "pixel_size_m",
        );
    }
    rejected(NoiseModel::new(f64::NAN, 0.0), "read_sd");
    rejected(NoiseModel::new(0.5, -1.0), "gain");
}

#[test]
fn images_that_do_not_fit() {
    let (small, large) = (Array2::<u8>::zeros((20, 30)), Array2::<u8>::zeros((20, 31)));
    let measure = |f: &Array2<u8>, r: &Array2<u8>| {
        measure_force(
            f.view(),
            r.view(),
            [1e-5; 2],
            &calibration(),
            &ForceOptions::default(),
        )
    };
    assert_eq!(
        measure(&large, &small),
        Err(ForceError::SizeMismatch {
            expected: (20, 30),
            found: (20, 31)
        })
    );
    let empty = Array2::<u8>::zeros((0, 30));
    assert_eq!(
        measure(&empty, &empty),
        Err(ForceError::EmptyImage {
            rows: 0,
            columns: 30
        })
    );
    assert!(matches!(
        ReferenceFrame::from_frames(&[]),
        Err(ForceError::EmptyImage { .. })
    ));
    assert!(matches!(
        ReferenceFrame::from_frames(&[small.view(), large.view()]),
        Err(ForceError::SizeMismatch { .. })
    ));
    let black = ReferenceFrame::new(small.view()).unwrap().with_flat_field();
    assert!(matches!(black, Err(ForceError::ReferenceTooDark { .. })));
    let long = Array2::<u8>::zeros((1, 20_000));
    assert_eq!(
        measure(&long, &long),
        Err(ForceError::ImageTooLarge {
            found: 20_000,
            limit: 16_384
        })
    );
}

#[test]
fn saturation_beyond_the_stated_share_is_an_error_and_below_it_a_count() {
    let reference = Array2::from_elem((60, 60), 10_u8);
    let mut frame = reference.clone();
    for y in 20..40 {
        for x in 15..45 {
            frame[[y, x]] = if y < 23 { 255 } else { 200 };
        }
    }
    let with = |limit| {
        let contact = ContactOptions::default()
            .with_saturation_limit(limit)
            .unwrap();
        let options = ForceOptions::default().with_contact(contact);
        measure_force(
            frame.view(),
            reference.view(),
            [1e-5; 2],
            &calibration(),
            &options,
        )
    };
    assert_eq!(
        with(0.1),
        Err(ForceError::SaturatedContact {
            share: 0.15,
            limit: 0.1
        })
    );
    let contact = with(0.2).unwrap().contact.unwrap();
    assert_eq!((contact.saturated_px, contact.area_px), (90, 600));
}

#[test]
fn shear_pairs_that_say_nothing() {
    let pair = |u: f64, f: f64| ShearPair {
        centroid_step_m: [u, u],
        force_n: [f, f],
    };
    assert_eq!(
        ShearCalibration::fit(&[pair(1.0, 2.0)]),
        Err(ForceError::TooFewPairs {
            required: 2,
            found: 1
        })
    );
    let nan = [pair(1.0, 2.0), pair(f64::NAN, 1.0)];
    assert_eq!(
        ShearCalibration::fit(&nan),
        Err(ForceError::NonFinitePair { index: 1 })
    );
    let still = [pair(0.0, 2.0), pair(0.0, 1.0)];
    assert!(matches!(
        ShearCalibration::fit(&still),
        Err(ForceError::DegeneratePairs { .. })
    ));
}

/// Blocks, noise, edges, single pixels, full scale: each frame gives a measurement with a finite
/// force, or is refused because of saturation.
fn end_civilly(
    (rows, columns): (usize, usize),
    seed: u64,
    levels: [u8; 4],
) -> Result<(), TestCaseError> {
    let mut next = bytes(seed | 1);
    let mut image = |a: u8, b: u8| {
        Array2::from_shape_fn((rows, columns), |(y, x)| {
            if (y / 7 + x / 11) % 2 == 0 {
                a
            } else {
                b.saturating_add(next() % 8)
            }
        })
    };
    let (frame, reference) = (image(levels[0], levels[1]), image(levels[2], levels[3]));
    for polarity in [Polarity::Brighter, Polarity::Darker] {
        for drift in [DriftCorrection::None, DriftCorrection::TiltedIllumination] {
            let contact = ContactOptions::default()
                .with_polarity(polarity)
                .with_drift(drift);
            let options = ForceOptions::default().with_contact(contact);
            let (frame, reference) = (frame.view(), reference.view());
            match measure_force(frame, reference, [1e-5; 2], &calibration(), &options) {
                Ok(m) => prop_assert!(m.contact.is_none() || m.force_n.value.is_finite()),
                Err(e) => prop_assert!(matches!(e, ForceError::SaturatedContact { .. }), "{e}"),
            }
        }
    }
    Ok(())
}

/// Two columns do not determine the centre of the contact. Without a limit, the iteration once
/// allocated 223 GB for its rings.
#[test]
fn a_centre_that_the_pixels_do_not_determine_is_given_up() {
    end_civilly((19, 2), 12_243_987_543_208_780_806, [192, 252, 19, 3]).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn any_pair_of_images_ends_civilly(
        size in (1_usize..40, 1_usize..70),
        seed in any::<u64>(),
        levels in proptest::array::uniform4(any::<u8>()),
    ) {
        end_civilly(size, seed, levels)?;
    }
}
