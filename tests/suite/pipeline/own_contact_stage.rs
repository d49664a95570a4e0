//! A user-defined contact stage may return wrong results.
use crate::common::press_of;
use ndarray::{Array2, ArrayView2};
use tactile_imaging::force::{ForceError, ReferenceFrame};
use tactile_imaging::pipeline::{ContactStage, FrameContact, LightContact, PipelineError};
use tactile_imaging::{Object, Pipeline};

/// Detection by light, with a mask or region that is then damaged.
struct Spoiled {
    light: LightContact,
    spoil: fn(&mut FrameContact),
}

impl ContactStage for Spoiled {
    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError> {
        let mut contact = self.light.measure(frame, reference)?;
        (self.spoil)(&mut contact);
        Ok(contact)
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        self.light.pixel_size_m()
    }
}

/// A square face of 30 pixels, and a frame without it.
fn frames() -> [Array2<u8>; 2] {
    let face = Array2::from_shape_fn((64, 64), |(r, c)| {
        let inside = (17..47).contains(&r) && (17..47).contains(&c);
        if inside { 110 } else { 10 }
    });
    [Array2::from_elem((64, 64), 10), face]
}

#[test]
fn a_mask_that_does_not_fit_is_an_error_and_no_panic() {
    // Replaces the first and the last row of the region.
    fn rows(contact: &mut FrameContact, change: fn([usize; 2]) -> [usize; 2]) {
        let region = contact.region.as_mut().unwrap();
        [region.row_start, region.row_end] = change([region.row_start, region.row_end]);
    }
    let spoils: [fn(&mut FrameContact); 3] = [
        |contact| contact.mask = Array2::default((3, 5)),
        |contact| rows(contact, |[start, end]| [start + 100, end + 100]),
        |contact| rows(contact, |[start, end]| [end, start]),
    ];
    let [reference, face] = frames();
    let block = Object::Block { poisson_ratio: 0.5 };
    for object in [block, Object::sphere(3e-3)] {
        for spoil in spoils {
            let light = LightContact::gauged([50e-6; 2], &Default::default()).unwrap();
            let pipeline = Pipeline::new(Spoiled { light, spoil }, object).unwrap();
            let press = press_of(&pipeline, reference.view(), [face.clone()]);
            let error = press.contact(0).unwrap_err();
            assert!(
                matches!(error, PipelineError::ContactMask { frame: 0, .. }),
                "{error}"
            );
            assert!(press.measure().youngs_modulus_pa.is_err());
        }
    }
}
